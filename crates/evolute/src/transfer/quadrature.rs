//! Adaptive quadrature over the quadtrees of all terms of one receiver (Yu & Wu (16)).
//!
//! Cells are divided in order of their estimated error until the sum of the estimates is within the
//! tolerance; ties are broken by the cells' numbers, and leaves are added up anew at the end, in their
//! order.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use arrayvec::ArrayVec;

use super::criteria::Criteria;
use super::estimate::{GUESSED_LEVELS, Place};
use super::field::{DirectField, FieldSample, Sight, sample_through};
use super::grid::{GridHasher, GridPoint};
use super::lamp::Lamp;
use super::landing::{DarkCells, Square, Target};
use super::part::Part;
use super::settings::{Counts, WordShare};
use super::store::Store;
use super::unseen::Brake;
use super::window::Shown;
use super::word::{WordId, Words};
use crate::geometry::Rgb;

/// First grid of a domain: 8 × 8 cells.
pub const FIRST_LEVEL: u32 = 3;
/// First grid for chains of little throughput: 4 × 4 cells, which the criteria divide where they must.
pub const COARSE_LEVEL: u32 = 2;
/// Cells are not divided below this level: sides still have ten bits for bisection.
pub const LAST_LEVEL: u32 = 14;

/// When all but this share of the error is in cells that cannot be divided, dividing the others is in vain.
const SETTLED_SHARE: f64 = 0.1;

/// Cells of at least this share of the worst error are divided together. One at a time, the last steps
/// would be so small that sums stop right at the tolerance, and the estimate says nothing but that.
const WORST_SHARE: f64 = 0.9;
/// Most cells that are divided together.
const MOST_TOGETHER: usize = 64;

/// What is integrated.
pub enum Term<'s> {
    /// A lamp seen directly.
    Direct(Box<DirectField<'s>>, Rgb),
    /// A lamp (by index) through a word.
    Through(WordId, usize),
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    term: u32,
    square: Square,
    integral: Rgb,
    error: f64,
    leaf: bool,
}

struct Candidate {
    error: f64,
    cell: u32,
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Candidate {}
impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Candidate {
    /// Largest error first, ties by the cell's number.
    fn cmp(&self, other: &Self) -> Ordering {
        self.error.total_cmp(&other.error).then(other.cell.cmp(&self.cell))
    }
}

/// All terms of one receiver and their cells.
pub struct Quadrature<'s, 'l> {
    /// The words and their chains.
    pub words: Words<'s>,
    pub(super) lamps: &'l [Lamp],
    pub(super) criteria: Criteria,
    pub(super) brake: &'l Brake<'l>,
    pub(super) terms: Vec<Term<'s>>,
    /// Level of each term's first grid.
    pub(super) first: Vec<u32>,
    pub(super) samples: Store<Option<FieldSample>>,
    /// The part of the domain that each term's light comes from at most, where that is known.
    pub(super) parts: Vec<Option<Part>>,
    /// Each term's cells that are held dark.
    pub(super) dark: Vec<DarkCells>,
    /// Terms of a word, by its number.
    terms_of: Vec<Vec<u32>>,
    /// Numbers of each term's samples by grid point.
    sampled: Vec<HashMap<u64, u32, GridHasher>>,
    /// Whether a lamp is seen directly at grid points without a sample, by term.
    seen: Vec<HashMap<u64, bool, GridHasher>>,
    cells: Vec<Cell>,
    queue: BinaryHeap<Candidate>,
    /// Luminance and error of all leaves so far.
    luminance: f64,
    error: f64,
    /// Error of leaves that cannot be divided.
    settled: f64,
    counts: Counts,
}

impl<'s, 'l> Quadrature<'s, 'l> {
    /// No terms yet.
    pub fn new(
        words: Words<'s>,
        lamps: &'l [Lamp],
        criteria: Criteria,
        brake: &'l Brake<'l>,
    ) -> Self {
        Self {
            words,
            lamps,
            criteria,
            brake,
            terms: Vec::new(),
            first: Vec::new(),
            samples: Store::default(),
            parts: Vec::new(),
            dark: Vec::new(),
            terms_of: Vec::new(),
            sampled: Vec::new(),
            seen: Vec::new(),
            cells: Vec::new(),
            queue: BinaryHeap::new(),
            luminance: 0.0,
            error: 0.0,
            settled: 0.0,
            counts: Counts::default(),
        }
    }

    /// Luminance of what is found so far [W/m²].
    pub fn luminance(&self) -> f64 {
        self.luminance
    }

    /// Estimated error so far [W/m²].
    pub fn error(&self) -> f64 {
        self.error
    }

