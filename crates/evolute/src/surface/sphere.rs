//! Spheres.

use super::error::{finite, positive};
use super::plane::{contact_tolerance, grown_for_rounding};
use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{Aabb, Matrix3, Point3, Ray, Transform, UnitVector3, Vector3, math};
use std::f64::consts::{PI, TAU};

/// A sphere. Texture coordinates are (φ/2π, θ/π) of spherical coordinates in object space, θ from
/// +z, as in Mitsuba 3. Its front is the outside; a transform that mirrors turns it inside, as does
/// `flip_normals` (Mitsuba 3 does the same).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    centre: Point3,
    radius: f64,
    /// Orthogonal, of either handedness: the object's axes.
    axes: Matrix3,
    /// +1: the front is outside; −1: inside.
    side: f64,
    world_from_object: Transform,
}

/// How far a matrix of a scene file may be from a similarity, as a fraction of its scale. Matrices
/// typed with six digits pass.
pub(super) const SIMILARITY: f64 = 1e-5;

/// The orthogonal matrix next to one that is nearly so (Newton's iteration for the polar factor: its
/// error is squared in each step, so four take 1e-5 far below rounding).
pub(super) fn orthogonalised(mut m: Matrix3) -> Option<Matrix3> {
    for _ in 0..4 {
        m = (m + m.transpose().try_inverse()?) * 0.5;
    }
    Some(m)
}

impl Sphere {
    /// The sphere about `centre` [m, object frame] with `radius` [m, object frame] under
    /// `world_from_object`; `flip_normals` turns its front round.
    ///
    /// # Errors
    /// When radius or centre are not finite, the radius is not positive, or the transform scales
    /// unevenly or shears.
    pub fn new(
        centre: Point3,
        radius: f64,
        world_from_object: Transform,
        flip_normals: bool,
    ) -> Result<Self, SurfaceError> {
        let radius = positive("the radius", radius)?;
        let centre = finite("the centre", centre)?;
        let determinant = world_from_object.determinant();
        let scale = math::cbrt(determinant.abs());
        let distorted = SurfaceError::Distorted { shape: "sphere", how: "evenly" };
        if !(scale.is_finite() && scale > 0.0) {
            return Err(distorted);
        }
        let axes = world_from_object.linear() / scale;
        if (axes.transpose() * axes - Matrix3::identity()).amax() > SIMILARITY {
            return Err(distorted);
        }
        let axes = orthogonalised(axes).ok_or(distorted)?;
        Ok(Self {
            centre: finite("the centre", world_from_object.point(&centre))?,
            radius: positive("the radius", radius * scale)?,
            axes,
            side: if (determinant < 0.0) != flip_normals { -1.0 } else { 1.0 },
            world_from_object,
        })
    }

    /// Centre [m].
    pub fn centre(&self) -> Point3 {
        self.centre
    }

    /// Radius [m].
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The object's axes x, y, z in world space: unit vectors, left-handed if the transform mirrors.
    pub fn axes(&self) -> [Vector3; 3] {
        std::array::from_fn(|i| self.axes.column(i).into_owned())
    }

    /// Whether the front is the outside.
    pub fn faces_outward(&self) -> bool {
        self.side > 0.0
    }

    /// The transform it was made with.
    pub fn world_from_object(&self) -> &Transform {
        &self.world_from_object
    }

