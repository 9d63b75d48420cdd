//! Open circular cylinders.

use super::error::{finite, positive};
use super::plane::{contact_tolerance, grown_for_rounding};
use super::sphere::{SIMILARITY, quadratic_roots};
use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{
    Aabb, Matrix3, Point3, Ray, Transform, UnitVector3, Vector3, math, tangent_frame,
};
use std::f64::consts::TAU;

/// An open circular cylinder between two points of its axis. Texture coordinates are (angle / 2π,
/// height from `p0` to `p1`), the angle counted in the frame of the object's axis as in Mitsuba 3.
/// Its front is the outside, also under a transform that mirrors (again as in Mitsuba 3), and the
/// inside with `flip_normals`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cylinder {
    p0: Point3,
    p1: Point3,
    /// Unit vector from p0 to p1, and the length between them [m].
    axis: Vector3,
    length: f64,
    radius: f64,
    /// Unit vectors across the axis: where the angle is 0 and a quarter turn.
    across: [Vector3; 2],
    /// +1: the front is outside; −1: inside.
    side: f64,
    world_from_object: Transform,
}

impl Cylinder {
    /// The cylinder about the segment `p0` to `p1` [m, object frame] with `radius` [m, object frame]
    /// under `world_from_object`; `flip_normals` turns its front round.
    ///
    /// # Errors
    /// When radius or points are not finite, the radius or the length is not positive, or the
    /// transform does not leave the cylinder circular and right (stretching along the axis does).
    pub fn new(
        p0: Point3,
        p1: Point3,
        radius: f64,
        world_from_object: Transform,
        flip_normals: bool,
    ) -> Result<Self, SurfaceError> {
        let radius = positive("the radius", radius)?;
        let (p0, p1) = (finite("p0", p0)?, finite("p1", p1)?);
        let length = positive("the distance between p0 and p1", (p1 - p0).norm())?;
        let axis = UnitVector3::new_unchecked((p1 - p0) / length);
        let (s, t) = tangent_frame(&axis);
        let [s, t, a] = [s, t, axis.into_inner()].map(|v| world_from_object.vector(&v));
        let distorted =
            SurfaceError::Distorted { shape: "cylinder", how: "evenly, or along its axis" };
        let scale = (0.5 * (s.norm_squared() + t.norm_squared())).sqrt();
        let oblique = |v: &Vector3, w: &Vector3| v.dot(w).abs() > SIMILARITY * v.norm() * w.norm();
        if !(scale.is_finite() && scale > 0.0)
            || (s.norm() - t.norm()).abs() > SIMILARITY * scale
            || oblique(&s, &t)
            || oblique(&s, &a)
            || oblique(&t, &a)
        {
            return Err(distorted);
        }
        let (q0, q1) = (world_from_object.point(&p0), world_from_object.point(&p1));
        let length = positive("the distance between p0 and p1", (q1 - q0).norm())?;
        let axis = (q1 - q0) / length;
        let first = (s - axis * axis.dot(&s)).try_normalize(0.0).ok_or(distorted)?;
        let second = axis.cross(&first);
        let mirrored = second.dot(&t) < 0.0;
        Ok(Self {
            p0: finite("p0", q0)?,
            p1: finite("p1", q1)?,
            axis,
            length,
            radius: positive("the radius", radius * scale)?,
            across: [first, if mirrored { -second } else { second }],
            side: if flip_normals { -1.0 } else { 1.0 },
            world_from_object,
        })
    }

    /// Both ends of the axis [m].
    pub fn ends(&self) -> [Point3; 2] {
        [self.p0, self.p1]
    }

    /// Unit vector along the axis, from the first end to the second.
    pub fn axis(&self) -> UnitVector3 {
        UnitVector3::new_unchecked(self.axis)
    }

    /// Unit vectors across the axis, at angle 0 and a quarter turn; with the axis right-handed, or
    /// left-handed if the transform mirrors.
    pub fn across(&self) -> [Vector3; 2] {
        self.across
    }

    /// Length along the axis [m].
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Radius [m].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// Whether the front is the outside.
    pub fn faces_outward(&self) -> bool {
        self.side > 0.0
    }

    /// The transform it was made with.
    pub fn world_from_object(&self) -> &Transform {
        &self.world_from_object
    }

    /// Height in [0, 1] at its ends, and the displacement from the axis [m].
    fn coordinates(&self, x: &Point3) -> (f64, Vector3) {
        let r = x - self.p0;
        let along = self.axis.dot(&r);
        (along / self.length, r - self.axis * along)
    }

    /// The point at a height in the unit direction `d` from the axis.
    fn at(&self, height: f64, d: &Vector3) -> SurfacePoint {
        let x = self.p0 + self.axis * (height * self.length) + d * self.radius;
        SurfacePoint { primitive: 0, p: 0.0, q: height, x }
    }

    /// `x` moved to the infinite cylinder along its radius; `None` on the axis. The height `q` of the
    /// point may be outside [0, 1].
    pub fn projected(&self, x: &Point3) -> Option<SurfacePoint> {
        let (height, across) = self.coordinates(x);
        across.try_normalize(0.0).map(|d| self.at(height, &d))
    }

