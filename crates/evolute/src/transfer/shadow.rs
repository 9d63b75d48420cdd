//! What stands in a cell's way, as far as rays tell.
//!
//! Samples see shadows and no edge function does: their borders are bisected, and believed where a few further
//! samples on either side agree; a cell is hidden where one body stands before all its corners, or closer samples
//! say so. What is not believed is the cell's error, and so divides it.

use arrayvec::ArrayVec;

use super::beam::may_hide;
use super::boundary::{Border, border};
use super::chain::Blocker;
use super::estimate::{Estimate, Place};
use super::field::Sight;
use super::grid::GridPoint;
use super::interpolant::Interpolant;
use super::landing::Darkness;
use super::quadrature::{Quadrature, Term};
use crate::geometry::Rgb;
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Share of a cell that something may hide when it reaches into the cell's shaft and none of the five
/// rays to the corners and the centre meets it.
pub const HIDDEN_SHARE: f64 = 0.5;
/// Share of a torn cell's worth, lit all over, that its error is not taken to be below: the edge
/// functions are extrapolated there.
const TORN_SHARE: f64 = 0.1;
/// Divisions of the first grid from which on samples of the lit part of a cell tell that it is hidden: it may
/// show beyond them.
pub const HIDDEN_LEVELS: u32 = 4;
/// A cell that is worth less than this share of the tolerance is not watched for what hides a part of
/// it between its samples.
const WATCHED_SHARE: f64 = 0.05;

