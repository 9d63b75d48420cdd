//! What the last legs of a cell's chains may meet, beyond what those at its corners are seen to meet.
//!
//! A word's next letters are learnt from what its chains meet, and a word's cell in which no chain is known
//! is dark. A body in the beam between the corners' legs would be missed: cells of which a proof does not
//! keep it out are divided a few times in search of new letters, and are not held dark for known ones.
//!
//! Limit: chains inside a cell may leave the hull of those at its corners by a curved mirror's bend.

use std::cell::OnceCell;

use arrayvec::ArrayVec;

use super::chain::{Departure, Event, Visibility};
use super::doubt::TRUSTED_TURN;
use super::extension::facet;
use super::grid::GridPoint;
use super::interpolant::{is_dark, stays_negative};
use super::landing::{Square, Target};
use super::polynomial::Patch;
use super::shaft::{Body, Shaft, separated};
use super::word::{WordId, Words};
use crate::geometry::{Aabb, Point3, Vector3};
use crate::optics::Dual;
use crate::scene::{Scene, ShapeId};
use crate::surface::{LocalGeometry, Parametric, Surface};
use crate::trace::Tracer;

/// How far the arc of a body is from its chord, as a share of that, up to a right angle.
const LIMB_SAGITTA: f64 = 0.2;
/// Divisions of the first grid's cells in search of letters.
const SCOUTED_LEVELS: u32 = 4;

/// Traces chains of a word in the cells of its first grid in which a legal one may be though none at a corner
/// is, and, if `for_letters`, through which a specular surface may be met that none of the corners' meets.
pub fn scout(words: &mut Words<'_>, word: WordId, first: u32, for_letters: bool) {
    let n = 1u32 << first;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        scout_cell(words, word, Square::nth(first, i, j), first + SCOUTED_LEVELS, for_letters);
    }
}

fn scout_cell(words: &mut Words<'_>, word: WordId, cell: Square, last: u32, for_letters: bool) {
    let divide = cell.level < last
        && !is_behind_one(words, word, cell)
        && match Beam::of(words, word, cell, true) {
            Some(beam) => {
                for_letters
                    && (beam.may_meet_more(words, word, 0.0)
                        || may_turn_to_more(words, word, cell)
                        || !beam.starts.is_full()
                            && is_turned(words, word, cell)
                            && is_more(words, word))
            }
            None => may_be_legal(words, word, cell),
        };
    if !divide {
        words.set_scouted(word, cell);
        return;
    }
    // Where chains turn fast, what is met from the corners of the last cells counts, too.
    let closer = for_letters && cell.level + 1 == last && is_turned(words, word, cell);
    for child in cell.children() {
        if closer && is_more(words, word) {
            for at in child.corners() {
                words.reached(word, at);
            }
        }
        scout_cell(words, word, child, last, for_letters);
    }
}

/// Whether one convex body stands in the same leg of the chains at all corners of a cell, and so in all between.
fn is_behind_one(words: &mut Words<'_>, word: WordId, cell: Square) -> bool {
    let mut first = None;
    for at in cell.corners() {
        let blocker = match words.departure(word, at).map(|d| d.visible) {
            Some(Visibility::Blocked(Some(blocker))) => blocker,
            _ => return false,
        };
        if *first.get_or_insert(blocker) != blocker {
            return false;
        }
    }
    first.is_some_and(|blocker| match &words.scene().shape(blocker.shape).surface {
        Surface::Rectangle(_) | Surface::Disk(_) | Surface::Sphere(_) => true,
        Surface::Mesh(m) => m.is_convex(),
        Surface::Cylinder(_) | Surface::Parametric(_) => false,
    })
}

/// Whether the chains of a word turn so fast in a cell that those at its corners say little of what lies between.
pub fn is_turned(words: &mut Words<'_>, word: WordId, cell: Square) -> bool {
    cell.corners().iter().any(|at| {
        words.departure(word, *at).is_some_and(|d| d.turning() * cell.size() > TRUSTED_TURN)
    })
}