    /// The point of texture coordinates in [0, 1]², else `None`.
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        super::in_unit_square(u, v).then(|| self.at_turn(u, v))
    }

    /// The point at an angle, in turns, and a height.
    pub(super) fn at_turn(&self, turn: f64, height: f64) -> SurfacePoint {
        let (s, c) = math::sin_cos(TAU * turn);
        self.at(height, &(self.across[0] * c + self.across[1] * s))
    }

    /// Derivatives by texture coordinates.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        super::in_unit_square(u, v).then(|| {
            let (s, c) = math::sin_cos(TAU * u);
            let d = self.across[0] * c + self.across[1] * s;
            Jet {
                x: self.at(v, &d).x,
                xu: (self.across[1] * c - self.across[0] * s) * (TAU * self.radius),
                xv: self.axis * self.length,
                xuu: d * (-TAU * TAU * self.radius),
                xuv: Vector3::zeros(),
                xvv: Vector3::zeros(),
            }
        })
    }

    /// Texture coordinates.
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        let r = point.x - self.p0;
        [super::turn(self.across[1].dot(&r), self.across[0].dot(&r)), point.q]
    }

    /// Geometry at a point; `None` if the point is on the axis.
    pub fn local(&self, point: &SurfacePoint) -> Option<LocalGeometry> {
        let outward = UnitVector3::try_new(self.coordinates(&point.x).1, 0.0)?;
        let round = self.axis.cross(&outward);
        let n = if self.side > 0.0 { outward } else { -outward };
        let dn_dx: Matrix3 = round * round.transpose() * (self.side / self.radius);
        Some(LocalGeometry { x: point.x, n, ng: n, dn_dx })
    }

    /// The surface point at `x`, if `x` lies on the cylinder to within [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        let (height, across) = self.coordinates(x);
        let point = self.at(height.clamp(0.0, 1.0), &across.try_normalize(0.0)?);
        ((point.x - x).norm() <= contact_tolerance(x, &self.bounds())).then_some(point)
    }

    /// The least box around it (grown by its rounding error): circles of half extent
    /// r·√(1 − a_i²) about both ends.
    pub fn bounds(&self) -> Aabb {
        let a = self.axis;
        let half = Vector3::new(
            (a.y * a.y + a.z * a.z).sqrt(),
            (a.z * a.z + a.x * a.x).sqrt(),
            (a.x * a.x + a.y * a.y).sqrt(),
        ) * self.radius;
        let ends = Aabb::around([self.p0, self.p1]);
        grown_for_rounding(Aabb { min: ends.min - half, max: ends.max + half })
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        TAU * self.radius * self.length
    }

    /// Least distance from `x` [m].
    pub fn distance(&self, x: &Point3) -> f64 {
        let (height, across) = self.coordinates(x);
        let along = (height - height.clamp(0.0, 1.0)) * self.length;
        let radial = across.norm() - self.radius;
        (along * along + radial * radial).sqrt()
    }

    /// Both ray parameters at which the ray's line meets the cylinder extended to infinity, in
    /// increasing order; `None` if it misses or runs along the axis. A root that rounding cannot tell
    /// from the ray's start is reported as 0.
    pub fn roots(&self, ray: &Ray) -> Option<[f64; 2]> {
        let (_, f) = self.coordinates(&ray.origin);
        let d = self.across_part(&ray.direction);
        quadratic_roots(&f, &d, self.radius, || {
            self.p0.coords.amax() + ray.origin.coords.amax() + self.length
        })
    }

    fn across_part(&self, v: &Vector3) -> Vector3 {
        v - self.axis * self.axis.dot(v)
    }

    /// The other root, as a ray parameter, of a line that passes through the point `x` of the
    /// (infinite) cylinder at t = 0; zero when it is tangent, `None` when it runs along the axis.
    pub fn other_root(&self, x: &Point3, direction: &Vector3) -> Option<f64> {
        let (_, f) = self.coordinates(x);
        let d = self.across_part(direction);
        let t = -2.0 * f.dot(&d) / d.norm_squared();
        t.is_finite().then_some(t)
    }

    /// The surface point next to `x`, a point of the infinite cylinder that was computed along a ray
    /// from `origin`; `None` if it is beyond an end by more than rounding can account for (so that a
    /// cylinder that stands on a floor does not leak).
    pub fn between_ends(&self, x: &Point3, origin: &Point3) -> Option<SurfacePoint> {
        let point = self.projected(x)?;
        let size = x.coords.amax() + origin.coords.amax() + self.p0.coords.amax() + self.length;
        let slack = 8.0 * f64::EPSILON * size / self.length;
        if point.q < -slack || point.q > 1.0 + slack {
            return None;
        }
        if (0.0..=1.0).contains(&point.q) {
            return Some(point);
        }
        let (_, across) = self.coordinates(x);
        across.try_normalize(0.0).map(|d| self.at(point.q.clamp(0.0, 1.0), &d))
    }
}
