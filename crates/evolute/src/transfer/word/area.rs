//! How much of the domain a word's chains come from, and how bright what they come to may be: what bounds the
//! worth of words that are left out.

use super::{WordId, Words};
use crate::transfer::chain::Departure;
use crate::transfer::grid::GridPoint;
use crate::transfer::landing::{Square, Target};

/// Most halvings of a domain for an island: what is smaller brings little.
const MOST_ISLAND_LEVELS: u32 = 5;

impl Words<'_> {
    /// Luminance of the brightest that a word's chains and all that continue them may come to [W/(m² sr)], if
    /// that was kept.
    pub fn reach(&self, word: WordId) -> Option<f64> {
        self.words[word.0 as usize].reach
    }

    /// Keeps it, for the words that go on by the same letter, too.
    pub fn set_reach(&mut self, word: WordId, reach: f64) {
        self.words[word.0 as usize].reach = Some(reach);
    }

    /// How much of the domain legal chains seem to come from.
    pub fn area(&self, word: WordId) -> f64 {
        self.words[word.0 as usize].area
    }

    /// How many times the domain is to be halved for as few cells to hold the word's legal chains as a domain that is
    /// full of them has.
    pub fn island_levels(&self, word: WordId) -> u32 {
        let side = self.area(word).clamp(0.0, 1.0).sqrt();
        (0..MOST_ISLAND_LEVELS).take_while(|k| side * f64::from(2u32 << k) <= 1.0).count() as u32
    }

    /// Keeps a cell in which letters were searched for and that was not divided further.
    pub fn set_scouted(&mut self, word: WordId, cell: Square) {
        self.words[word.0 as usize].scouted.push(cell);
    }

    /// How much of the domain the cells say in which letters were searched for that the chains of the word
    /// before meet the last one from, by their corners.
    fn scouted_area(&mut self, parent: WordId, letter: Target) -> f64 {
        let cells = std::mem::take(&mut self.words[parent.0 as usize].scouted);
        let mut sum = 0.0;
        for cell in &cells {
            let mut meets = |at: &GridPoint| {
                // What was not traced there is not legal.
                let legal = self.known(parent, *at).is_some_and(Departure::is_legal);
                legal && self.met(parent, *at) == Some(letter)
            };
            let share = 0.25 * cell.corners().iter().filter(|at| meets(at)).count() as f64;
            sum += share * cell.size() * cell.size();
        }
        self.words[parent.0 as usize].scouted = cells;
        sum
    }

    /// Keeps how much of the domain legal chains come from.
    pub fn keep_area(&mut self, word: WordId, area: f64) {
        self.words[word.0 as usize].area = area;
    }

    /// Keeps how much of the domain legal chains come from: `sampled` for a first letter, and else what
    /// the landings of the word before say. Letters that share a parent share its chains.
    pub fn set_area(&mut self, word: WordId, sampled: f64) -> f64 {
        let area = self.parent(word).map_or(sampled, |id| {
            let letter = self.letter(word);
            let parent = &self.words[id.0 as usize];
            let (regular, share) = parent.landings.share(letter, parent.first_level);
            if regular > 0.0 {
                return regular;
            }
            // An island between the grid's points is no larger than one point's share.
            let cells = f64::from(1u32 << parent.first_level).powi(2);
            let least = share * parent.area.min(1.0 / cells);
            let fine = parent.landings.fine_share(letter, parent.first_level);
            self.scouted_area(id, letter).max(least).max(fine)
        });
        self.words[word.0 as usize].area = area;
        area
    }
}
