//! What a cell may be worth that its corners call dark.
//!
//! Chains that are known from inside it may contradict them, and they may tell too little: then the cell keeps an
//! error, by which the queue divides it.

use arrayvec::ArrayVec;

use super::chain::{Departure, Event};
use super::estimate::{GUESSED_LEVELS, Place};
use super::field::{FieldSample, Sight};
use super::grid::GridPoint;
use super::interpolant::{Corners, misses};
use super::landing::Darkness;
use super::quadrature::{FIRST_LEVEL, Quadrature};
use super::scout::Beam;
use super::word::{WordId, Words};
use crate::geometry::Vector3;
use crate::scene::ShapeId;
use crate::surface::Surface;

/// The part of the domain that a word's chains come from is known from samples: this covers what lies
/// between them.
const AREA_MARGIN: f64 = 1.5;
/// Share of a dark cell's worth, lit all over, that counts as its error while no proof speaks for the
/// darkness between its corners.
const DOUBT_SHARE: f64 = 0.1;
/// Divisions of the first grid down to which a lamp that no edge function tells of is looked for beside its samples.
const UNOUTLINED_LEVELS: u32 = 6;
/// Of chains that turn by more than this over a cell [rad], those that exist say nothing of others.
const TRUSTED_TURN: f64 = 0.5;

impl Quadrature<'_, '_> {
    /// Whether chains at the corners or the centre of a cell meet the word's last letter and are totally
    /// reflected instead of transmitted.
    pub(super) fn is_total(&mut self, word: WordId, place: &Place) -> bool {
        let points = place.corners().into_iter().chain([place.at(0.5, 0.5)]);
        points.into_iter().any(|at| self.words.is_total(word, at))
    }

    /// What a dark cell may be worth where its corners tell too little [W/m²]: the first surface may be
    /// bent more inside it, the chains that exist turn too fast to tell of those that do not, or the last
    /// letter stands in the beam and no chain is known to meet it.
    pub(super) fn doubt(
        &mut self,
        word: WordId,
        lamp: usize,
        place: &Place,
        why: Darkness,
    ) -> Option<f64> {
        if self.may_show_unoutlined(word, lamp, place) {
            return Some(DOUBT_SHARE * self.undivided(place));
        }
        let numbers = place.corners().map(|point| self.sample(place.term, point));
        let corners: Corners<'_> = numbers.map(|k| self.samples[k].as_ref());
        let is_real = corners.iter().flatten().any(|s| s.legal);
        if let Some(criterion) = self.criteria.normal_variation
            && why == Darkness::NoLight
            && criterion.hides(&corners, self.words.normal_cone(word, place.cell))
        {
            return Some(DOUBT_SHARE * self.undivided(place));
        }
        let turns = |s: &&FieldSample| s.legal && s.turning * place.size() > TRUSTED_TURN;
        let parent = self.words.parent(word)?;
        let missing = corners.iter().any(Option::is_none);
        let torn = missing && corners.iter().flatten().any(turns);
        // At the limb of a ball all chains turn fast, however small the cell.
        let early = place.cell.level < FIRST_LEVEL + GUESSED_LEVELS;
        if torn && (early || self.words.is_guessed(word)) && !self.is_total(word, place) {
            return Some(DOUBT_SHARE * self.undivided(place));
        }
        if missing && is_real && self.may_sweep(word, parent, lamp, place) {
            return Some(DOUBT_SHARE * self.undivided(place));
        }
        if is_real {
            return None;
        }
        let letter = self.words.letter(word);
        // Boxes around the pieces of a surface close to the start say little, and they reach beyond its border,
        // of which chains on its continuation say where it is.
        let before = self.words.letter(parent);
        let again = (before.shape, before.primitive) == (letter.shape, letter.primitive);
        let continued = numbers.iter().all(|k| self.samples[*k].is_some());
        if (again || continued) && !early {
            return None;
        }
        // Bodies with many faces have many borders, and a wave meets itself beyond its own.
        let beyond = !again && !self.is_plane(before.shape);
        let beam = Beam::of(&mut self.words, parent, place.cell, beyond)?;
        let whole = beam.most * place.size() * place.size() * self.lamps[lamp].radiance.luminance();
        beam.may_meet(self.words.scene(), self.words.tracer(), letter)
            .then_some(DOUBT_SHARE * whole)
    }

    /// Whether a lamp may be seen in the limb of a mirror that ends in a cell, however small: there the last leg
    /// turns from that of the chains that still meet it to the straight way on of those that do not.
    fn may_sweep(&mut self, word: WordId, parent: WordId, lamp: usize, place: &Place) -> bool {
        if self.words.letters(word).last().is_none_or(|l| l.event != Event::Reflect) {
            return false;
        }
        // What reaches the mirror from four directions far apart says little of what lies between.
        let turning = place.corners().map(|at| self.words.departure(parent, at).map_or(0.0, turning));
        if turning.iter().any(|t| t * place.size() > TRUSTED_TURN) {
            return true;
        }
        let Some((beam, bulge)) = Beam::past_limb(&mut self.words, word, parent, place.cell) else {
            return false;
        };
        let (scene, tracer) = (self.words.scene(), self.words.tracer());
        beam.may_meet_shape(scene, tracer, self.lamps[lamp].shape, bulge)
    }

