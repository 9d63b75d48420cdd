//! Disks (filled ellipses under uneven scale).

use super::plane::{PlaneFrame, contact_tolerance, grown_for_rounding};
use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{Aabb, Point3, Ray, Transform, UnitVector3, Vector3, math};
use std::f64::consts::{PI, TAU};

/// The unit disk of the object's plane z = 0, facing +z, under an affine map. Texture coordinates are
/// (radius, angle / 2π), as in Mitsuba 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disk {
    frame: PlaneFrame,
}

impl Disk {
    /// The disk under `world_from_object`; `flip_normals` turns its front round.
    ///
    /// # Errors
    /// When the transform leaves no area.
    pub fn new(world_from_object: Transform, flip_normals: bool) -> Result<Self, SurfaceError> {
        Ok(Self { frame: PlaneFrame::new("disk", world_from_object, flip_normals)? })
    }

    /// The transform it was made with.
    pub fn world_from_object(&self) -> &Transform {
        &self.frame.world_from_object
    }

    /// The middle [m].
    pub fn centre(&self) -> Point3 {
        self.frame.centre
    }

    /// Two conjugate radii: the images of the object's x and y [m].
    pub fn radii(&self) -> [Vector3; 2] {
        [self.frame.dp, self.frame.dq]
    }

    /// Unit normal of the front.
    pub fn normal(&self) -> UnitVector3 {
        self.frame.normal
    }

    /// The point of object coordinates x = p, y = q.
    pub(super) fn at(&self, p: f64, q: f64) -> SurfacePoint {
        self.frame.at(p, q)
    }

    /// The point of texture coordinates in [0, 1]², else `None`.
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        super::in_unit_square(u, v).then(|| {
            let (s, c) = math::sin_cos(TAU * v);
            self.frame.at(u * c, u * s)
        })
    }

    /// Derivatives by texture coordinates; singular at u = 0.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        super::in_unit_square(u, v).then(|| {
            let (s, c) = math::sin_cos(TAU * v);
            let d = [
                [c, s],
                [-TAU * u * s, TAU * u * c],
                [0.0; 2],
                [-TAU * s, TAU * c],
                [-TAU * TAU * u * c, -TAU * TAU * u * s],
            ];
            self.frame.jet([u * c, u * s], d)
        })
    }

    /// Texture coordinates.
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        let radius = (point.p * point.p + point.q * point.q).sqrt();
        [radius.min(1.0), super::turn(point.q, point.p)]
    }

    /// Geometry at a point.
    pub fn local(&self, point: &SurfacePoint) -> LocalGeometry {
        self.frame.local(point.x)
    }

    /// The surface point at `x`, if `x` lies on the disk to within [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        let tolerance = contact_tolerance(x, &self.bounds());
        let (p, q, _) = self.frame.coordinates(x);
        let point = self.inside(p, q);
        ((point.x - x).norm() <= tolerance).then_some(point)
    }

    /// The point, moved to the border along its radius if it is outside.
    fn inside(&self, p: f64, q: f64) -> SurfacePoint {
        let radius = (p * p + q * q).sqrt().max(1.0);
        self.frame.at(p / radius, q / radius)
    }

    /// The least box around it (grown by its rounding error): half extent √(dp_i² + dq_i²).
    pub fn bounds(&self) -> Aabb {
        let half = self.frame.dp.zip_map(&self.frame.dq, |a, b| (a * a + b * b).sqrt());
        let c = self.frame.centre;
        grown_for_rounding(Aabb { min: c - half, max: c + half })
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        PI * self.frame.area()
    }

    /// Least distance from `x` [m], to 1e-12 of the disk's size.
    pub fn distance(&self, x: &Point3) -> f64 {
        let (p, q, height) = self.frame.coordinates(x);
        if p * p + q * q <= 1.0 {
            return height.abs();
        }
        // Outside, the nearest point is on the border. The squared distance along it has one
        // minimum within a quarter turn of the direction of (p, q) for a point outside a convex
        // curve; samples find its basin for any eccentricity, golden section the place.
        let at = |angle: f64| {
            let (s, c) = math::sin_cos(angle);
            (self.frame.at(c, s).x - x).norm_squared()
        };
        const SAMPLES: usize = 64;
        let step = TAU / SAMPLES as f64;
        let best = (0..SAMPLES)
            .map(|i| (i as f64 * step, at(i as f64 * step)))
            .fold((0.0, f64::INFINITY), |a, b| if b.1 < a.1 { b } else { a });
        let (mut low, mut high) = (best.0 - step, best.0 + step);
        // 0.618⁶⁰ = 3e-13: beyond what a minimum's flatness can resolve in double precision.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        for _ in 0..60 {
            let (a, b) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
            if at(a) < at(b) { high = b } else { low = a }
        }
        at(0.5 * (low + high)).min(best.1).sqrt()
    }

    /// Where the ray's line meets the disk: ray parameter (of either sign) and point; the border
    /// counts as met within this test's rounding error. `None` for a ray that starts on its plane.
    pub fn crossing(&self, ray: &Ray) -> Option<(f64, SurfacePoint)> {
        let c = self.frame.crossing(ray)?;
        let slack = 2.0 * (c.slack_p + c.slack_q);
        (c.p * c.p + c.q * c.q <= 1.0 + slack).then(|| (c.t, self.inside(c.p, c.q)))
    }
}
