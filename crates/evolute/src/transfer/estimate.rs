//! What one cell is worth, and how well that is known.
//!
//! The estimate of a cell's error comes from what its interpolant misses at the centre: edges shifted
//! by that residual both ways, plus the weight's residual over the part that is lit. It is an
//! estimate, not a bound: a feature between samples is unseen.

use arrayvec::ArrayVec;

use super::chain::Blocker;
use super::field::{FieldSample, Sight};
use super::grid::GridPoint;
use super::interpolant::{Corners, Interpolant, Light, is_dark};
use super::landing::{Darkness, Square};
use super::polynomial::Patch;
use super::quadrature::{FIRST_LEVEL, LAST_LEVEL, Quadrature, Term};
use super::shadow::{HIDDEN_LEVELS, HIDDEN_SHARE};
use super::word::WordId;
use crate::geometry::Rgb;

/// Divisions of the first grid down to which a cell is not called dark where some of its chains exist
/// and are hidden, and others do not exist.
pub const GUESSED_LEVELS: u32 = 3;
/// Criteria 1 to 3 are not asked of a cell that, lit all over, would be worth less than this share of
/// the tolerance: the error that its samples show is enough to go by.
const MATTERS_SHARE: f64 = 0.02;

/// Share of a cell's worth, lit all over, that is rounding.
const ROUNDING: f64 = 1e-12;

/// Where a cell is.
pub struct Place {
    /// Index of the term.
    pub term: usize,
    /// The cell.
    pub cell: Square,
}

impl Place {
    /// Side in the domain.
    pub fn size(&self) -> f64 {
        self.cell.size()
    }

    /// The grid point nearest to (a, b) of the cell.
    pub fn at(&self, a: f64, b: f64) -> GridPoint {
        let to = |x: f64| (x * f64::from(self.cell.side()) + 0.5) as u32;
        GridPoint { i: self.cell.i + to(a), j: self.cell.j + to(b) }
    }

    /// Its corners, row by row.
    pub fn corners(&self) -> [GridPoint; 4] {
        [self.at(0.0, 0.0), self.at(1.0, 0.0), self.at(0.0, 1.0), self.at(1.0, 1.0)]
    }
}

/// What one cell is worth.
pub struct Estimate {
    /// Irradiance [W/m²].
    pub integral: Rgb,
    /// Estimated error of its luminance [W/m²].
    pub error: f64,
    /// Whether a criterion asks for the cell to be divided before it is integrated.
    pub divide: bool,
}

impl Estimate {
    pub(super) const DARK: Self = Self { integral: Rgb::BLACK, error: 0.0, divide: false };
    const DIVIDE: Self = Self { integral: Rgb::BLACK, error: 0.0, divide: true };
}

impl Quadrature<'_, '_> {
    /// The worth of a cell to about a thousandth of `tolerance` [W/m²] beyond what its interpolant
    /// misses; zero if that is not known yet.
    pub(super) fn estimate(&mut self, place: &Place, tolerance: f64) -> Estimate {
        if let Some(part) = &self.parts[place.term] {
            if !part.meets(place.cell) {
                return Estimate::DARK;
            }
            if part.is_small_in(place.cell) && place.cell.level < LAST_LEVEL {
                return Estimate::DIVIDE;
            }
        }
        self.judge(place, tolerance).unwrap_or_else(|why| {
            let Term::Through(word, lamp) = self.terms[place.term] else { return Estimate::DARK };
            let target = self.lamps[lamp].target();
            let why = match why {
                // That chains meet the surface there does not say that they pass.
                Darkness::NoChain if self.is_total(word, place) => Darkness::NoLight,
                why => why,
            };
            if (why == Darkness::NoChain && self.words.is_met_from(word, place.cell))
                || self.words.reaches_from(word, target, place.cell)
            {
                let error = self.worth(word, lamp, place);
                if error == 0.0 {
                    self.dark[place.term].add(place.cell, Darkness::NoLight);
                }
                return Estimate { error, ..Estimate::DARK };
            }
            if let Some(error) = self.doubt(word, lamp, place, why) {
                return Estimate { error, ..Estimate::DARK };
            }
            self.dark[place.term].add(place.cell, why);
            Estimate::DARK
        })
    }

