//! The criteria of the paper's section 3.3 that say whether a cell is to be divided.
//!
//! Criteria 1 to 3 look at the samples of a cell and force a division; criterion 4 is the error that
//! the queue works down.

use serde::{Deserialize, Serialize};

use super::field::{FieldSample, Sight};
use crate::geometry::{Vector3, math};

/// Share of criterion 1's solid angle that a cell may span in which no chain exists at the corners.
const UNSEEN_SHARE: f64 = 0.25;

/// Criterion 1: the solid angle that a cell spans at the receiver is small enough.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolidAngle {
    /// Largest allowed [sr].
    pub largest: f64,
}

/// Criterion 2: the normal does not vary too much over a cell; nor, since a chain may meet other
/// surfaces after the first, does the direction of its last leg.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct NormalVariation {
    /// Least allowed cosine between two corners' normals.
    pub least_cosine: f64,
    /// Least allowed cosine between two corners' last legs.
    pub least_direction_cosine: f64,
    /// Widest allowed cone of normals, proved by intervals, half its opening [rad].
    pub widest_cone: f64,
    /// How much wider the cone may be than the corners' normals show, as a factor: intervals are up to
    /// twice too wide.
    pub seen_ratio: f64,
    /// The same beyond that factor [rad].
    pub seen_cone: f64,
}

/// Criterion 3: the ray trees of neighbouring samples hit the same or adjacent surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MatchingTrees {
    /// Divisions that a mismatch may force beyond the first grid.
    pub divisions: u32,
}

/// Criterion 4: the quadrature over all cells reaches the accuracy asked for.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuadratureAccuracy;

/// The criteria in force; `None` switches one off.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Criteria {
    /// Criterion 1.
    pub solid_angle: Option<SolidAngle>,
    /// Criterion 2.
    pub normal_variation: Option<NormalVariation>,
    /// Criterion 3.
    pub matching_trees: Option<MatchingTrees>,
    /// Criterion 4.
    pub quadrature: Option<QuadratureAccuracy>,
}

impl Default for Criteria {
    fn default() -> Self {
        Self {
            // A tenth of the hemisphere: cosine and distance vary by a small factor inside.
            solid_angle: Some(SolidAngle { largest: 0.6 }),
            // 35 degrees: the reflected direction turns by 70, beyond which four corners say little.
            normal_variation: Some(NormalVariation {
                least_cosine: 0.82,
                least_direction_cosine: 0.3,
                // Intervals are up to twice too wide: a cell of a wave whose corners say all there is
                // to say should pass, one with a bump between its corners should not.
                widest_cone: 0.87,
                // A corrugation may show equal normals at all corners.
                seen_ratio: 2.5,
                seen_cone: 0.1,
            }),
            // One more look where something is seen at one corner and not at the next.
            matching_trees: Some(MatchingTrees { divisions: 2 }),
            quadrature: Some(QuadratureAccuracy),
        }
    }
}

impl SolidAngle {
    /// The solid angle that a cell spans [sr], of two spherical triangles between the directions of its
    /// corners (Van Oosterom & Strackee 1983); zero if a corner has none. A density at the corners would
    /// miss a receiver that nearly touches the middle.
    pub fn spanned(corners: &[Option<Vector3>; 4]) -> f64 {
        let [Some(p), Some(q), Some(r), Some(s)] = corners else { return 0.0 };
        let triangle = |a: &Vector3, b: &Vector3, c: &Vector3| {
            let volume = a.dot(&b.cross(c)).abs();
            2.0 * math::atan2(volume, 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
        };
        triangle(p, q, s) + triangle(p, s, r)
    }

    /// Whether a cell whose corners lie in these directions is too large; one in which no chain exists at
    /// the corners is held to less, since all light may come through a cone inside it, as from under water.
    pub fn divides(&self, corners: &[Option<Vector3>; 4], exists: bool) -> bool {
        let largest = if exists { self.largest } else { UNSEEN_SHARE * self.largest };
        Self::spanned(corners) > largest
    }
}

impl NormalVariation {
    /// Whether the normals of a cell, of which a cone of half the opening `cone` [rad] is proved to hold
    /// all, or the directions of its corners' last legs differ too much.
    pub fn divides(&self, corners: &[Option<&FieldSample>; 4], cone: f64) -> bool {
        let differ = |i: usize, j: usize| match (corners[i], corners[j]) {
            (Some(p), Some(q)) => {
                p.normal.dot(&q.normal) < self.least_cosine
                    || p.direction.dot(&q.direction) < self.least_direction_cosine
            }
            _ => false,
        };
        cone > self.widest_cone
            || (0..4).any(|i| (0..i).any(|j| differ(i, j)))
            || self.hides(corners, cone)
    }

    /// Whether normals, of which a cone of half the opening `cone` [rad] is proved to hold all, may differ
    /// more between the corners than at them.
    pub fn hides(&self, corners: &[Option<&FieldSample>; 4], cone: f64) -> bool {
        let mut least = 1f64;
        for (i, p) in corners.iter().enumerate() {
            for (p, q) in p.iter().flat_map(|p| corners[..i].iter().flatten().map(move |q| (p, q)))
            {
                least = least.min(p.normal.dot(&q.normal));
            }
        }
        cone > self.seen_cone + 0.5 * self.seen_ratio * math::acos(least)
    }
}

impl MatchingTrees {
    /// Whether the corners' trees differ, at a cell that many divisions below the first grid.
    pub fn divides(&self, corners: &[Option<&FieldSample>; 4], divisions: u32) -> bool {
        if divisions >= self.divisions {
            return false;
        }
        let sees = |c: &Option<&FieldSample>| c.is_some_and(|s| s.sight != Sight::Off);
        let first = sees(&corners[0]);
        corners.iter().any(|c| sees(c) != first)
    }
}
