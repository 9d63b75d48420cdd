//! A list whose items stay where they are when it grows.

use std::ops::Index;

/// Items in a chunk: few enough that a receiver with few samples takes little, of those with a kilobyte each.
const CHUNK: usize = 16;

/// Items by number, in chunks: large ones need not be moved for others to be added.
pub struct Store<T>(Vec<Vec<T>>);

impl<T> Default for Store<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Store<T> {
    /// Adds an item; its number.
    pub fn push(&mut self, item: T) -> usize {
        if self.0.last().is_none_or(|chunk| chunk.len() == CHUNK) {
            self.0.push(Vec::with_capacity(CHUNK));
        }
        let last = self.0.len() - 1;
        self.0[last].push(item);
        last * CHUNK + self.0[last].len() - 1
    }
}

impl<T> Index<usize> for Store<T> {
    type Output = T;
    fn index(&self, number: usize) -> &T {
        &self.0[number / CHUNK][number % CHUNK]
    }
}