    /// Whether a lamp of which no edge function tells may be seen between the corners of a cell. Where all of them
    /// see its back, only large cells are doubted.
    fn may_show_unoutlined(&mut self, word: WordId, lamp: usize, place: &Place) -> bool {
        let lamp = &self.lamps[lamp];
        if lamp.has_outline() {
            return false;
        }
        let numbers = place.corners().map(|point| self.sample(place.term, point));
        let back = |k: &usize| {
            let blocker = self.samples[*k].as_ref().and_then(|s| s.blocker);
            blocker.is_some_and(|b| b.shape == lamp.shape)
        };
        let divisions = place.cell.level.saturating_sub(self.first[place.term]);
        let most = if numbers.iter().all(back) { GUESSED_LEVELS } else { UNOUTLINED_LEVELS };
        divisions < most
            && Beam::of(&mut self.words, word, place.cell, true).is_some_and(|beam| {
                let (scene, tracer) = (self.words.scene(), self.words.tracer());
                let bulge = bulge(&mut self.words, word, place, &scene.shape(lamp.shape).surface);
                beam.may_meet_shape(scene, tracer, lamp.shape, bulge)
            })
    }

    /// What an island in a cell could be worth if it were lit all over [W/m²], by the chains that are
    /// known from inside the cell and end there: those that go on to a further surface are the next
    /// word's.
    pub(super) fn worth(&mut self, word: WordId, lamp: usize, place: &Place) -> f64 {
        let inside = self.words.known_from(word, self.lamps[lamp].target(), place.cell);
        let numbers: Vec<usize> =
            inside.into_iter().map(|at| self.sample(place.term, at)).collect();
        let corners = place.corners().map(|at| self.sample(place.term, at));
        let scene = self.words.scene();
        let specular = |shape: ShapeId| scene.shape(shape).material.is_specular();
        let known: Vec<&FieldSample> =
            numbers.iter().filter_map(|k| self.samples[*k].as_ref()).collect();
        let ends = |s: &&FieldSample| s.sight == Sight::On || !s.next.is_some_and(specular);
        let ending: Vec<&FieldSample> = known.iter().copied().filter(ends).collect();
        let luminance = self.lamps[lamp].radiance.luminance();
        let brightest =
            |of: &[&FieldSample]| of.iter().fold(0f64, |m, s| m.max(s.weight[0].v.abs()));
        let whole = place.size() * place.size();
        let most_area = AREA_MARGIN * self.words.area(word);
        // That a few chains all go on says little of the others in a large cell whose corners say nothing: from a
        // plane mirror's corners chains may run away from the next one. On curved surfaces such cells abound.
        let bare = self.is_plane(self.words.letter(word).shape)
            && corners.iter().all(|k| self.samples[*k].is_none());
        if ending.is_empty() && bare && place.cell.level < FIRST_LEVEL + GUESSED_LEVELS {
            return DOUBT_SHARE * brightest(&known) * whole.min(most_area) * luminance;
        }
        if misses(&ending, place.size()) {
            return 0.0;
        }
        // Of the cell, as much as of the chains that are known; of the domain, as much as it seemed.
        let met = ending.len() as f64;
        brightest(&ending) * (whole * met / (met + 5.0)).min(most_area) * luminance
    }

    fn is_plane(&self, shape: ShapeId) -> bool {
        let surface = &self.words.scene().shape(shape).surface;
        matches!(surface, Surface::Rectangle(_) | Surface::Disk(_) | Surface::Mesh(_))
    }
}

/// How fast the last leg of a chain turns [rad] per unit of (a, b).
fn turning(departure: &Departure) -> f64 {
    departure.ray.d.a.norm() + departure.ray.d.b.norm()
}

/// How far the last legs of a cell's chains may leave the hull of those at its corners on the way to a surface [m]:
/// as far as the centre's is from what they say of it.
fn bulge(words: &mut Words<'_>, word: WordId, place: &Place, to: &Surface) -> f64 {
    let centre = to.bounds().centre();
    let mut leg = |at: GridPoint| {
        words.departure(word, at).map(|d| {
            let x = d.anchor.point.x;
            (x.coords, d.ray.d.v.normalize() * (centre - x).norm())
        })
    };
    let corners: ArrayVec<(Vector3, Vector3), 4> =
        place.corners().into_iter().filter_map(&mut leg).collect();
    let (true, Some((x, d))) = (corners.is_full(), leg(place.at(0.5, 0.5))) else { return 0.0 };
    let mean =
        |of: fn(&(Vector3, Vector3)) -> Vector3| corners.iter().map(of).sum::<Vector3>() / 4.0;
    (x - mean(|c| c.0)).norm() + (d - mean(|c| c.1)).norm()
}
