//! Squares of the film in a quadtree.

use super::UNITS;

/// Blocks of level 0 have this size [units]: 8 pixels.
pub(super) const COARSEST: u32 = 8 * UNITS;

/// A square of the film: place in multiples of its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Block {
    pub level: u8,
    pub x: u32,
    pub y: u32,
}

impl Block {
    pub fn size(&self) -> u32 {
        COARSEST >> self.level
    }

    /// Corners in the order (0,0), (1,0), (0,1), (1,1) [units].
    pub fn corners(&self) -> [(u32, u32); 4] {
        let s = self.size();
        let (x, y) = (self.x * s, self.y * s);
        [(x, y), (x + s, y), (x, y + s), (x + s, y + s)]
    }

    pub fn parent(&self) -> Option<Self> {
        (self.level > 0).then(|| Self { level: self.level - 1, x: self.x / 2, y: self.y / 2 })
    }

    pub fn children(&self) -> [Self; 4] {
        let (x, y) = (2 * self.x, 2 * self.y);
        [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| Self {
            level: self.level + 1,
            x,
            y,
        })
    }
}
