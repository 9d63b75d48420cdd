//! What one cell is worth, and how well that is known.
//!
//! The estimate of a cell's error comes from what its interpolant misses at the centre: edges shifted
//! by that residual both ways, plus the weight's residual over the part that is lit. It is an
//! estimate, not a bound: a feature between samples is unseen.

use arrayvec::ArrayVec;

use super::beam::may_hide;
use super::boundary::{Border, border};
use super::chain::{Blocker, MAX_CHAIN_EDGES};
use super::field::{FieldSample, Sight};
use super::grid::GridPoint;
use super::interpolant::{Corners, Interpolant, Light, is_dark};
use super::landing::{Darkness, Square};
use super::polynomial::Patch;
use super::quadrature::{LAST_LEVEL, Quadrature, Term};
use super::word::WordId;
use crate::geometry::Rgb;
use crate::optics::Dual;
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Share of a cell that something may hide when it reaches into the cell's shaft and none of the five
/// rays to the corners and the centre meets it.
const HIDDEN_SHARE: f64 = 0.5;
/// Divisions of the first grid down to which a cell is not called dark where some of its chains exist
/// and are hidden, and others do not exist.
pub const GUESSED_LEVELS: u32 = 3;
/// Share of a torn cell's worth, lit all over, that its error is not taken to be below: the edge
/// functions are extrapolated there.
const TORN_SHARE: f64 = 0.1;
/// Divisions of the first grid from which on samples of the lit part of a cell tell that it is hidden: it may
/// show beyond them.
const HIDDEN_LEVELS: u32 = 4;
/// A mesh of more triangles may be a blind or a comb; a cube has twelve.
const SOLID_TRIANGLES: usize = 12;
/// A cell that is worth less than this share of the tolerance is not watched for what hides a part of
/// it between its samples.
const WATCHED_SHARE: f64 = 0.05;
/// Criteria 1 to 3 are not asked of a cell that, lit all over, would be worth less than this share of
/// the tolerance: the error that its samples show is enough to go by.
const MATTERS_SHARE: f64 = 0.02;

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
    const DARK: Self = Self { integral: Rgb::BLACK, error: 0.0, divide: false };
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
        let large = level < LAST_LEVEL && self.is_large(place, &numbers);
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
        if matters && c.matching_trees.is_some_and(|c| c.divides(&corners, level - first)) {
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
        let interpolant = Interpolant::new(&corners, centre, edges, guessed, h, light)?;
        if middle == Sight::Off && sights.iter().all(|s| *s == Sight::Off) {
            let doubtful = torn && level < first + GUESSED_LEVELS;
            if !matters || (!doubtful && self.hide_all(&blockers, level < first + 2)) {
                return Err(Darkness::NoLight);
            }
            // Light may come through between one body and the next.
            let (integral, error) = interpolant.lit(tolerance);
            let whole = interpolant.light.luminance(integral).abs().max(error);
            return Ok(Estimate { error: HIDDEN_SHARE * whole, ..Estimate::DARK });
        }
        self.with_sights(place, interpolant, (sights, middle, hidden, torn), tolerance)
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

    /// Whether the cell lies outside the borders of the word before the last letter: then no chain of
    /// the word need be traced.
    fn outside_before(&mut self, word: WordId, place: &Place) -> bool {
        let Some(parent) = self.words.parent(word) else { return false };
        let mut corners: [ArrayVec<Dual, MAX_CHAIN_EDGES>; 4] = Default::default();
        for (edges, at) in corners.iter_mut().zip(place.corners()) {
            match self.words.departure(parent, at) {
                Some(departure) => *edges = departure.edges.clone(),
                None => return false,
            }
        }
        let count = corners.iter().map(|c| c.len()).min().unwrap_or(0);
        (0..count).any(|k| {
            // Most borders are far from most cells; the margin is only worked out for the others.
            corners.iter().all(|c| c[k].v < 0.0) && {
                let patch = Patch::hermite(
                    &std::array::from_fn(|c| corners[c][k]),
                    place.size(),
                    place.size(),
                );
                is_dark(&patch, 1)
            }
        })
    }

    /// The worth of an interpolated cell under what sampling alone sees (at the corners, at the centre,
    /// and whether any sample on the lamp's outline is hidden): occluders, chains that do not exist.
    fn with_sights(
        &mut self,
        place: &Place,
        mut interpolant: Interpolant,
        (sights, middle, hidden, torn): ([Sight; 4], Sight, bool, bool),
        tolerance: f64,
    ) -> Result<Estimate, Darkness> {
        let term = place.term;
        let cut = interpolant.is_cut();
        let (mut integral, mut error) = interpolant.lit(tolerance);
        let whole = interpolant.light.luminance(integral).abs().max(error);
        let any = |sight: Sight| middle == sight || sights.contains(&sight);
        let through = matches!(self.terms[term], Term::Through(..));
        if !any(Sight::On) && whole > 0.0 {
            // None of the five rays is lit; ask where the polynomials say that most light is.
            let (a, b) = interpolant.brightest_point();
            if !self.sees(term, place.at(a, b)) {
                if hidden && self.is_lit_somewhere(place, &interpolant) {
                    // Between what is hidden and the outline there is light.
                    let half = interpolant.light.irradiance(integral.map(|v| 0.5 * v));
                    return Ok(Estimate { integral: half, error: whole, divide: false });
                }
                if hidden {
                    let deep = place.cell.level >= self.first[term] + HIDDEN_LEVELS
                        || whole <= WATCHED_SHARE * tolerance;
                    if self.is_behind_one(place)
                        || (deep && self.hide_lit_part(place, &interpolant))
                    {
                        return Err(Darkness::NoLight);
                    }
                    let error = HIDDEN_SHARE * whole;
                    return Ok(Estimate { error, ..Estimate::DARK });
                }
                // Hidden, as far as one ray tells.
                return Ok(Estimate { integral: Rgb::BLACK, error: whole, divide: false });
            }
        }
        if whole == 0.0 {
            // The lamp is not there; nothing need be asked about what hides it.
        } else if any(Sight::Off) {
            let seen = |s: Sight| s != Sight::Off;
            let ask = |a: f64, b: f64| self.sees(term, place.at(a, b));
            match border(sights.map(seen), seen(middle), ask) {
                Border::Everything => {}
                Border::Nothing => return Err(Darkness::NoLight),
                Border::Cut(patch, doubt) => {
                    integral = interpolant.behind(*patch, tolerance);
                    error = error.min(whole) + (interpolant.most() * doubt).min(whole);
                    let watched = through && whole > WATCHED_SHARE * tolerance;
                    if watched && !self.is_as_cut(place, &mut interpolant) {
                        error = whole;
                    } else if watched && ends_unseen(sights) {
                        error = error.max(HIDDEN_SHARE * whole);
                    }
                }
                Border::Tangled => {
                    integral = integral.map(|v| 0.5 * v);
                    error = whole;
                }
            }
        } else if through && whole > WATCHED_SHARE * tolerance {
            let hidden = self.hidden_share(place, &interpolant);
            integral = integral.map(|v| (1.0 - hidden) * v);
            if hidden > 0.0 || self.may_hide_through(place) {
                error = error.max(whole * hidden.max(HIDDEN_SHARE));
            }
        } else if let Term::Direct(field, _) = &self.terms[term] {
            // All five rays are free; a proof is asked for what stands between them.
            let (a, b) = place.at(0.0, 0.0).coordinates();
            let divisions = place.cell.level - self.first[term];
            if field.may_hide(a, b, place.size(), divisions) {
                error = error.max(whole * HIDDEN_SHARE);
            }
        }
        if torn && cut {
            error = error.max(TORN_SHARE * interpolant.most());
        }
        let integral = interpolant.light.irradiance(integral);
        Ok(Estimate { integral, error, divide: false })
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
        most * place.size() * place.size() * radiance.luminance()
    }

    /// Which share of a few points of the lit part is hidden. All five rays are free, but may lie
    /// outside the lit part, which is what counts.
    fn hidden_share(&mut self, place: &Place, interpolant: &Interpolant) -> f64 {
        if !interpolant.is_cut() {
            return 0.0;
        }
        let points = interpolant.lit_points();
        let hidden = points.iter().filter(|(a, b)| !self.sees(place.term, place.at(*a, *b)));
        hidden.count() as f64 / points.len().max(1) as f64
    }

    /// Whether a few points on either side of a border, the last of the cuts, are seen or not as the border says.
    fn is_as_cut(&mut self, place: &Place, interpolant: &mut Interpolant) -> bool {
        [true, false].into_iter().all(|seen| {
            let points = interpolant.lit_points();
            interpolant.turn_last_cut();
            points.into_iter().all(|(a, b)| self.sees(place.term, place.at(a, b)) == seen)
        })
    }

    /// Whether one of a few points of the lit part is seen to be lit.
    fn is_lit_somewhere(&mut self, place: &Place, interpolant: &Interpolant) -> bool {
        interpolant.lit_points().iter().any(|(a, b)| {
            let asked = self.sample(place.term, place.at(*a, *b));
            self.samples[asked].as_ref().is_some_and(|s| s.sight == Sight::On)
        })
    }

    /// Whether one body stands before all corners of a cell, whether or not the lamp is behind it there.
    fn is_behind_one(&mut self, place: &Place) -> bool {
        let numbers = place.corners().map(|at| self.sample(place.term, at));
        let blockers = numbers.map(|k| self.samples[k].as_ref().and_then(|s| s.blocker));
        let known: ArrayVec<Blocker, 4> = blockers.into_iter().flatten().collect();
        known.is_full() && self.hide_all(&known, true)
    }

    /// Whether bodies hide all of the lit part of a cell, as far as samples of it tell.
    fn hide_lit_part(&mut self, place: &Place, interpolant: &Interpolant) -> bool {
        let inner = interpolant.lit_points().into_iter().map(|(a, b)| place.at(a, b));
        let points = place.corners().into_iter().chain([place.at(0.5, 0.5)]).chain(inner);
        let numbers: Vec<usize> = points.map(|at| self.sample(place.term, at)).collect();
        let samples = numbers.iter().filter_map(|k| self.samples[*k].as_ref());
        let hidden = samples.filter(|s| s.sight == Sight::Off && s.is_inside());
        let blockers: Vec<Blocker> = hidden.filter_map(|s| s.blocker).collect();
        self.hide_all(&blockers, place.cell.level < self.first[place.term] + 2)
    }

    /// Whether bodies hide a whole cell if each of its five rays meets one: the same one, on the same leg (there
    /// may be light between its shadow on the way to a mirror and that on the way back), and at first one that
    /// has no gaps of its own.
    fn hide_all(&self, blockers: &[Blocker], first_cells: bool) -> bool {
        let Some(one) = blockers.first() else { return true };
        let solid = |shape: ShapeId| match &self.words.scene().shape(shape).surface {
            Surface::Mesh(m) => m.triangles().len() <= SOLID_TRIANGLES,
            _ => true,
        };
        (!first_cells || solid(one.shape)) && blockers.iter().all(|b| b == one)
    }

    /// Whether something reaches into the beam of a cell of a word between the rays that were asked.
    fn may_hide_through(&mut self, place: &Place) -> bool {
        let Term::Through(word, lamp) = self.terms[place.term] else { return false };
        let [p, q, r, s] = place.corners();
        let divisions = place.cell.level - self.first[place.term];
        may_hide(&mut self.words, word, &self.lamps[lamp], [p, q, s, r], divisions)
    }

    /// Whether nothing is known to stand in the way at a grid point.
    fn sees(&mut self, term: usize, at: GridPoint) -> bool {
        let asked = self.sample(term, at);
        self.samples[asked].as_ref().is_some_and(|s| s.sight != Sight::Off)
    }
}

/// Whether the border between what is seen at a cell's corners and what is not ends where nothing tells of
/// shadows: beyond the lamp's outline it is a guess.
fn ends_unseen(sights: [Sight; 4]) -> bool {
    [(0, 1), (1, 3), (3, 2), (2, 0)].into_iter().any(|(p, q)| {
        let side = [sights[p], sights[q]];
        side.contains(&Sight::Off) && side.contains(&Sight::Unknown)
    })
}