/// Whether there are other specular surfaces than the word's last that no chain of it is known to meet.
fn is_more(words: &Words<'_>, word: WordId) -> bool {
    let (scene, own) = (words.scene(), words.letter(word).shape);
    let all = (0..scene.shapes.len() as u32).map(ShapeId).filter(|id| *id != own);
    all.into_iter().any(|id| {
        scene.shape(id).material.is_specular()
            && (facet(&scene.shape(id).surface, 0).is_some() || !words.has_met(word, (id, None)))
    })
}

/// Whether chains of a word that end at the limb of its last mirror in a cell may meet a specular surface there that no
/// chain of the word is known to meet.
fn may_turn_to_more(words: &mut Words<'_>, word: WordId, cell: Square) -> bool {
    let Some(parent) = words.parent(word) else { return false };
    if words.event(word) != Event::Reflect
        || cell.corners().iter().all(|at| words.departure(word, *at).is_some())
    {
        return false;
    }
    let reach = 2.0 * words.tracer().bounds().diagonal();
    Beam::past_limb(words, word, parent, cell).is_some_and(|(mut beam, bulge)| {
        for ((end, start), d) in beam.ends.iter_mut().zip(&beam.starts).zip(&beam.directions) {
            *end = start + d * reach;
        }
        beam.may_meet_more(words, word, bulge)
    })
}

/// Whether legal chains of a word may be in a cell that has none at its corners: no border of the chain says
/// that all of it is outside. What lies between the borders of two mirrors may be much narrower than a cell.
fn may_be_legal(words: &mut Words<'_>, word: WordId, cell: Square) -> bool {
    let [p, q, r, s] = cell.corners();
    let corners = [p, q, s, r].map(|at| words.departure(word, at).map(|d| d.edges.clone()));
    let known = || corners.iter().flatten();
    let count = known().map(|edges| edges.len()).min().unwrap_or(0);
    known().next().is_some()
        && !(0..count).any(|k| {
            let values: [Option<Dual>; 4] = corners.each_ref().map(|c| c.as_ref().map(|e| e[k]));
            match values {
                [Some(p), Some(q), Some(r), Some(s)] => {
                    is_dark(&Patch::hermite(&[p, q, r, s], cell.size(), cell.size()), 1)
                }
                _ => values.iter().flatten().all(|e| stays_negative(e, cell.size())),
            }
        })
}

/// A surface, or one facet of it.
type Piece = (ShapeId, Option<u32>);

/// The last legs of the chains at the corners of a cell, of which one at least is legal.
pub struct Beam {
    /// Where they leave the last surface [m].
    starts: ArrayVec<Point3, 4>,
    /// Where they meet something [m], or beyond all bounds.
    ends: ArrayVec<Point3, 4>,
    directions: ArrayVec<Vector3, 4>,
    from: Piece,
    /// What those meet that carry light.
    known: ArrayVec<Piece, 4>,
    /// The largest irradiance per unit of radiance and of the domain's area that a corner's chain carries
    /// [sr].
    pub most: f64,
}

impl Beam {
    /// The beam of a word's chains in a cell; `None` if none of its corners' is legal. If one is, those that something
    /// hides count, too, and those `beyond` a border may.
    pub fn of(words: &mut Words<'_>, word: WordId, cell: Square, beyond: bool) -> Option<Self> {
        let (scene, reach) = (words.scene(), words.tracer().bounds().diagonal());
        let piece = |shape, primitive| (shape, facet(&scene.shape(shape).surface, primitive));
        let from = words.letter(word);
        let from = (from.shape, from.primitive);
        let mut beam = Self {
            starts: ArrayVec::new(),
            ends: ArrayVec::new(),
            directions: ArrayVec::new(),
            from,
            known: ArrayVec::new(),
            most: 0.0,
        };
        let mut illegal: ArrayVec<GridPoint, 4> = ArrayVec::new();
        for at in cell.corners() {
            match words.reached(word, at).filter(|d| d.is_legal()) {
                None => illegal.push(at),
                Some(departure) => {
                    beam.add(departure, reach);
                    let met =
                        departure.next.filter(|_| departure.weight.v > 0.0).map(|hit| hit.anchor);
                    beam.known.extend(met.map(|a| piece(a.shape, a.point.primitive)));
                }
            }
        }
        // Where some are legal and others are not, legal chains between run towards those beyond the border, and towards
        // those that something hides.
        if !beam.starts.is_empty() {
            for at in illegal {
                let known = words.departure(word, at);
                let hidden = |d: &&Departure| d.edges.iter().all(|e| e.v > 0.0);
                if let Some(departure) = known.filter(|d| beyond || hidden(d)) {
                    beam.add(departure, reach);
                }
            }
        }
        (!beam.starts.is_empty()).then_some(beam)
    }

