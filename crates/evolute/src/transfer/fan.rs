//! Where chains leave a mirror that reflects them again and again.
//!
//! Along a concave mirror orders of reflection go on without end, each from a narrower part of the domain. What
//! all of them can bring is bounded by the brightest lamp over that part, and falls slowly. But they leave
//! the mirror in a narrow fan, most often one that holds no lamp: a few of them are followed to where they do.
//!
//! Limit: a fan is known from samples; what it is held to hold is wider than they are by half their spread.

use arrayvec::ArrayVec;

use super::chain::{Departure, events};
use super::settings::LONGEST_CHAIN;
use super::word::{WordId, Words};
use crate::geometry::{Aabb, Point3, Ray, Vector3};
use crate::surface::Surface;
use crate::trace::Anchor;

/// Most chains that are followed.
const MOST_CHAINS: usize = 16;
/// Chains of a fan that says something.
const LEAST_CHAINS: usize = 4;
/// Part of the samples' spread by which a fan may be wider than they are.
const MARGIN: f64 = 0.5;

/// The last legs of a few chains.
pub struct Fan(ArrayVec<(Point3, Vector3), MOST_CHAINS>);

impl Fan {
    /// The fan of a word's chains that go on by its last letter as long as they meet it, if that is a mirror;
    /// `None` if too few are known, or one of them does not come to an end.
    pub fn of(words: &mut Words<'_>, word: WordId) -> Option<Self> {
        let letter = words.letter(word);
        if events(&words.scene().shape(letter.shape).material, letter.front).len() != 1 {
            return None;
        }
        let mut fan = ArrayVec::new();
        for at in words.met_at(word, MOST_CHAINS) {
            let Some(departure) = words.departure(word, at).filter(|d| d.is_legal()) else {
                continue;
            };
            let start = departure.clone();
            fan.push(leave(words, &start)?);
        }
        (fan.len() >= LEAST_CHAINS).then_some(Self(fan))
    }

    /// Whether something in a box may be met.
    pub fn may_meet(&self, bounds: &Aabb) -> bool {
        let (centre, radius) = (bounds.centre(), 0.5 * bounds.diagonal());
        let gaps: ArrayVec<Vector3, MOST_CHAINS> = self
            .0
            .iter()
            .map(|(o, d)| {
                let to = centre - o;
                to - d * to.dot(d).max(0.0)
            })
            .collect();
        // A direction in which all legs pass on one side.
        let mean = gaps.iter().sum::<Vector3>();
        let parts = |axis: &Vector3| {
            let axis = axis.try_normalize(0.0)?;
            let along = gaps.iter().map(|g| g.dot(&axis));
            let (low, high) =
                along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), g| (l.min(g), h.max(g)));
            Some(low - MARGIN * (high - low) > radius)
        };
        !gaps.iter().chain([&mean]).any(|axis| parts(axis) == Some(true))
    }
}

/// The last leg of a chain that is reflected by one mirror as long as it meets it.
fn leave(words: &mut Words<'_>, start: &Departure) -> Option<(Point3, Vector3)> {
    let scene = words.scene();
    let shape = start.anchor.shape;
    let surface: &Surface = &scene.shape(shape).surface;
    let mut ray = Ray::new(start.anchor.point.x, start.ray.d.v);
    let mut next = start.next;
    for _ in 0..LONGEST_CHAIN {
        let Some(hit) = next.filter(|hit| hit.anchor.shape == shape) else {
            return Some((ray.origin, ray.direction));
        };
        let Anchor { point, .. } = hit.anchor;
        let n = surface.local(&point)?.n.into_inner();
        let d = ray.direction - n * (2.0 * ray.direction.dot(&n));
        ray = Ray::new(point.x, d);
        words.counts.rays += 1;
        next = words.tracer().nearest(&ray, f64::INFINITY, &[hit.anchor]);
    }
    None
}
