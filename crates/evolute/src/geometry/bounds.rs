//! Axis-aligned boxes.

use super::{Point3, Vector3};

/// An axis-aligned box [m]; empty when `min > max` on an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Least corner.
    pub min: Point3,
    /// Greatest corner.
    pub max: Point3,
}

impl Aabb {
    /// The box that contains nothing.
    pub const EMPTY: Self = Self {
        min: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        max: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    /// The least box around points.
    pub fn around(points: impl IntoIterator<Item = Point3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| b.including(p))
    }

    /// The least box around this one and a point.
    pub fn including(&self, p: Point3) -> Self {
        Self { min: self.min.inf(&p), max: self.max.sup(&p) }
    }

    /// The least box around two.
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.inf(&other.min), max: self.max.sup(&other.max) }
    }

    /// The box grown by `margin` [m] on every side.
    pub fn grown(&self, margin: f64) -> Self {
        let m = Vector3::repeat(margin);
        Self { min: self.min - m, max: self.max + m }
    }

    /// Whether the point is inside or on the border.
    pub fn contains(&self, p: &Point3) -> bool {
        (0..3).all(|i| self.min[i] <= p[i] && p[i] <= self.max[i])
    }

    /// Whether the boxes have a point in common.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|i| self.min[i] <= other.max[i] && other.min[i] <= self.max[i])
    }

    /// Whether nothing is inside.
    pub fn is_empty(&self) -> bool {
        (0..3).any(|i| self.min[i] > self.max[i])
    }

    /// The middle [m].
    pub fn centre(&self) -> Point3 {
        nalgebra::center(&self.min, &self.max)
    }

    /// Edge lengths [m].
    pub fn extent(&self) -> Vector3 {
        self.max - self.min
    }

    /// Length of the diagonal [m].
    pub fn diagonal(&self) -> f64 {
        self.extent().norm()
    }

    /// The eight corners [m].
    pub fn corners(&self) -> [Point3; 8] {
        std::array::from_fn(|i| {
            Point3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }
}