    /// The worth of a cell, or why it is dark.
    fn judge(&mut self, place: &Place, tolerance: f64) -> Result<Estimate, Darkness> {
        let (term, level) = (place.term, place.cell.level);
        let first = self.first[term];
        let h = place.size();
        if let Term::Through(word, _) = self.terms[term]
            && self.outside_before(word, place)
        {
            return Err(Darkness::NoChain);
        }
        let cone = match self.terms[term] {
            Term::Through(word, _) if self.criteria.normal_variation.is_some() => {
                self.words.normal_cone(word, place.cell)
            }
            _ => 0.0,
        };
        let guessed = match self.terms[term] {
            Term::Through(word, _) => self.words.is_guessed(word),
            Term::Direct(..) => false,
        };
        let numbers = place.corners().map(|point| self.sample(term, point));
        let light = match &self.terms[term] {
            Term::Direct(_, radiance) => Light { radiance: *radiance, channels: 1 },
            Term::Through(word, lamp) => Light {
                radiance: self.lamps[*lamp].radiance,
                channels: if self.words.is_grey(*word) { 1 } else { 3 },
            },
        };
        let large = level < LAST_LEVEL
            && (self.is_large(place, &numbers) || self.is_large_in_island(place, &numbers));
        let corners: Corners<'_> = numbers.map(|k| self.samples[k].as_ref());
        if corners.iter().all(Option::is_none) {
            // A chain that exists nowhere on the corners may still exist inside.
            if large {
                return Ok(Estimate::DIVIDE);
            }
            let centre = self.sample(term, place.at(0.5, 0.5));
            let Some(centre) = &self.samples[centre] else { return Err(Darkness::NoChain) };
            let most = centre.weight[0].v.abs() * h * h * light.radiance.luminance();
            return Ok(Estimate { integral: Rgb::BLACK, error: most, divide: level <= first });
        }
        // Criteria 1 and 2 look at the corners alone, before a cell may be called dark: four corners
        // far apart tell little.
        let most = corners.iter().flatten().fold(0f64, |m, s| m.max(s.weight[0].v.abs()));
        let matters = level < LAST_LEVEL
            && most * h * h * light.radiance.luminance() > MATTERS_SHARE * tolerance;
        let coarse = level < first + 3;
        let c = &self.criteria;
        // Chains beyond the borders of a second or later surface may go anywhere: how they differ says
        // nothing.
        let real = match self.terms[term] {
            Term::Through(word, _) if self.words.parent(word).is_some() => {
                corners.iter().flatten().any(|s| s.legal)
                    || self.words.is_met_from(word, place.cell)
            }
            _ => true,
        };
        let bent = real && c.normal_variation.is_some_and(|c| c.divides(&corners, cone));
        if large || (matters && coarse && bent) {
            return Ok(Estimate::DIVIDE);
        }
        let edges = Interpolant::edges(&corners, guessed, h)?;
        let unlike = c.matching_trees.is_some_and(|c| match self.terms[term] {
            // Borders of shadows on the lamp itself are bisected and held against further samples, which tells more
            // than forced divisions below the first grid would.
            Term::Direct(..) => level < first && c.divides(&corners, 0),
            Term::Through(..) => c.divides(&corners, level - first),
        });
        if matters && unlike {
            return Ok(Estimate::DIVIDE);
        }
        let centre = self.sample(term, place.at(0.5, 0.5));
        let corners: Corners<'_> = numbers.map(|k| self.samples[k].as_ref());
        let centre = self.samples[centre].as_ref();
        let on = |s: Option<&FieldSample>| s.map_or(Sight::Off, |s| s.sight);
        let (sights, middle) = (corners.map(on), on(centre));
        // Off although it is on the outline: something hides the lamp itself there.
        let hidden = corners
            .iter()
            .chain([&centre])
            .flatten()
            .any(|s| s.sight == Sight::Off && s.is_inside());
        let blockers: ArrayVec<Blocker, 5> =
            corners.iter().chain([&centre]).flatten().filter_map(|s| s.blocker).collect();
        // Torn for no reason that is known: the chain exists at some of the samples, and not at others.
        let torn = guessed
            && corners.iter().chain([&centre]).any(|s| s.is_none())
            && corners.iter().chain([&centre]).flatten().any(|s| s.legal);
        let ceiling = self.ceiling(place);
        let corners: Corners<'_> = numbers.map(|k| self.samples[k].as_ref());
        let centre = self.sampled(term, place.at(0.5, 0.5));
        let mut interpolant =
            Interpolant::new(&corners, centre, edges, guessed, h, light, ceiling)?;
        if middle == Sight::Off && sights.iter().all(|s| *s == Sight::Off) {
            let doubtful = torn && level < first + GUESSED_LEVELS;
            // Between two walls that touch a lamp that is seen directly is hidden as far as samples tell.
            let deep =
                matches!(self.terms[term], Term::Direct(..)) && level >= first + HIDDEN_LEVELS;
            let hidden = deep || self.hide_all(&blockers, level < first + 3);
            if !matters || (!doubtful && hidden) {
                return Err(Darkness::NoLight);
            }
            // Light may come through between one body and the next.
            let (integral, error) = interpolant.lit(tolerance);
            let whole = interpolant.light.luminance(integral).abs().max(error);
            return Ok(Estimate { error: HIDDEN_SHARE * whole, ..Estimate::DARK });
        }
        let missing = corners.iter().any(Option::is_none);
        let legal = corners.iter().chain([&centre]).flatten().any(|s| s.legal);
        let nothing = ROUNDING * interpolant.most();
        let sights = (sights, middle, hidden, torn);
        let estimate = self.with_sights(place, &mut interpolant, sights, tolerance)?;
        let worth = estimate.integral.luminance().abs() + estimate.error;
        if missing && (!guessed || !legal) && worth <= nothing && !estimate.divide {
            // The polynomials, extrapolated, leave nothing of the lamp in the cell.
            return Err(if legal { Darkness::NoLight } else { Darkness::NoChain });
        }
        Ok(estimate)
    }