impl Quadrature<'_, '_> {
    /// The worth of an interpolated cell under what sampling alone sees (at the corners, at the centre,
    /// and whether any sample on the lamp's outline is hidden): occluders, chains that do not exist.
    pub(super) fn with_sights(
        &mut self,
        place: &Place,
        interpolant: &mut Interpolant,
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
                if hidden && self.is_lit_somewhere(place, interpolant) {
                    // Between what is hidden and the outline there is light.
                    let half = interpolant.light.irradiance(integral.map(|v| 0.5 * v));
                    return Ok(Estimate { integral: half, error: whole, divide: false });
                }
                if hidden {
                    let deep = place.cell.level >= self.first[term] + HIDDEN_LEVELS
                        || whole <= WATCHED_SHARE * tolerance;
                    if self.is_behind_one(place) || (deep && self.hide_lit_part(place, interpolant))
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
        let hiders = self.hiders(place, interpolant);
        if whole == 0.0 {
            // The lamp is not there; nothing need be asked about what hides it.
        } else if any(Sight::Off) || !hiders.is_empty() {
            let shown = place.corners().map(|at| self.shows(term, at, &hiders));
            let seen = |shown: Option<bool>| shown != Some(false);
            let at_centre = seen(self.shows(term, place.at(0.5, 0.5), &hiders));
            let ask = |a: f64, b: f64| seen(self.shows(term, place.at(a, b), &hiders));
            let watched = whole > WATCHED_SHARE * tolerance;
            match border(shown.map(seen), at_centre, watched, ask) {
                Border::Nothing if !any(Sight::On) && self.is_behind_one(place) => {
                    return Err(Darkness::NoLight);
                }
                Border::Nothing if !any(Sight::On) && !any(Sight::Unknown) => {
                    return Err(Darkness::NoLight);
                }
                Border::Cut(patch, doubt) => {
                    integral = interpolant.behind(*patch, tolerance);
                    error = error.min(whole) + (interpolant.most() * doubt).min(whole);
                    if watched && !self.is_as_cut(place, interpolant) {
                        error = whole;
                    } else if watched && (ends_unseen(shown) || self.may_hide_more(place)) {
                        error = error.max(HIDDEN_SHARE * whole);
                    }
                }
                Border::Everything if hiders.is_empty() => {}
                _ => {
                    integral = integral.map(|v| 0.5 * v);
                    error = whole;
                }
            }
        } else if through && whole > WATCHED_SHARE * tolerance {
            let hidden = self.hidden_share(place, interpolant);
            integral = integral.map(|v| (1.0 - hidden) * v);
            if hidden > 0.0 || self.may_hide_through(place, &[]) {
                error = error.max(whole * hidden.max(HIDDEN_SHARE));
            }
        } else if !through && self.may_hide_through(place, &[]) {
            // All five rays are free; a proof is asked for what stands between them.
            error = error.max(whole * HIDDEN_SHARE);
        }
        if torn && cut {
            error = error.max(TORN_SHARE * interpolant.most());
        }
        let integral = interpolant.light.irradiance(integral);
        Ok(Estimate { integral, error, divide: false })
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
    pub(super) fn hide_all(&self, blockers: &[Blocker], first_cells: bool) -> bool {
        let Some(one) = blockers.first() else { return true };
        (!first_cells || self.is_solid(one.shape)) && blockers.iter().all(|b| b == one)
    }

    /// Whether a body is taken to have no gaps. Other meshes may be blinds or walls with windows.
    fn is_solid(&self, shape: ShapeId) -> bool {
        match &self.words.scene().shape(shape).surface {
            Surface::Mesh(m) => m.is_convex(),
            _ => true,
        }
    }

    /// Whether something may hide more of a cell than the body that is seen to: that one's border is known, if it
    /// has no gaps of its own.
    fn may_hide_more(&mut self, place: &Place) -> bool {
        let points = place.corners().into_iter().chain([place.at(0.5, 0.5)]);
        let numbers: ArrayVec<usize, 5> = points.map(|at| self.sample(place.term, at)).collect();
        let blockers = numbers.iter().filter_map(|k| self.samples[*k].as_ref()?.blocker);
        let known: ArrayVec<ShapeId, 5> =
            blockers.map(|b| b.shape).filter(|shape| self.is_solid(*shape)).collect();
        self.may_hide_through(place, &known)
    }

    /// Whether something else than what is known to reaches into the beam of a cell between the rays that were
    /// asked.
    fn may_hide_through(&mut self, place: &Place, known: &[ShapeId]) -> bool {
        let divisions = place.cell.level.saturating_sub(self.first[place.term]);
        match &self.terms[place.term] {
            Term::Direct(field, _) => {
                let at = place.at(0.0, 0.0).coordinates();
                field.may_hide(at, place.size(), divisions, known)
            }
            Term::Through(word, lamp) => {
                let [p, q, r, s] = place.corners();
                let lamp = &self.lamps[*lamp];
                may_hide(&mut self.words, *word, lamp, [p, q, s, r], divisions, known)
            }
        }
    }

    /// The bodies that are seen to hide some of the lit part of a cell. Where something stands beside the
    /// lamp's outline at a corner and nothing else tells, a few points of the lit part are asked.
    fn hiders(&mut self, place: &Place, interpolant: &Interpolant) -> ArrayVec<Blocker, 11> {
        let term = place.term;
        let mut hiders = ArrayVec::new();
        let points = place.corners().into_iter().chain([place.at(0.5, 0.5)]);
        let mut numbers: ArrayVec<usize, 11> = points.map(|at| self.sample(term, at)).collect();
        let known = |q: &Self, k: usize| q.samples[k].as_ref().map(|s| (s.sight, s.blocker));
        let is_off = |q: &Self, k: usize| matches!(known(q, k), Some((Sight::Off, _)));
        let beside = |k: &usize| matches!(known(self, *k), Some((Sight::Unknown, Some(_))));
        if interpolant.is_cut()
            && numbers.iter().any(beside)
            && !numbers.iter().any(|k| is_off(self, *k))
        {
            let lit = interpolant.lit_points().into_iter();
            numbers.extend(lit.map(|(a, b)| self.sample(term, place.at(a, b))));
        }
        for k in numbers.into_iter().filter(|k| is_off(self, *k)) {
            if let Some((_, Some(by))) = known(self, k)
                && !hiders.contains(&by)
            {
                hiders.push(by);
            }
        }
        hiders
    }

    /// Whether a grid point shows the lamp's plane as far as these bodies go; `None` if that is not known.
    fn shows(&mut self, term: usize, at: GridPoint, hiders: &[Blocker]) -> Option<bool> {
        let number = self.sample(term, at);
        let Some(sample) = &self.samples[number] else { return Some(false) };
        match (sample.sight, sample.blocker) {
            (Sight::On, _) => Some(true),
            (Sight::Off, _) => Some(false),
            (Sight::Unknown, Some(by)) => hiders.contains(&by).then_some(false),
            (Sight::Unknown, None) => {
                let asked = sample.legal && matches!(self.terms[term], Term::Through(..));
                asked.then_some(true)
            }
        }
    }
}

/// Whether the border between what is shown at a cell's corners and what is not ends where that is not known.
fn ends_unseen(shown: [Option<bool>; 4]) -> bool {
    [(0, 1), (1, 3), (3, 2), (2, 0)].into_iter().any(|(p, q)| {
        let side = [shown[p], shown[q]];
        side.contains(&Some(false)) && side.contains(&None)
    })
}
