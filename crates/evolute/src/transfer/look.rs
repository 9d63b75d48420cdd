//! A first look at a word: what a coarse grid of its chains lets through.

use super::chain::{Departure, Visibility};
use super::grid::{GRID_BITS, GridPoint};
use super::quadrature::COARSE_LEVEL;
use super::word::{WordId, Words};

/// From so many reflections in a row by one side of one surface on, chains whisper along it.
pub const WHISPER: usize = 16;

/// Known chains that are looked at where a coarse grid finds none of a word.
const MOST_LANDINGS: usize = 9;

/// Legal chains on the grid below which one twice as fine is asked.
const FEW: usize = 9;

/// Share of the weights around it below which a chain's weight stands for no other: at a ball's limb and at the middle
/// of a disc chains carry nothing, and next to them much.
const FADED: f64 = 0.1;

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
    /// Looks at one chain of the word, if it exists; whether it is legal. It stands for what is `around` it, where its own
    /// weight next to that of first legs there is none.
    fn ask(&mut self, departure: Option<&Departure>, around: f64) -> bool {
        let Some(departure) = departure else { return false };
        self.reaches |= !matches!(departure.visible, Visibility::Blocked(_));
        let legal = departure.is_legal();
        if legal {
            let own = departure.weight.v.max(0.0);
            let weight = if own < FADED * around { around } else { own };
            self.passed += weight * departure.lossless_throughput();
            self.offered += weight;
        }
        legal
    }

    /// Looks at the word's chains at some points; the legal ones.
    fn ask_all(
        &mut self,
        words: &mut Words<'_>,
        word: WordId,
        points: impl IntoIterator<Item = GridPoint>,
    ) -> Vec<GridPoint> {
        points.into_iter().filter(|at| self.ask(words.reached(word, *at), 0.0)).collect()
    }
}

/// The mean weight of first legs at the points of a regular grid next to a point.
fn weight_around(words: &mut Words<'_>, word: WordId, at: GridPoint) -> f64 {
    let first = words.first_letter(word);
    let step = 1u32 << (GRID_BITS - COARSE_LEVEL - 1);
    let nearest = |x: u32| i64::from((x + step / 2) / step);
    let to = |k: i64| u32::try_from(k * i64::from(step)).ok().filter(|x| *x <= 1 << GRID_BITS);
    let beside = |k: i64| (k - 1..=k + 1).filter_map(to);
    let (mut sum, mut count) = (0.0, 0.0);
    for (i, j) in beside(nearest(at.i)).flat_map(|i| beside(nearest(at.j)).map(move |j| (i, j))) {
        sum += words.departure(first, GridPoint { i, j }).map_or(0.0, |d| d.weight.v.max(0.0));
        count += 1.0;
    }
    sum / count
}

/// Looks at a word.
pub fn look(words: &mut Words<'_>, word: WordId) -> Look {
    if let Some(look) = look_through_window(words, word) {
        return look;
    }
    let mut look = Look { passed: 0.0, offered: 0.0, reaches: false, island: false };
    let asked = grid(COARSE_LEVEL).count() as f64;
    let mut legal = look.ask_all(words, word, grid(COARSE_LEVEL));
    let area = words.set_area(word, legal.len() as f64 / asked);
    // An island between the grid's points.
    look.island = legal.is_empty();
    if !look.island && legal.len() < FEW {
        let finer = grid(COARSE_LEVEL + 1).filter(|at| !is_on(*at, COARSE_LEVEL));
        legal.extend(look.ask_all(words, word, finer));
    }
    if look.passed == 0.0 {
        let known = words.met_at(word, MOST_LANDINGS);
        legal.extend(look.ask_all(words, word, known));
    }
    if legal.len() < FEW && words.run(word) < WHISPER {
        (look.passed, look.offered) = (0.0, 0.0);
        for at in &legal {
            let around = weight_around(words, word, *at);
            look.ask(words.departure(word, *at), around);
        }
    }
    let share = area / legal.len().max(1) as f64;
    look.passed *= share;
    look.offered *= share;
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
