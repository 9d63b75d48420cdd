//! What a cell may be worth that its corners call dark.
//!
//! Chains that are known from inside it may contradict them, and they may tell too little: then the cell keeps an
//! error, by which the queue divides it.

use arrayvec::ArrayVec;

use super::chain::Event;
use super::estimate::{GUESSED_LEVELS, Place};
use super::field::{FieldSample, Sight};
use super::grid::GridPoint;
use super::interpolant::{Corners, misses};
use super::landing::Darkness;
use super::quadrature::{FIRST_LEVEL, Quadrature};
use super::scout::{Beam, is_turned};
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
/// The same where what reaches the last mirror turns so fast that no proof is tried: of many such cells few hold light.
const TURNED_SHARE: f64 = 0.001;
/// A lamp that no edge function tells of is looked for beside the samples of cells that are larger on it than this part
/// of its size (a square of its area), and, where all samples see its back, larger than the other.
const LAMP_PIECES: f64 = 40.0;
const BACK_PIECES: f64 = 8.0;
/// Of chains that turn by more than this over a cell [rad], those that exist say nothing of others.
pub const TRUSTED_TURN: f64 = 0.5;

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
        // At the limb of a ball all chains turn fast, however small the cell.
        let early = place.cell.level < FIRST_LEVEL + GUESSED_LEVELS;
        let mut torn = missing && corners.iter().flatten().any(turns);
        if missing && early && corners.iter().any(Option::is_some) {
            let centre = self.sample(place.term, place.at(0.5, 0.5));
            torn |= self.samples[centre].iter().any(|s| turns(&s));
        }
        if torn && (early || self.words.is_guessed(word)) && !self.is_total(word, place) {
            return Some(DOUBT_SHARE * self.undivided(place));
        }
        if missing && is_real {
            let share = self.swept_share(word, parent, lamp, place);
            if share > 0.0 {
                // No more of a cell than of the domain.
                let whole = place.size() * place.size();
                let area = (AREA_MARGIN * self.words.area(word)).min(whole);
                return Some(share * self.undivided(place) * area / whole);
            }
        }
        if is_real {
            return None;
        }
        // What enters a ball leaves it: where it is met tells of all that happens inside.
        let entry = self.entry(word);
        let (entry, parent) = self.words.parent(entry).map_or((word, parent), |p| (entry, p));
        let letter = self.words.letter(entry);
        // Boxes around the pieces of a surface close to the start say little, and they reach beyond its border,
        // of which chains on its continuation say where it is.
        let before = self.words.letter(parent);
        let again = self.is_again(entry);
        let continued = numbers.iter().all(|k| self.samples[*k].is_some());
        if (again || continued) && !early {
            return None;
        }
        // Bodies with many faces have many borders, and a wave meets itself beyond its own.
        let beyond = !again && !self.is_plane(before.shape);
        let Some(beam) = Beam::of(&mut self.words, parent, place.cell, beyond) else {
            return (early && !again)
                .then(|| self.worth_before(parent, lamp, place))
                .filter(|worth| *worth > 0.0);
        };
        let whole = beam.most * place.size() * place.size() * self.lamps[lamp].radiance.luminance();
        let (scene, tracer) = (self.words.scene(), self.words.tracer());
        if beam.may_meet(scene, tracer, letter, 0.0) {
            return Some(DOUBT_SHARE * whole);
        }
        if !early || again || !is_turned(&mut self.words, parent, place.cell) {
            return None;
        }
        // Between directions that are far apart chains may leave the beam, as far as those at the centre show.
        let bulge = bulge(&mut self.words, parent, place, &scene.shape(letter.shape).surface);
        let may_meet = bulge.is_none_or(|by| beam.may_meet(scene, tracer, letter, by));
        may_meet.then_some(TURNED_SHARE * whole)
    }

    /// What a word may be worth in a cell of which no corner shows chains of the word before, by those that are
    /// known from inside: they come from an island, and may go on to the last letter between them.
    fn worth_before(&mut self, parent: WordId, lamp: usize, place: &Place) -> f64 {
        let known = self.words.legal_in(parent, place.cell);
        let worth = |at: GridPoint| {
            let departure = self.words.departure(parent, at);
            departure.map_or(0.0, |d| d.weight.v.abs() * d.lossless_throughput())
        };
        let most = known.into_iter().map(worth).fold(0.0, f64::max);
        let whole = (place.size() * place.size()).min(AREA_MARGIN * self.words.area(parent));
        DOUBT_SHARE * most * whole * self.lamps[lamp].radiance.luminance()
    }

    /// Which share of a cell in which a mirror's limb lies, however small the cell, may show a lamp: there the last
    /// leg turns from that of the chains that still meet the mirror to the straight way on of those that do not.
    fn swept_share(&mut self, word: WordId, parent: WordId, lamp: usize, place: &Place) -> f64 {
        if self.words.letters(word).last().is_none_or(|l| l.event != Event::Reflect) {
            return 0.0;
        }
        if is_turned(&mut self.words, parent, place.cell) {
            return TURNED_SHARE;
        }
        let beam = Beam::past_limb(&mut self.words, word, parent, place.cell);
        let (scene, tracer) = (self.words.scene(), self.words.tracer());
        let shape = self.lamps[lamp].shape;
        let meets =
            beam.is_some_and(|(beam, bulge)| beam.may_meet_shape(scene, tracer, shape, bulge));
        if meets { DOUBT_SHARE } else { 0.0 }
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
        let pieces = if numbers.iter().all(back) { BACK_PIECES } else { LAMP_PIECES };
        let Some(beam) = Beam::of(&mut self.words, word, place.cell, true) else { return false };
        let (scene, tracer) = (self.words.scene(), self.words.tracer());
        let surface = &scene.shape(lamp.shape).surface;
        beam.spread_at(&surface.bounds().centre()) * pieces > surface.area().sqrt() && {
            let bulge = bulge(&mut self.words, word, place, surface).unwrap_or(0.0);
            beam.may_meet_shape(scene, tracer, lamp.shape, bulge)
        }
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
        // Where a few chains from inside go says little of the others in a large cell whose corners say nothing.
        // (A wave that meets itself has many such cells, and little in them.)
        let bare = !self.is_again(word)
            && corners.iter().all(|k| self.samples[*k].is_none())
            && place.cell.level < FIRST_LEVEL + GUESSED_LEVELS;
        if ending.is_empty() || misses(&ending, place.size()) {
            return if bare {
                DOUBT_SHARE * brightest(&known) * whole.min(most_area) * luminance
            } else {
                0.0
            };
        }
        // Of the cell, as much as of the chains that are known; of the domain, as much as it seemed.
        let met = ending.len() as f64;
        brightest(&ending) * (whole * met / (met + 5.0)).min(most_area) * luminance
    }

    /// The word by which chains entered the ball that a word ends at, from inside; else the word itself.
    fn entry(&self, word: WordId) -> WordId {
        let letter = self.words.letter(word);
        let is_ball = matches!(self.words.scene().shape(letter.shape).surface, Surface::Sphere(_));
        let mut at = word;
        while let Some(parent) = self.words.parent(at).filter(|p| {
            let before = self.words.letter(*p);
            is_ball && before.shape == letter.shape
        }) {
            at = parent;
        }
        if self.words.event(at) == Event::Transmit { at } else { word }
    }

    /// Whether a word ends on the surface that it comes from, and not because it is inside a ball.
    pub(super) fn is_again(&self, word: WordId) -> bool {
        let word = self.entry(word);
        let piece = |w: WordId| (self.words.letter(w).shape, self.words.letter(w).primitive);
        self.words.parent(word).is_some_and(|parent| piece(parent) == piece(word))
    }

    fn is_plane(&self, shape: ShapeId) -> bool {
        let surface = &self.words.scene().shape(shape).surface;
        matches!(surface, Surface::Rectangle(_) | Surface::Disk(_) | Surface::Mesh(_))
    }
}

/// How far the last legs of a cell's chains may leave the hull of those at its corners on the way to a surface [m]:
/// as far as the centre's is from what they say of it; `None` where one of them is not known.
fn bulge(words: &mut Words<'_>, word: WordId, place: &Place, to: &Surface) -> Option<f64> {
    let centre = to.bounds().centre();
    let mut leg = |at: GridPoint| {
        words.departure(word, at).map(|d| {
            let x = d.anchor.point.x;
            (x.coords, d.ray.d.v.normalize() * (centre - x).norm())
        })
    };
    let corners: ArrayVec<(Vector3, Vector3), 4> =
        place.corners().into_iter().filter_map(&mut leg).collect();
    let (true, (x, d)) = (corners.is_full(), leg(place.at(0.5, 0.5))?) else { return None };
    let mean =
        |of: fn(&(Vector3, Vector3)) -> Vector3| corners.iter().map(of).sum::<Vector3>() / 4.0;
    Some((x - mean(|c| c.0)).norm() + (d - mean(|c| c.1)).norm())
}