    /// The point in direction `d` from the centre, `d` of length one.
    pub(super) fn towards(&self, d: &Vector3) -> SurfacePoint {
        SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x: self.centre + d * self.radius }
    }

    /// `x` moved to the sphere along its radius; `None` at the centre.
    pub fn projected(&self, x: &Point3) -> Option<SurfacePoint> {
        (x - self.centre).try_normalize(0.0).map(|d| self.towards(&d))
    }

    /// The point of texture coordinates in [0, 1]², else `None`.
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        super::in_unit_square(u, v).then(|| {
            let ((sp, cp), (st, ct)) = (math::sin_cos(TAU * u), math::sin_cos(PI * v));
            self.towards(&(self.axes * Vector3::new(st * cp, st * sp, ct)))
        })
    }

    /// Derivatives by texture coordinates; singular at v = 0 and v = 1.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        super::in_unit_square(u, v).then(|| {
            let ((sp, cp), (st, ct)) = (math::sin_cos(TAU * u), math::sin_cos(PI * v));
            let to = |x, y, z| self.axes * Vector3::new(x, y, z) * self.radius;
            Jet {
                x: self.centre + to(st * cp, st * sp, ct),
                xu: to(-st * sp, st * cp, 0.0) * TAU,
                xv: to(ct * cp, ct * sp, -st) * PI,
                xuu: to(-st * cp, -st * sp, 0.0) * (TAU * TAU),
                xuv: to(-ct * sp, ct * cp, 0.0) * (TAU * PI),
                xvv: to(-st * cp, -st * sp, -ct) * (PI * PI),
            }
        })
    }

    /// Texture coordinates (u is 0 on the poles' axis).
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        let d = self.axes.transpose() * (point.x - self.centre);
        let across = (d.x * d.x + d.y * d.y).sqrt();
        [super::turn(d.y, d.x), math::atan2(across, d.z) / PI]
    }

    /// Geometry at a point; `None` if the point is the centre.
    pub fn local(&self, point: &SurfacePoint) -> Option<LocalGeometry> {
        let outward = UnitVector3::try_new(point.x - self.centre, 0.0)?;
        let tangential = Matrix3::identity() - outward.into_inner() * outward.transpose();
        let n = if self.side > 0.0 { outward } else { -outward };
        Some(LocalGeometry { x: point.x, n, ng: n, dn_dx: tangential * (self.side / self.radius) })
    }

    /// The surface point at `x`, if `x` lies on the sphere to within [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        let point = self.projected(x)?;
        ((point.x - x).norm() <= contact_tolerance(x, &self.bounds())).then_some(point)
    }

    /// The least box around it (grown by its rounding error).
    pub fn bounds(&self) -> Aabb {
        let half = Vector3::repeat(self.radius);
        grown_for_rounding(Aabb { min: self.centre - half, max: self.centre + half })
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        4.0 * PI * self.radius * self.radius
    }

    /// Least distance from `x` [m].
    pub fn distance(&self, x: &Point3) -> f64 {
        ((x - self.centre).norm() - self.radius).abs()
    }

    /// Both ray parameters at which the ray's line meets the sphere, in increasing order; `None` if it
    /// misses. A root that rounding cannot tell from the ray's start is reported as 0.
    ///
    /// The discriminant comes from the distance between centre and line, not from b² − ac (Haines et
    /// al., "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems, 2019).
    pub fn roots(&self, ray: &Ray) -> Option<[f64; 2]> {
        quadratic_roots(&(ray.origin - self.centre), &ray.direction, self.radius, || {
            self.centre.coords.amax() + ray.origin.coords.amax()
        })
    }

    /// The other root, as a ray parameter, of a line that passes through the point `x` of the sphere
    /// at t = 0; zero when it is tangent.
    pub fn other_root(&self, x: &Point3, direction: &Vector3) -> f64 {
        -2.0 * (x - self.centre).dot(direction) / direction.norm_squared()
    }
}

/// Roots of |f + t d| = r in increasing order. A root nearer to the start than the rounding of
/// |f| − r can tell is reported as 0; `size` is the size of the coordinates that f was made of.
pub(super) fn quadratic_roots(
    f: &Vector3,
    d: &Vector3,
    r: f64,
    size: impl Fn() -> f64,
) -> Option<[f64; 2]> {
    let a = d.norm_squared();
    let b = -f.dot(d);
    let nearest = f + d * (b / a);
    let discriminant = (r - nearest.norm()) * (r + nearest.norm());
    if discriminant.is_nan() || discriminant < 0.0 {
        return None;
    }
    let root = (a * discriminant).sqrt();
    let q = if b < 0.0 { b - root } else { b + root };
    let height = f.norm() - r;
    // Rounding of f (half an ulp of each coordinate) and of its norm.
    let doubt = 4.0 * f64::EPSILON * (size() + r);
    let c = if height.abs() <= doubt { 0.0 } else { height * (f.norm() + r) };
    if q == 0.0 {
        return (a > 0.0).then_some([0.0, 0.0]);
    }
    let (t0, t1) = (c / q, q / a);
    (t0.is_finite() && t1.is_finite()).then_some(if t0 <= t1 { [t0, t1] } else { [t1, t0] })
}