    /// The largest weight in a cell at some of whose corners chains are missing [sr per unit of (a, b)], by the solid
    /// angles of their first legs, which exist there all the same: what chains there are may be those at the limb of a
    /// ball, where weights fall to nothing. Nought where none is missing.
    fn ceiling(&mut self, place: &Place) -> f64 {
        let Term::Through(word, _) = self.terms[place.term] else { return 0.0 };
        let corners = place.corners();
        let numbers = corners.map(|at| self.sample(place.term, at));
        if numbers.iter().all(|k| self.samples[*k].is_some()) {
            return 0.0;
        }
        let first = self.words.first_letter(word);
        let (mut throughput, mut angle) = (0f64, 0f64);
        for at in corners.into_iter().chain([place.at(0.5, 0.5)]) {
            throughput = self.sampled(place.term, at).map_or(0.0, |s| s.throughput).max(throughput);
            angle = self.words.departure(first, at).map_or(0.0, |d| d.weight.v.abs()).max(angle);
        }
        throughput * angle
    }

    /// Whether criterion 1 divides a cell, by the first legs at its corners, whether or not chains go on from
    /// there.
    fn is_large(&mut self, place: &Place, numbers: &[usize; 4]) -> bool {
        let Some(criterion) = self.criteria.solid_angle else { return false };
        let directions = match self.terms[place.term] {
            Term::Through(word, _) => {
                place.corners().map(|at| self.words.first_direction(word, at))
            }
            Term::Direct(..) => {
                numbers.map(|k| self.samples[k].as_ref().map(|s| s.first_direction))
            }
        };
        criterion.divides(&directions, numbers.iter().all(|k| self.samples[*k].is_some()))
    }

    /// Whether a cell from which chains of the word are known is large next to the part of the domain that they come from:
    /// an island is to hold as many cells as the first grid of a domain that is full of chains.
    fn is_large_in_island(&mut self, place: &Place, numbers: &[usize; 4]) -> bool {
        let Term::Through(word, _) = self.terms[place.term] else { return false };
        let levels = self.words.island_levels(word);
        levels > 0
            && place.cell.level < FIRST_LEVEL + levels
            && !self.is_again(word)
            && (numbers.iter().any(|k| self.samples[*k].as_ref().is_some_and(|s| s.legal))
                || self.words.is_met_from(word, place.cell))
    }

    /// Whether the cell lies outside the borders of the word before the last letter: then no chain of
    /// the word need be traced.
    fn outside_before(&mut self, word: WordId, place: &Place) -> bool {
        let Some(parent) = self.words.parent(word) else { return false };
        let numbers = place.corners().map(|at| self.words.number(parent, at));
        let [p, q, r, s] = numbers.map(|k| self.words.numbered(parent, k));
        let (Some(p), Some(q), Some(r), Some(s)) = (p, q, r, s) else { return false };
        let corners = [p, q, r, s].map(|c| &c.edges);
        let count = corners.iter().map(|c| c.len()).min().unwrap_or(0);
        (0..count).any(|k| {
            // Most borders are far from most cells; the margin is only worked out for the others.
            corners.iter().all(|c| c[k].v < 0.0) && {
                let patch = Patch::hermite(&corners.map(|c| c[k]), place.size(), place.size());
                is_dark(&patch, 1)
            }
        })
    }

    /// The most that a cell which a criterion wants divided seems to be worth, lit all over [W/m²].
    pub(super) fn undivided(&mut self, place: &Place) -> f64 {
        let radiance = match &self.terms[place.term] {
            Term::Direct(_, radiance) => *radiance,
            Term::Through(_, lamp) => self.lamps[*lamp].radiance,
        };
        let numbers = place.corners().map(|point| self.sample(place.term, point));
        let weights = numbers.iter().filter_map(|k| self.samples[*k].as_ref());
        let most = weights.flat_map(|s| s.weight.iter()).fold(0f64, |m, w| m.max(w.v.abs()));
        let most = self.ceiling(place).max(most);
        most * place.size() * place.size() * radiance.luminance()
    }
}
