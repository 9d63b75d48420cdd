//! A first look at a word: what a coarse grid of its chains lets through.

use super::chain::{Departure, Visibility};
use super::grid::{GRID_BITS, GridPoint};
use super::quadrature::COARSE_LEVEL;
use super::word::{WordId, Words};

/// Known chains that are looked at where a coarse grid finds none of a word.
const MOST_LANDINGS: usize = 9;

/// Legal chains on the grid below which one twice as fine is asked.
const FEW: f64 = 9.0;

/// What a coarse grid of samples tells of a word.
pub struct Look {
    /// Irradiance per unit of radiance that its chains let through [sr], whatever follows: leaving
    /// the medium is reckoned in.
    pub passed: f64,
    /// The same without losses.
    pub offered: f64,
    /// Whether any last leg leads anywhere but to the next specular surface.
    pub reaches: bool,
    /// Whether the grid saw none of its chains, and only those known from elsewhere tell of it.
    pub island: bool,
}

impl Look {
    /// Looks at one chain of the word, if it exists; whether it is legal.
    fn ask(&mut self, departure: Option<&Departure>) -> bool {
        let Some(departure) = departure else { return false };
        self.reaches |= !matches!(departure.visible, Visibility::Blocked(_));
        let legal = departure.is_legal();
        if legal {
            let weight = departure.weight.v.max(0.0);
            self.passed += weight * departure.lossless_throughput();
            self.offered += weight;
        }
        legal
    }

    /// Looks at the word's chains at some points; how many are legal.
    fn ask_all(
        &mut self,
        words: &mut Words<'_>,
        word: WordId,
        points: impl IntoIterator<Item = GridPoint>,
    ) -> f64 {
        points.into_iter().filter(|at| self.ask(words.reached(word, *at))).count() as f64
    }
}

/// Looks at a word.
pub fn look(words: &mut Words<'_>, word: WordId) -> Look {
    if let Some(look) = look_through_window(words, word) {
        return look;
    }
    let mut look = Look { passed: 0.0, offered: 0.0, reaches: false, island: false };
    let asked = grid(COARSE_LEVEL).count() as f64;
    let mut legal = look.ask_all(words, word, grid(COARSE_LEVEL));
    let area = words.set_area(word, legal / asked);
    // An island between the grid's points.
    look.island = legal == 0.0;
    if !look.island && legal < FEW {
        let finer = grid(COARSE_LEVEL + 1).filter(|at| !is_on(*at, COARSE_LEVEL));
        legal += look.ask_all(words, word, finer);
    }
    // At a ball's limb and at the middle of a disc chains carry nothing.
    if look.passed == 0.0 {
        let known = words.met_at(word, MOST_LANDINGS);
        legal += look.ask_all(words, word, known);
    }
    if legal > 0.0 {
        look.passed *= area / legal;
        look.offered *= area / legal;
    }
    look
}

/// A look at a word of plane mirrors through its window, as if nothing stood in the way.
fn look_through_window(words: &mut Words<'_>, word: WordId) -> Option<Look> {
    let (window, receiver) = (words.window(word)?.clone(), words.receiver());
    match words.part(word, window.corners()) {
        Some(part) => words.keep_area(word, part.area()),
        None => _ = words.set_area(word, 1.0),
    }
    let offered = window.offered(&receiver);
    let (mut throughput, mut asked) = (0.0, 0.0);
    for x in window.points() {
        let at = words.towards(word, &(x - receiver.position))?;
        if let Some(departure) = words.departure(word, at) {
            asked += 1.0;
            throughput += departure.lossless_throughput();
        }
    }
    let passed = if asked > 0.0 { offered * throughput / asked } else { offered };
    Some(Look { passed, offered, reaches: true, island: false })
}

/// Whether a point is on a regular grid.
fn is_on(at: GridPoint, level: u32) -> bool {
    (at.i | at.j) & ((1u32 << (GRID_BITS - level)) - 1) == 0
}

/// The points of a regular grid.
pub fn grid(level: u32) -> impl Iterator<Item = GridPoint> {
    let n = 1u32 << level;
    let step = 1u32 << (GRID_BITS - level);
    (0..=n).flat_map(move |i| (0..=n).map(move |j| GridPoint { i: i * step, j: j * step }))
}
