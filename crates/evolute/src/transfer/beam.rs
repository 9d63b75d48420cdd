//! What may stand in a beam: the legs of all chains of a cell, between two surfaces.
//!
//! Five free rays do not prove a cell free: a bar narrower than the cell may stand between them. For
//! each leg the hull of the chains at the cell's corners is held against all that reaches into its
//! box; what a separating plane does not keep out may hide a part.
//!
//! Limit: chains inside the cell may leave the hull of those at its corners by a curved mirror's bend
//! in the cell, which falls with the square of its size. A surface is not held against the legs that
//! end on it: that it hides itself is left to samples.

use std::cell::OnceCell;

use arrayvec::ArrayVec;

use super::grid::GridPoint;
use super::lamp::Lamp;
use super::shaft::{Body, MAX_CORNERS, Shaft};
use super::word::{WordId, Words};
use crate::geometry::{Aabb, Point3};
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Most primitives in a leg's box for the first cells to be held against each: chains of large cells leave the
/// hull of those at the corners most.
const CROWD: usize = 64;
/// Divisions down to which a cell with more than that in its box counts as doubtful.
const MANY: u32 = 2;

/// Whether something may hide a part of a lamp from the chains of a word at and between four grid
/// points, in order around a cell that many divisions below the first grid, other than what is `known` to.
pub fn may_hide(
    words: &mut Words<'_>,
    word: WordId,
    lamp: &Lamp,
    corners: [GridPoint; 4],
    divisions: u32,
    known: &[ShapeId],
) -> bool {
    let mut chain = vec![word];
    while let Some(before) = chain.last().and_then(|w| words.parent(*w)) {
        chain.push(before);
    }
    let mut leg = Leg { starts: ArrayVec::new(), from: None, divisions, known };
    leg.starts.push(words.receiver().position);
    for id in chain.into_iter().rev() {
        let mut points = ArrayVec::new();
        let mut shape = None;
        for at in corners {
            let Some(departure) = words.departure(id, at) else { return false };
            points.push(departure.anchor.point.x);
            shape = Some(departure.anchor.shape);
        }
        if leg.is_suspicious(words, &points, shape) {
            return true;
        }
        leg = Leg { starts: points, from: shape, divisions, known };
    }
    let bounds = words.scene().shape(lamp.shape).surface.bounds();
    let mut ends = ArrayVec::new();
    for at in corners {
        let Some(departure) = words.departure(word, at) else { return false };
        let along = lamp.passes_at(&departure.ray);
        let x = along
            .map_or(bounds.centre(), |t| Point3::from(departure.ray.o.v + departure.ray.d.v * t));
        // Of chains that miss the lamp, only what lies towards it counts.
        ends.push(Point3::from(x.coords.sup(&bounds.min.coords).inf(&bounds.max.coords)));
    }
    leg.is_suspicious(words, &ends, Some(lamp.shape))
}

/// Where the leg of a cell's chains starts.
struct Leg<'k> {
    /// One point, or one for each corner of the cell [m].
    starts: ArrayVec<Point3, 4>,
    from: Option<ShapeId>,
    divisions: u32,
    /// What is known to stand in it.
    known: &'k [ShapeId],
}

impl Leg<'_> {
    /// Whether something may stand between the starts and the ends, on `to`.
    fn is_suspicious(
        &self,
        words: &Words<'_>,
        ends: &ArrayVec<Point3, 4>,
        to: Option<ShapeId>,
    ) -> bool {
        let bounds = Aabb::around(self.starts.iter().chain(ends).copied());
        if self.divisions < MANY && is_crowded(words, &bounds) {
            return true;
        }
        let shaft = OnceCell::new();
        let shaft = || {
            shaft.get_or_init(|| match self.starts.as_slice() {
                [apex] => Shaft::new(apex, ends),
                starts => Shaft::between(starts, ends),
            })
        };
        words.tracer().any_in(
            &bounds,
            |b| !shaft().keeps_out(b),
            |shape, _| !self.known.contains(&shape) && !self.is_end(words, shape, to),
            |shape, primitive| {
                let (body, counts) = Body::of(words.scene(), shape, primitive);
                self.divisions < counts && !shaft().excludes(&body)
            },
        )
    }

    /// Whether the leg starts or ends on a shape, or in its plane.
    fn is_end(&self, words: &Words<'_>, shape: ShapeId, to: Option<ShapeId>) -> bool {
        let flat = || {
            let surface = &words.scene().shape(shape).surface;
            matches!(surface, Surface::Rectangle(_) | Surface::Disk(_))
        };
        Some(shape) == self.from
            || Some(shape) == to
            || (self.from.is_none() && words.touches(shape) && flat())
    }
}

const _: () = assert!(MAX_CORNERS >= 8);

/// Whether many primitives reach into a box.
fn is_crowded(words: &Words<'_>, bounds: &Aabb) -> bool {
    let mut count = 0;
    words.tracer().any_in(
        bounds,
        |_| true,
        |_, _| true,
        |_, _| {
            count += 1;
            count > CROWD
        },
    )
}