    /// The beam of a word's chains in a cell in which its last surface ends, where chains that miss that run
    /// straight on; `None` if no corner's chain is legal. With how far from the hull of the corners' legs those between
    /// may run [m].
    pub fn past_limb(
        words: &mut Words<'_>,
        word: WordId,
        parent: WordId,
        cell: Square,
    ) -> Option<(Self, f64)> {
        let mut beam = Self::of(words, word, cell, false)?;
        let legal = beam.starts.len() as f64;
        let met = Point3::from(beam.starts.iter().map(|p| p.coords).sum::<Vector3>() / legal);
        (beam.starts, beam.directions) = (ArrayVec::new(), ArrayVec::new());
        beam.ends.clear();
        let mut bulge = 0f64;
        for at in cell.corners() {
            let before =
                words.departure(parent, at).map(|d| (d.anchor.point.x, d.ray.d.v.normalize()));
            let leg = words.departure(word, at).map(|d| (d.anchor, d.ray.d.v.normalize()));
            let (start, d) = match (leg, before) {
                (Some((anchor, d)), Some((_, from))) => {
                    let surface = &words.scene().shape(anchor.shape).surface;
                    // The surface bulges from the chord to where it is grazed.
                    let depth =
                        surface.local(&anchor.point).map_or(0.0, |l| depth_of_limb(&l, &from));
                    bulge = bulge.max(LIMB_SAGITTA * depth.min(surface.bounds().diagonal()));
                    (anchor.point.x, d)
                }
                (None, Some((o, d))) => (o + d * (met - o).norm(), d),
                _ => continue,
            };
            beam.starts.push(start);
            beam.directions.push(d);
            beam.ends.push(start);
        }
        Some((beam, bulge))
    }

    fn add(&mut self, departure: &Departure, reach: f64) {
        let (o, d) = (departure.anchor.point.x, departure.ray.d.v);
        self.starts.push(o);
        self.directions.push(d);
        self.ends.push(departure.next.map_or(o + d * reach, |hit| hit.anchor.point.x));
        self.most = self.most.max(departure.weight.v.abs() * departure.lossless_throughput());
    }

    /// Whether a surface may be met as the last letter of a word that follows, by legs that stay within a
    /// distance [m] of the hull of the corners'.
    pub fn may_meet(&self, scene: &Scene, tracer: &Tracer<'_>, letter: Target, bulge: f64) -> bool {
        self.may_meet_any(scene, tracer, bulge, |met| met == (letter.shape, letter.primitive))
    }

    /// How far apart the corners' legs are as far away as a point is [m].
    pub fn spread_at(&self, x: &Point3) -> f64 {
        let legs = self.starts.iter().zip(&self.directions);
        Aabb::around(legs.map(|(start, d)| start + d * (x - start).norm())).diagonal()
    }

