//! Adaptive quadrature over the quadtrees of all terms of one receiver (Yu & Wu (16)).
//!
//! Cells are interpolated from corner values and gradients, cut along the edge functions, and
//! divided in order of their estimated error until the sum of the estimates is within the tolerance.
//!
//! The estimate of a cell comes from what the interpolant misses at the cell's centre: edges shifted
//! by that residual both ways, plus the weight's residual over the part that is lit. It is an
//! estimate, not a bound: a feature between samples is unseen.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

use arrayvec::ArrayVec;

use super::boundary::{Border, border};
use super::criteria::Criteria;
use super::cut::{MAX_CONSTRAINTS, Weights, cut_integral};
use super::field::{DirectField, FieldSample, MAX_FIELD_EDGES, Sight, sample_through};
use super::lamp::Lamp;
use super::polynomial::Patch;
use super::settings::Counts;
use super::word::{GRID_BITS, GridHasher, GridPoint, WordId, Words};
use crate::geometry::Rgb;
use crate::optics::Dual;

/// First grid of a domain: 8 × 8 cells.
pub const FIRST_LEVEL: u32 = 3;
/// First grid for chains of little throughput: 4 × 4 cells, which the criteria divide where they must.
pub const COARSE_LEVEL: u32 = 2;
/// Cells are not divided below this level: sides still have ten bits for bisection.
const LAST_LEVEL: u32 = 14;
/// Share of the tolerance that one cell's curves may be straightened for.
const CUT_SHARE: f64 = 1e-3;
/// A cell is dark when an edge function is negative by this share of how far its polynomial bends.
const DARK_MARGIN: f64 = 0.5;
/// Share of a gradient's residual that counts as a value's: the residual of a quartic has that slope
/// half way to the side.
const GRADIENT_SHARE: f64 = 0.25;
/// A cell whose edges, shifted, sweep less than this share of the tolerance needs no closer look: a
/// few dozen such cells are still well within it.
const NEGLIGIBLE_SHIFT: f64 = 2e-3;
/// Criteria 1 to 3 are not asked of a cell that, lit all over, would be worth less than this share of
/// the tolerance: the error that its samples show is enough to go by.
const MATTERS_SHARE: f64 = 0.02;
/// Share of a cell that something may hide when it reaches into the cell's shaft and none of the five
/// rays to the corners and the centre meets it.
const HIDDEN_SHARE: f64 = 0.5;
/// Share of the centre's residual that is left after the bump at the centre took it up.
const LEFT_AFTER_BUMP: f64 = 0.5;

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
    level: u32,
    i: u32,
    j: u32,
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
    lamps: &'l [Lamp],
    criteria: Criteria,
    terms: Vec<Term<'s>>,
    /// Level of each term's first grid.
    first: Vec<u32>,
    samples: Vec<Option<FieldSample>>,
    /// Numbers of each term's samples by grid point.
    sampled: Vec<HashMap<u64, u32, GridHasher>>,
    cells: Vec<Cell>,
    queue: BinaryHeap<Candidate>,
    /// Luminance and error of all leaves so far.
    luminance: f64,
    error: f64,
    counts: Counts,
}

/// What one cell is worth.
struct Estimate {
    integral: Rgb,
    error: f64,
    divide: bool,
}

impl Estimate {
    const DARK: Self = Self { integral: Rgb::BLACK, error: 0.0, divide: false };
}