    /// Whether what is left of the error cannot be divided away, but for little of it.
    pub fn is_settled(&self) -> bool {
        self.error - self.settled <= SETTLED_SHARE * self.settled
    }

    /// Cells so far.
    pub fn cell_count(&self) -> usize {
        self.cells.len()
    }

    /// Work so far.
    pub fn counts(&self) -> Counts {
        let mut sum = self.counts;
        sum += self.words.counts;
        sum
    }

    /// Adds a term with its first grid of 4^`first` cells; a lamp that is seen directly begins with fewer, which are
    /// divided like those of that grid's own.
    pub fn add(&mut self, term: Term<'s>, first: u32, tolerance: f64) {
        let index = self.terms.len() as u32;
        let mut part = None;
        if let Term::Through(word, lamp) = term {
            match Shown::of(&self.words, word, &self.lamps[lamp]) {
                Shown::Nothing => return,
                Shown::Within(whole) => part = Some(whole),
                Shown::Unknown => {}
            }
            let word = word.0 as usize;
            self.terms_of.resize_with(self.terms_of.len().max(word + 1), Vec::new);
            self.terms_of[word].push(index);
        }
        self.terms.push(term);
        self.first.push(first);
        self.parts.push(part);
        self.dark.push(DarkCells::default());
        self.sampled.push(HashMap::default());
        self.seen.push(HashMap::default());
        let level = match self.terms[index as usize] {
            Term::Direct(..) => first.min(COARSE_LEVEL),
            Term::Through(..) => first,
        };
        let n = 1u32 << level;
        for i in 0..n {
            for j in 0..n {
                self.place(index, Square::nth(level, i, j), tolerance);
            }
        }
    }

    /// The largest error of a cell that can be divided; zero if there is none.
    pub fn worst(&self) -> f64 {
        self.queue.peek().map_or(0.0, |c| c.error)
    }

    /// Divides the worst cells; the words whose chains it traced, or `None` if nothing can be divided.
    pub fn divide_worst(&mut self, tolerance: f64) -> Option<Vec<WordId>> {
        let least = WORST_SHARE * self.queue.peek()?.error;
        let mut worst: ArrayVec<u32, MOST_TOGETHER> = ArrayVec::new();
        while !worst.is_full() && self.worst() >= least {
            worst.extend(self.queue.pop().map(|c| c.cell));
        }
        let mut words = Vec::new();
        for index in worst {
            let cell = self.cells[index as usize];
            self.remove(index);
            self.divide(&cell, tolerance);
            if let Term::Through(word, _) = self.terms[cell.term as usize]
                && !words.contains(&word)
            {
                words.push(word);
            }
        }
        Some(words)
    }

    fn remove(&mut self, index: u32) {
        let cell = &mut self.cells[index as usize];
        cell.leaf = false;
        self.luminance -= cell.integral.luminance();
        self.error -= cell.error;
    }

    fn divide(&mut self, cell: &Cell, tolerance: f64) {
        for child in cell.square.children() {
            self.place(cell.term, child, tolerance);
        }
    }

    fn place(&mut self, term: u32, square: Square, tolerance: f64) {
        self.counts.cells += 1;
        let level = square.level;
        let estimate = self.estimate(&Place { term: term as usize, cell: square }, tolerance);
        let mut cell =
            Cell { term, square, integral: estimate.integral, error: estimate.error, leaf: true };
        if estimate.divide && level < LAST_LEVEL {
            if !self.brake.asked_at_division() {
                return self.divide(&cell, tolerance);
            }
            cell.error =
                cell.error.max(self.undivided(&Place { term: term as usize, cell: square }));
        }
        if cell.integral.is_black() && cell.error == 0.0 {
            return;
        }
        if !cell.error.is_finite() {
            cell.error = f64::MAX;
        }
        self.luminance += cell.integral.luminance();
        self.error += cell.error;
        let index = self.cells.len() as u32;
        self.cells.push(cell);
        if level == LAST_LEVEL {
            self.settled += cell.error;
        } else if cell.error > 0.0 {
            self.queue.push(Candidate { error: cell.error, cell: index });
        }
    }

    /// Takes up cells that are held dark and into which chains were traced since that say otherwise. The
    /// words without terms whose last letter was met by such a chain, and from where.
    pub fn open_dark(&mut self, tolerance: f64) -> Vec<(WordId, GridPoint)> {
        let mut met = Vec::new();
        loop {
            let fresh = self.words.take_fresh();
            if fresh.is_empty() {
                return met;
            }
            for (word, target, at) in fresh {
                let words: ArrayVec<WordId, 2> = if target.lamp {
                    ArrayVec::from_iter([word])
                } else {
                    self.words.children_at(word, target).collect()
                };
                for word in words {
                    let terms = self.terms_of.get(word.0 as usize).map_or(0, Vec::len);
                    if terms == 0 {
                        met.push((word, at));
                    }
                    for k in 0..terms {
                        self.open(self.terms_of[word.0 as usize][k], target, at, tolerance);
                    }
                }
            }
        }
    }