    /// Whether any of a shape may be met, whatever stands before it, by legs that stay within a distance [m] of the
    /// hull of the corners'.
    pub fn may_meet_shape(
        mut self,
        scene: &Scene,
        tracer: &Tracer<'_>,
        shape: ShapeId,
        bulge: f64,
    ) -> bool {
        let bounds = scene.shape(shape).surface.bounds();
        let (centre, radius) = (bounds.centre(), 0.5 * bounds.diagonal());
        for ((end, start), d) in self.ends.iter_mut().zip(&self.starts).zip(&self.directions) {
            // Twice as far as need be, for what lies between two legs that turn much is nearer.
            *end = start + d * (2.0 * ((centre - start).norm() + radius));
        }
        self.may_meet_any(scene, tracer, bulge, |met| met.0 == shape)
    }

    /// Whether a specular surface may be met that no chain of the word is known to meet. For the letters
    /// that are known, cells are not held dark instead.
    fn may_meet_more(&self, words: &Words<'_>, word: WordId, bulge: f64) -> bool {
        let scene = words.scene();
        self.may_meet_any(scene, words.tracer(), bulge, |met| {
            scene.shape(met.0).material.is_specular()
                && !self.known.contains(&met)
                && !words.has_met(word, met)
        })
    }

    fn may_meet_any(
        &self,
        scene: &Scene,
        tracer: &Tracer<'_>,
        bulge: f64,
        wanted: impl Fn(Piece) -> bool,
    ) -> bool {
        let start = Aabb::around(self.starts.iter().copied());
        let start = start.grown(start.diagonal());
        let shaft = Shaft::between(&self.starts, &self.ends).widened(bulge);
        let axes = OnceCell::new();
        let bounds = Aabb::around(self.starts.iter().chain(&self.ends).copied()).grown(bulge);
        // A surface of formulas has thousands of primitives, of which this says the same.
        let wanted = |met: Piece| {
            wanted(met)
                && !matches!(&scene.shape(met.0).surface,
                    Surface::Parametric(p) if met == self.from && self.leaves_for_good(p))
        };
        let mut last = None;
        tracer.any_in(
            &bounds,
            |b| !shaft.keeps_out(b),
            |shape, primitive| {
                let met = (shape, facet(&scene.shape(shape).surface, primitive));
                match last {
                    Some((piece, answer)) if piece == met => answer,
                    _ => last.insert((met, wanted(met))).1,
                }
            },
            |shape, primitive| {
                let surface = &scene.shape(shape).surface;
                let met = (shape, facet(surface, primitive));
                // A curved surface may be met again where it turns towards itself, away from the start.
                let is_away =
                    |b: &Aabb| (met != self.from || !b.overlaps(&start)) && !shaft.keeps_out(b);
                let excluded = || shaft.excludes(&Body::of(scene, shape, primitive).0);
                match surface {
                    Surface::Parametric(p) => {
                        let b = p.leaf_bounds(primitive as usize);
                        is_away(&b) && !separated(axes.get_or_init(|| shaft.box_axes()), &b)
                    }
                    Surface::Mesh(m) if met.1.is_none() => {
                        is_away(&m.triangle_bounds(primitive)) && !excluded()
                    }
                    _ => met != self.from && !excluded(),
                }
            },
        )
    }
}

/// How far beyond a hit a surface is grazed by rays of nearly the same direction [m]; zero where it does not curve
/// away.
fn depth_of_limb(local: &LocalGeometry, d: &Vector3) -> f64 {
    let n = if local.ng.dot(d) > 0.0 { -local.ng.into_inner() } else { local.ng.into_inner() };
    let along = d - n * n.dot(d);
    let Some(along) = along.try_normalize(0.0) else { return 0.0 };
    let turned = (local.dn_dx * along).dot(&along) * n.dot(&local.n);
    if turned > 0.0 { n.dot(d).abs() / turned } else { 0.0 }
}

impl Beam {
    /// Whether no leg between those at the corners can meet the surface again that they all leave: proved for
    /// legs in the cone of their directions.
    fn leaves_for_good(&self, surface: &Parametric) -> bool {
        let side = |(o, e): (&Point3, &Point3)| surface.single_crossing(&(e - o));
        let mut sides = self.starts.iter().zip(&self.ends).map(side);
        let first = sides.next().unwrap_or(0);
        first != 0 && sides.all(|side| side == first)
    }
}
