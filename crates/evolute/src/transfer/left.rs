//! What is left out of one receiver, with what it may be worth.

use std::collections::HashSet;

use super::quadrature::Quadrature;
use super::unseen::UnseenParts;
use super::word::WordId;

/// Most words a receiver follows; what is beyond is added to the error.
const MAX_WORDS: usize = 2048;
/// Chains of one receiver beyond which it is given up: all are kept, a kilobyte or two each, and a cell of
/// a word of fifty letters needs fifty of each of its chains.
pub const MAX_CHAINS: u64 = 500_000;
/// Share of its error that following a whispering word is taken to gain.
const WHISPER_SHARE: f64 = 0.01;

/// Whether no further word may be followed.
pub fn is_full(quadrature: &Quadrature<'_, '_>, left: &Left) -> bool {
    left.followed >= MAX_WORDS || quadrature.counts().chains >= MAX_CHAINS
}

/// A word that was left out and what it is reckoned to be worth.
pub struct LeftWord {
    /// The word.
    pub word: WordId,
    /// What it may be worth [W/m²].
    pub error: f64,
    /// Share of what enters that its chains let through.
    pub throughput: f64,
    /// Whether its chains whisper along one surface.
    pub whispers: bool,
}

impl LeftWord {
    /// What following it may gain beside what dividing a cell gains: one more reflection of a whisper
    /// leaves the next word as much to wait for.
    fn gain(&self) -> f64 {
        if self.whispers { WHISPER_SHARE * self.error } else { self.error }
    }
}

/// What was left out of one receiver.
pub struct Left {
    /// Words that wait.
    pub words: Vec<LeftWord>,
    /// Words of which no chain that carries light is known yet.
    pub unmet: HashSet<WordId>,
    /// How many words were followed.
    pub followed: usize,
    /// What was not looked at.
    pub unseen: UnseenParts,
}

impl Left {
    /// Nothing; what is not looked at will be worth no more than `most` [W/m²].
    pub fn up_to(most: f64) -> Self {
        Self {
            words: Vec::new(),
            unmet: HashSet::new(),
            followed: 0,
            unseen: UnseenParts::up_to(most),
        }
    }

    /// What all of it may be worth [W/m²].
    pub fn error(&self) -> f64 {
        self.words.iter().map(|w| w.error).sum::<f64>() + self.unseen.error()
    }

    /// The most that following a word may gain [W/m²].
    pub fn worst(&self) -> f64 {
        self.words.iter().fold(0.0, |m, w| m.max(w.gain()))
    }

    /// Takes out that word.
    pub fn take_worst(&mut self) -> Option<LeftWord> {
        let worst = self.worst();
        let at = self.words.iter().position(|w| w.gain() == worst)?;
        Some(self.words.remove(at))
    }
}