    fn open(&mut self, term: u32, target: Target, at: GridPoint, tolerance: f64) {
        let Term::Through(word, lamp) = self.terms[term as usize] else { return };
        if target.lamp && self.lamps[lamp].target() != target {
            return;
        }
        let first = self.first[term as usize];
        if let Some(cell) = self.dark[term as usize].take(at, first, target.lamp) {
            self.place(term, cell, tolerance);
        }
        // (A wave that meets itself has many borders, and little light behind them.)
        if self.is_again(word) {
            return;
        }
        let last = first + GUESSED_LEVELS.max(self.words.island_levels(word) + FIRST_LEVEL - first);
        for cell in self.dark[term as usize].take_beside(at, first) {
            self.place_beside(term, cell, at, last, tolerance);
        }
    }

    /// Divides a cell on whose border a chain is known until that is in a corner of one of its parts.
    fn place_beside(
        &mut self,
        term: u32,
        square: Square,
        at: GridPoint,
        last: u32,
        tolerance: f64,
    ) {
        if square.level >= last || !square.touches(at) || square.corners().contains(&at) {
            return self.place(term, square, tolerance);
        }
        for child in square.children() {
            self.place_beside(term, child, at, last, tolerance);
        }
    }

    /// Direct and specular parts and the error, leaves added up anew in their order.
    pub fn totals(&self) -> (Rgb, Rgb, f64) {
        let (mut direct, mut specular, mut error) = (Rgb::BLACK, Rgb::BLACK, 0.0);
        for cell in self.cells.iter().filter(|c| c.leaf) {
            match self.terms[cell.term as usize] {
                Term::Direct(..) => direct += cell.integral,
                Term::Through(..) => specular += cell.integral,
            }
            error += cell.error;
        }
        (direct, specular, error)
    }

    /// What each word brings, in the words' order; those that bring nothing, too.
    pub fn by_word(&self) -> Vec<WordShare> {
        let mut shares: Vec<WordShare> = self
            .words
            .ids()
            .map(|word| WordShare {
                letters: self.words.letters(word).iter().map(|s| (s.shape, s.event)).collect(),
                irradiance: Rgb::BLACK,
                error: 0.0,
                counts: Counts { chains: self.words.chains(word), ..Counts::default() },
            })
            .collect();
        for cell in &self.cells {
            if let Term::Through(word, _) = self.terms[cell.term as usize] {
                let share = &mut shares[word.0 as usize];
                share.counts.cells += 1;
                if cell.leaf {
                    share.irradiance += cell.integral;
                    share.error += cell.error;
                }
            }
        }
        shares
    }

    /// The number of the term's sample at a grid point; neighbouring cells share it.
    pub(super) fn sample(&mut self, term: usize, at: GridPoint) -> usize {
        if let Some(&known) = self.sampled[term].get(&at.key()) {
            return known as usize;
        }
        let sample = self.compute(term, at);
        let index = self.samples.push(sample);
        self.sampled[term].insert(at.key(), index as u32);
        index
    }

    /// What is known of the term at a grid point, if it was asked for.
    pub(super) fn sampled(&self, term: usize, at: GridPoint) -> Option<&FieldSample> {
        self.sampled[term].get(&at.key()).and_then(|k| self.samples[*k as usize].as_ref())
    }

    /// Whether nothing is known to stand in the way at a grid point. Of a lamp seen directly, bisections ask for no
    /// more than that.
    pub(super) fn sees(&mut self, term: usize, at: GridPoint) -> bool {
        if let Term::Direct(field, _) = &self.terms[term]
            && !self.sampled[term].contains_key(&at.key())
        {
            let counts = &mut self.counts;
            return *self.seen[term].entry(at.key()).or_insert_with(|| field.sees(at, counts));
        }
        let asked = self.sample(term, at);
        self.samples[asked].as_ref().is_some_and(|s| s.sight != Sight::Off)
    }

    fn compute(&mut self, term: usize, at: GridPoint) -> Option<FieldSample> {
        match &self.terms[term] {
            Term::Direct(field, _) => {
                self.counts.chains += 1;
                field.sample(at, &mut self.counts)
            }
            Term::Through(word, lamp) => {
                sample_through(&mut self.words, *word, &self.lamps[*lamp], at)
            }
        }
    }
}
