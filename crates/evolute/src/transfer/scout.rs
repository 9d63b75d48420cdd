//! What chains may meet between the points of a first grid.
//!
//! A word's next letters are learnt from what its chains meet. A body in the beam of a cell that no
//! corner's chain meets would be missed: cells of which a proof does not keep such bodies out are
//! divided a few times, and chains traced there.
//!
//! Limit: a body that is still smaller than a cell after these divisions may be missed.

use arrayvec::ArrayVec;

use super::grid::GridPoint;
use super::landing::Square;
use super::shaft::{Body, Shaft};
use super::word::{WordId, Words};
use crate::geometry::{Aabb, Point3};
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Divisions of the first grid's cells.
const SCOUTED_LEVELS: u32 = 3;
/// Most primitives that are looked at one by one in a beam's box; beyond, the grid decides.
const MAX_SUSPECTS: usize = 10_000;

/// Traces chains of a word in the cells of its first grid through which a specular surface may be met
/// that none of their corners' chains meets.
pub fn scout(words: &mut Words<'_>, word: WordId, first: u32) {
    let n = 1u32 << first;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        scout_cell(words, word, Square::nth(first, i, j), first + SCOUTED_LEVELS);
    }
}

fn scout_cell(words: &mut Words<'_>, word: WordId, cell: Square, last: u32) {
    if !may_meet_more(words, word, cell) || cell.level == last {
        return;
    }
    for child in cell.children() {
        scout_cell(words, word, child, last);
    }
}

/// Whether the last legs of a cell's chains may meet a specular surface that those at its corners do not
/// meet.
fn may_meet_more(words: &mut Words<'_>, word: WordId, cell: Square) -> bool {
    let parent = words.parent(word);
    let reach = words.tracer().bounds().diagonal();
    let (mut starts, mut ends) = (ArrayVec::<Point3, 4>::new(), ArrayVec::<Point3, 4>::new());
    let mut known: ArrayVec<ShapeId, 4> = ArrayVec::new();
    let mut from = None;
    for at in around(cell) {
        // Where the word before is not, this one is not either.
        if !parent.is_none_or(|parent| words.is_legal(parent, at)) {
            continue;
        }
        let Some(departure) = words.departure(word, at).filter(|d| d.is_legal()) else { continue };
        let (o, d) = (departure.anchor.point.x, departure.ray.d.v);
        starts.push(o);
        ends.push(departure.next.map_or(o + d * reach, |hit| hit.anchor.point.x));
        known.extend(departure.next.map(|hit| hit.anchor.shape));
        from = Some(departure.anchor.shape);
    }
    if starts.is_empty() {
        return false;
    }
    let scene = words.scene();
    let start = Aabb::around(starts.iter().copied());
    let start = start.grown(start.diagonal());
    let shaft = Shaft::between(&starts, &ends);
    let bounds = Aabb::around(starts.iter().chain(&ends).copied());
    let mut asked = 0;
    words.tracer().any_in(&bounds, |shape, primitive| {
        // A surface may be met again where it turns towards itself, away from the start.
        let again = || match &scene.shape(shape).surface {
            Surface::Parametric(p) => !p.leaf_bounds(primitive as usize).overlaps(&start),
            Surface::Mesh(m) => !m.triangle_bounds(primitive).overlaps(&start),
            _ => false,
        };
        asked += 1;
        asked <= MAX_SUSPECTS
            && scene.shape(shape).material.is_specular()
            && !known.contains(&shape)
            && (from != Some(shape) || again())
            && !shaft.excludes(&Body::of(scene, shape, primitive).0)
    })
}

/// The corners of a cell, in order around it.
fn around(cell: Square) -> [GridPoint; 4] {
    let (GridPoint { i, j }, side) = (cell.corner(), cell.side());
    [(0, 0), (side, 0), (side, side), (0, side)].map(|(di, dj)| GridPoint { i: i + di, j: j + dj })
}