impl<'s, 'l> Quadrature<'s, 'l> {
    /// No terms yet.
    pub fn new(words: Words<'s>, lamps: &'l [Lamp], criteria: Criteria) -> Self {
        Self {
            words,
            lamps,
            criteria,
            terms: Vec::new(),
            first: Vec::new(),
            samples: Vec::new(),
            sampled: Vec::new(),
            cells: Vec::new(),
            queue: BinaryHeap::new(),
            luminance: 0.0,
            error: 0.0,
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

    /// Adds a term with its first grid of 4^`first` cells.
    pub fn add(&mut self, term: Term<'s>, first: u32, tolerance: f64) {
        let index = self.terms.len() as u32;
        self.terms.push(term);
        self.first.push(first);
        self.sampled.push(HashMap::default());
        let n = 1u32 << first;
        let step = 1u32 << (GRID_BITS - first);
        for i in 0..n {
            for j in 0..n {
                self.place(index, first, i * step, j * step, tolerance);
            }
        }
    }

    /// The largest error of a cell that can be divided; zero if there is none.
    pub fn worst(&self) -> f64 {
        self.queue.peek().map_or(0.0, |c| c.error)
    }

    /// Divides the worst cell; the word whose chains it traced, or `None` if nothing can be divided.
    pub fn divide_worst(&mut self, tolerance: f64) -> Option<Option<WordId>> {
        let worst = self.queue.pop()?;
        let cell = self.cells[worst.cell as usize];
        self.remove(worst.cell);
        self.divide(&cell, tolerance);
        Some(match &self.terms[cell.term as usize] {
            Term::Through(word, _) => Some(*word),
            Term::Direct(..) => None,
        })
    }

    fn remove(&mut self, index: u32) {
        let cell = &mut self.cells[index as usize];
        cell.leaf = false;
        self.luminance -= cell.integral.luminance();
        self.error -= cell.error;
    }

    fn divide(&mut self, cell: &Cell, tolerance: f64) {
        let half = 1u32 << (GRID_BITS - cell.level - 1);
        for (di, dj) in [(0, 0), (half, 0), (0, half), (half, half)] {
            self.place(cell.term, cell.level + 1, cell.i + di, cell.j + dj, tolerance);
        }
    }

    fn place(&mut self, term: u32, level: u32, i: u32, j: u32, tolerance: f64) {
        self.counts.cells += 1;
        let estimate = self.estimate(term as usize, level, i, j, tolerance);
        let mut cell = Cell {
            term,
            level,
            i,
            j,
            integral: estimate.integral,
            error: estimate.error,
            leaf: true,
        };
        if estimate.divide && level < LAST_LEVEL {
            return self.divide(&cell, tolerance);
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
        if level < LAST_LEVEL && cell.error > 0.0 {
            self.queue.push(Candidate { error: cell.error, cell: index });
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

    /// Irradiance by word.
    pub fn by_word(&self) -> Vec<(WordId, Rgb)> {
        let mut list: Vec<(WordId, Rgb)> = Vec::new();
        for cell in self.cells.iter().filter(|c| c.leaf) {
            if let Term::Through(word, _) = self.terms[cell.term as usize] {
                match list.iter_mut().find(|(w, _)| *w == word) {
                    Some((_, sum)) => *sum += cell.integral,
                    None => list.push((word, cell.integral)),
                }
            }
        }
        list
    }

    /// The number of the term's sample at a grid point; neighbouring cells share it.
    fn sample(&mut self, term: usize, at: GridPoint) -> usize {
        if let Some(&known) = self.sampled[term].get(&at.key()) {
            return known as usize;
        }
        let sample = self.compute(term, at);
        let index = self.samples.len();
        self.samples.push(sample);
        self.sampled[term].insert(at.key(), index as u32);
        index
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

    fn estimate(&mut self, term: usize, level: u32, i: u32, j: u32, tolerance: f64) -> Estimate {
        let first = self.first[term];
        let side = 1u32 << (GRID_BITS - level);
        let h = 1.0 / f64::from(1u32 << level);
        let area = h * h;
        let at = |di, dj| GridPoint { i: i + di, j: j + dj };
        let numbers = [at(0, 0), at(side, 0), at(0, side), at(side, side)]
            .map(|point| self.sample(term, point));
        let corners = numbers.map(|k| self.samples[k].as_ref());
        let (radiance, channels) = match &self.terms[term] {
            Term::Direct(_, radiance) => (*radiance, 1),
            Term::Through(word, lamp) => {
                (self.lamps[*lamp].radiance, if self.words.is_grey(*word) { 1 } else { 3 })
            }
        };
        let missing = corners.iter().filter(|c| c.is_none()).count();
        let centre_at = at(side / 2, side / 2);
        if missing == 4 {
            // A chain that exists nowhere on the corners may still exist inside.
            let centre = self.sample(term, centre_at);
            let Some(centre) = &self.samples[centre] else { return Estimate::DARK };
            let most = centre.weight[0].v.abs() * area * radiance.luminance();
            return Estimate { integral: Rgb::BLACK, error: most, divide: level <= first };
        }
        // Criteria 1 and 2 look at the corners alone, before a cell may be called dark: four corners
        // far apart tell little.
        let most = corners.iter().flatten().fold(0f64, |m, s| m.max(s.weight[0].v.abs()));
        let matters = most * area * radiance.luminance() > MATTERS_SHARE * tolerance;
        if level < LAST_LEVEL && matters {
            let c = &self.criteria;
            let coarse = level < first + 3;
            let forced = coarse
                && (c.solid_angle.is_some_and(|c| c.divides(&corners, area))
                    || c.normal_variation.is_some_and(|c| c.divides(&corners)));
            if forced {
                return Estimate { integral: Rgb::BLACK, error: 0.0, divide: true };
            }
        }
        let edge_count = corners.iter().flatten().map(|c| c.edges.len()).min().unwrap_or(0);
        let mut edges: ArrayVec<Patch, MAX_FIELD_EDGES> = ArrayVec::new();
        for k in 0..edge_count {
            let patch = hermite(&corners, h, |s| s.edges[k]);
            let (_, high) = patch.bounds();
            let margin = DARK_MARGIN * (1 + missing) as f64 * patch.plane().0;
            if high < -margin {
                return Estimate::DARK;
            }
            edges.push(patch);
        }
        if matters
            && level < LAST_LEVEL
            && self.criteria.matching_trees.is_some_and(|c| c.divides(&corners, level - first))
        {
            return Estimate { integral: Rgb::BLACK, error: 0.0, divide: true };
        }
        let centre_number = self.sample(term, centre_at);
        let corners = numbers.map(|k| self.samples[k].as_ref());
        let centre = self.samples[centre_number].as_ref();
        let mut weights = Weights::new();
        let mut weight_residual = 0.0;
        for c in 0..channels {
            let mut patch = hermite(&corners, h, |s| s.weight[c] * area);
            if let Some(s) = centre {
                let (value, slope) = residual(&patch, &(s.weight[c] * area), h);
                patch.add_bump(value);
                let share = if channels == 1 { 1.0 } else { LUMINANCE[c] };
                weight_residual += share * LEFT_AFTER_BUMP * (value.abs() + GRADIENT_SHARE * slope);
            }
            weights.push(patch);
        }
        // Only edges that may vanish in the cell matter.
        let mut shifts: ArrayVec<f64, MAX_FIELD_EDGES> = ArrayVec::new();
        let mut cuts: ArrayVec<Patch, MAX_CONSTRAINTS> = ArrayVec::new();
        for (k, mut patch) in edges.into_iter().enumerate() {
            let mut shift = 0.0;
            if let Some(s) = centre {
                let (value, slope) = residual(&patch, &s.edges[k], h);
                patch.add_bump(value);
                shift = LEFT_AFTER_BUMP * (value.abs() + GRADIENT_SHARE * slope);
            }
            let (low, high) = patch.bounds();
            if high + shift < 0.0 {
                return Estimate::DARK;
            }
            if low - shift < 0.0 {
                cuts.push(patch);
                shifts.push(shift);
            }
        }
        let lum = |v: [f64; 3]| {
            if channels == 1 {
                v[0] * radiance.luminance()
            } else {
                (Rgb(v) * radiance).luminance()
            }
        };
        let full: [f64; 3] = std::array::from_fn(|c| weights.get(c).map_or(0.0, |w| w.integral()));
        let straight = if tolerance > 0.0 {
            CUT_SHARE * tolerance / radiance.luminance().max(f64::MIN_POSITIVE)
        } else {
            1e-3 * full[0].abs()
        };
        let (integral, mut error) = if cuts.is_empty() {
            (full, lum([weight_residual; 3]).abs())
        } else {
            let exact = cut_integral(&weights, &cuts, straight);
            let most = weights.iter().fold(0f64, |m, w| m.max(w.bounds().1));
            let moved = cuts.iter().zip(&shifts).map(|(c, s)| displacement(c, *s)).sum::<f64>();
            let (shift_error, wide) = if lum([most * moved; 3]) <= NEGLIGIBLE_SHIFT * tolerance {
                // The strip that the shift sweeps is worth nothing; its size need not be known.
                (lum([most * moved; 3]), exact)
            } else {
                let shifted = |sign: f64| -> ArrayVec<Patch, MAX_CONSTRAINTS> {
                    cuts.iter().zip(&shifts).map(|(c, s)| c.shifted(sign * s)).collect()
                };
                let wide = cut_integral(&weights, &shifted(1.0), straight);
                let narrow = cut_integral(&weights, &shifted(-1.0), straight);
                let missed = (lum(exact) - 0.5 * (lum(wide) + lum(narrow))).abs();
                (0.5 * (lum(wide) - lum(narrow)).abs() + missed, wide)
            };
            let lit = if full[0].abs() > 0.0 { (wide[0] / full[0]).clamp(0.0, 1.0) } else { 1.0 };
            let straightened = if lit > 0.0 { lum([straight; 3]) * 0.25 } else { 0.0 };
            (exact, shift_error + lum([weight_residual * lit; 3]).abs() + straightened)
        };
        // What sampling alone sees: occluders, chains that do not exist.
        let on = |s: Option<&FieldSample>| s.map_or(Sight::Off, |s| s.sight);
        let sights = corners.map(on);
        let mid = on(centre);
        let any_off = mid == Sight::Off || sights.contains(&Sight::Off);
        let any_on = mid == Sight::On || sights.contains(&Sight::On);
        let whole = lum(integral).abs().max(error);
        let mut result = integral;
        if sights.iter().all(|s| *s == Sight::Off) && mid == Sight::Off {
            return Estimate::DARK;
        }
        if !any_on && whole > 0.0 {
            // None of the five rays is lit; ask where the polynomials say that most light is.
            let (a, b) = brightest_point(&cuts);
            let to = |x: f64| (x * f64::from(side)) as u32;
            let asked = self.sample(term, at(to(a), to(b)));
            if on(self.samples[asked].as_ref()) == Sight::Off {
                // Hidden, as far as one ray tells.
                let integral = Rgb::BLACK;
                return Estimate { integral, error: error.max(whole), divide: false };
            }
        }
        if !any_off {
            // All five rays are free; a proof is asked for what stands between them.
            if let Term::Direct(field, _) = &self.terms[term] {
                let (a, b) = at(0, 0).coordinates();
                if field.may_hide(a, b, h, level < first + 2) {
                    error = error.max(whole * HIDDEN_SHARE);
                }
            }
        }
        if any_off {
            let seen = |s: Sight| s != Sight::Off;
            let mut ask = |a: f64, b: f64| {
                let to = |x: f64| (x * f64::from(side) + 0.5) as u32;
                let point = at(to(a), to(b));
                let asked = self.sample(term, point);
                on(self.samples[asked].as_ref()) != Sight::Off
            };
            match border(sights.map(seen), seen(mid), &mut ask) {
                Border::Everything => {}
                Border::Nothing => return Estimate::DARK,
                Border::Cut(patch, doubt) => {
                    cuts.push(*patch);
                    result = cut_integral(&weights, &cuts, straight);
                    let most = weights.iter().fold(0f64, |m, w| m.max(w.bounds().1));
                    let doubt = (lum([most; 3]) * doubt).min(whole);
                    error = error.min(whole) + doubt;
                }
                Border::Tangled => {
                    result = integral.map(|v| 0.5 * v);
                    error = whole;
                }
            }
        }
        let integral = if channels == 1 { radiance * result[0] } else { Rgb(result) * radiance };
        Estimate { integral, error, divide: false }
    }
}

/// An upper estimate of the area that a constraint's zero sweeps when it is shifted, as a part of the
/// unit cell; one where the constraint bends too much to tell.
fn displacement(constraint: &Patch, shift: f64) -> f64 {
    let (off, [_, ga, gb]) = constraint.plane();
    let slope = (ga * ga + gb * gb).sqrt() - 3.0 * off;
    // A straight line through the cell is at most √2 long.
    if slope > 0.0 { (1.5 * shift / slope).min(1.0) } else { 1.0 }
}

/// The point of a coarse grid where the least constraint is largest.
fn brightest_point(cuts: &[Patch]) -> (f64, f64) {
    let mut best = (f64::NEG_INFINITY, (0.5, 0.5));
    for i in 0..=8 {
        for j in 0..=8 {
            let (a, b) = (f64::from(i) * 0.125, f64::from(j) * 0.125);
            let least = cuts
                .iter()
                .map(|c| {
                    let (low, high) = c.bounds();
                    c.value(a, b) / (high - low).max(f64::MIN_POSITIVE)
                })
                .fold(f64::INFINITY, f64::min);
            if least > best.0 {
                best = (least, (a, b));
            }
        }
    }
    best.1
}

/// Shares of the channels in luminance.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Differences of value and of gradient (as a sum) at the centre between the field and the patch.
fn residual(patch: &Patch, truth: &Dual, h: f64) -> (f64, f64) {
    let p = patch.centre();
    (truth.v - p.v, (truth.a * h - p.a).abs() + (truth.b * h - p.b).abs())
}

/// The patch through the corners; corners where the field does not exist are extrapolated from the
/// others.
fn hermite(
    corners: &[Option<&FieldSample>; 4],
    h: f64,
    pick: impl Fn(&FieldSample) -> Dual,
) -> Patch {
    const AT: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let known: [Option<Dual>; 4] = std::array::from_fn(|k| corners[k].map(&pick));
    let data: [Dual; 4] = std::array::from_fn(|k| {
        known[k].unwrap_or_else(|| {
            let (mut sum, mut count) = (Dual::default(), 0.0);
            for (m, d) in known.iter().enumerate() {
                if let Some(d) = d {
                    let (da, db) = (AT[k][0] - AT[m][0], AT[k][1] - AT[m][1]);
                    sum = sum + Dual::new(d.v + h * (d.a * da + d.b * db), d.a, d.b);
                    count += 1.0;
                }
            }
            sum * (1.0 / count)
        })
    });
    Patch::hermite(&data, h, h)
}
