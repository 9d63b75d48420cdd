//! The affine frame that rectangles and disks share: a plane with two spanning vectors.

use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{Aabb, Matrix3, Point3, Ray, Transform, UnitVector3, Vector3};

/// A point `x = centre + p·dp + q·dq` of a plane, with the two covectors that read (p, q) off it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaneFrame {
    pub world_from_object: Transform,
    pub centre: Point3,
    /// ∂x/∂p, ∂x/∂q [m].
    pub dp: Vector3,
    pub dq: Vector3,
    /// p = p_of · (x − centre), q likewise [1/m]. Both are orthogonal to the normal.
    pub p_of: Vector3,
    pub q_of: Vector3,
    /// The front's unit normal.
    pub normal: UnitVector3,
}

/// Where a line meets a plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PlaneCrossing {
    pub t: f64,
    pub p: f64,
    pub q: f64,
    /// Bound on the rounding error of `p` and `q`.
    pub slack_p: f64,
    pub slack_q: f64,
}

impl PlaneFrame {
    /// The object's plane z = 0 in world space. The normal is the image of +z under the inverse
    /// transpose (as in Mitsuba 3: it does not turn round when the transform mirrors x or y), and the
    /// other way with `flip`.
    pub fn new(
        shape: &'static str,
        world_from_object: Transform,
        flip: bool,
    ) -> Result<Self, SurfaceError> {
        let dp = world_from_object.vector(&Vector3::x());
        let dq = world_from_object.vector(&Vector3::y());
        let across = dp.cross(&dq);
        let side = world_from_object.normal(&Vector3::z()).dot(&across);
        let squared = across.norm_squared();
        let normal = UnitVector3::try_new(across, 0.0)
            .filter(|n| n.iter().all(|c| c.is_finite()) && squared > 0.0 && squared.is_finite())
            .ok_or(SurfaceError::NoArea { shape })?;
        Ok(Self {
            world_from_object,
            centre: world_from_object.point(&Point3::origin()),
            dp,
            dq,
            p_of: dq.cross(&across) / squared,
            q_of: across.cross(&dp) / squared,
            normal: if (side < 0.0) != flip { -normal } else { normal },
        })
    }

    /// The point of given coordinates.
    pub fn at(&self, p: f64, q: f64) -> SurfacePoint {
        SurfacePoint { primitive: 0, p, q, x: self.centre + self.dp * p + self.dq * q }
    }

    /// Coordinates of the foot of the perpendicular from `x`, and its height over the plane [m].
    pub fn coordinates(&self, x: &Point3) -> (f64, f64, f64) {
        let r = x - self.centre;
        (self.p_of.dot(&r), self.q_of.dot(&r), self.normal.dot(&r))
    }

    /// Area of the unit square of (p, q) [m²].
    pub fn area(&self) -> f64 {
        self.dp.cross(&self.dq).norm()
    }

    pub fn local(&self, x: Point3) -> LocalGeometry {
        LocalGeometry { x, n: self.normal, ng: self.normal, dn_dx: Matrix3::zeros() }
    }

    /// Jet of a map (u, v) → (p, q) given as value and derivatives, each a pair.
    pub fn jet(&self, value: [f64; 2], d: [[f64; 2]; 5]) -> Jet {
        let vector = |c: [f64; 2]| self.dp * c[0] + self.dq * c[1];
        let [u, v, uu, uv, vv] = d.map(vector);
        Jet { x: self.at(value[0], value[1]).x, xu: u, xv: v, xuu: uu, xuv: uv, xvv: vv }
    }

    /// Where the ray's line crosses the plane; `None` when it is parallel, or when the start lies on
    /// the plane as far as rounding can tell (such a ray does not meet the plane again).
    pub fn crossing(&self, ray: &Ray) -> Option<PlaneCrossing> {
        let n = &self.normal;
        let to = self.centre - ray.origin;
        let slope = n.dot(&ray.direction);
        let height = n.dot(&to);
        // The rounding of `to` (half an ulp of each coordinate) and of the dot product (three
        // products, two sums): below 4ε(|n|·(|centre| + |origin|)).
        let doubt = 4.0
            * f64::EPSILON
            * (0..3)
                .map(|i| n[i].abs() * (self.centre[i].abs() + ray.origin[i].abs()))
                .sum::<f64>();
        if slope == 0.0 || height.abs() <= doubt {
            return None;
        }
        let t = height / slope;
        let r = ray.direction * t - to;
        // A few roundings of vectors of this size stand between the ray and (p, q).
        let size = 8.0 * f64::EPSILON * (to.norm() + r.norm() + ray.origin.coords.amax());
        Some(PlaneCrossing {
            t,
            p: self.p_of.dot(&r),
            q: self.q_of.dot(&r),
            slack_p: size * self.p_of.norm(),
            slack_q: size * self.q_of.norm(),
        })
        .filter(|c| c.t.is_finite())
    }
}

/// The box grown by what rounding may have taken from it: sixteen units in the last place of its
/// largest coordinate, more than any of our closed forms loses.
pub(super) fn grown_for_rounding(b: Aabb) -> Aabb {
    let size = b.min.coords.amax().max(b.max.coords.amax());
    b.grown(16.0 * f64::EPSILON * size)
}

/// How far [m] a point may be off a surface and still be called on it: 64 units in the last place of
/// the largest coordinate involved. A point that was computed in double precision by a dozen
/// operations (a transform, a sine, a square root) is closer than that; a point that was rounded to
/// single precision is not, unless its coordinates are exact there.
pub fn contact_tolerance(x: &Point3, bounds: &Aabb) -> f64 {
    let size = x.coords.amax().max(bounds.min.coords.amax()).max(bounds.max.coords.amax());
    64.0 * f64::EPSILON * size
}
