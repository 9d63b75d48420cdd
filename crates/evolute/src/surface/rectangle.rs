//! Rectangles (parallelograms under shear).

use super::plane::{PlaneFrame, contact_tolerance, grown_for_rounding};
use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{Aabb, Point3, Ray, Transform, UnitVector3, Vector3};

/// The square [−1, 1]² of the object's plane z = 0, facing +z, under an affine map. Texture
/// coordinates are ((p + 1)/2, (q + 1)/2), as in Mitsuba 3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rectangle {
    frame: PlaneFrame,
}

impl Rectangle {
    /// The rectangle under `world_from_object`; `flip_normals` turns its front round.
    ///
    /// # Errors
    /// When the transform leaves no area.
    pub fn new(world_from_object: Transform, flip_normals: bool) -> Result<Self, SurfaceError> {
        Ok(Self { frame: PlaneFrame::new("rectangle", world_from_object, flip_normals)? })
    }

    /// The transform it was made with.
    pub fn world_from_object(&self) -> &Transform {
        &self.frame.world_from_object
    }

    /// The middle [m].
    pub fn centre(&self) -> Point3 {
        self.frame.centre
    }

    /// The two half edges: from the middle to the middle of the sides p = 1 and q = 1 [m].
    pub fn half_edges(&self) -> [Vector3; 2] {
        [self.frame.dp, self.frame.dq]
    }

    /// Unit normal of the front.
    pub fn normal(&self) -> UnitVector3 {
        self.frame.normal
    }

    /// The corners (−1, −1), (1, −1), (1, 1), (−1, 1) [m]; their order runs counter-clockwise about
    /// `half_edges()[0] × half_edges()[1]`, which is the front's normal or its opposite.
    pub fn corners(&self) -> [Point3; 4] {
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(p, q)| self.frame.at(p, q).x)
    }

    /// The point of object coordinates x = p, y = q.
    pub(super) fn at(&self, p: f64, q: f64) -> SurfacePoint {
        self.frame.at(p, q)
    }

    /// The point of texture coordinates in [0, 1]², else `None`.
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        super::in_unit_square(u, v).then(|| self.frame.at(2.0 * u - 1.0, 2.0 * v - 1.0))
    }

    /// Derivatives by texture coordinates.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        super::in_unit_square(u, v).then(|| {
            let d = [[2.0, 0.0], [0.0, 2.0], [0.0; 2], [0.0; 2], [0.0; 2]];
            self.frame.jet([2.0 * u - 1.0, 2.0 * v - 1.0], d)
        })
    }

    /// Texture coordinates.
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        [0.5 * (point.p + 1.0), 0.5 * (point.q + 1.0)]
    }

    /// Geometry at a point.
    pub fn local(&self, point: &SurfacePoint) -> LocalGeometry {
        self.frame.local(point.x)
    }

    /// The surface point at `x`, if `x` lies on the rectangle to within [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        let tolerance = contact_tolerance(x, &self.bounds());
        let (p, q, _) = self.frame.coordinates(x);
        let point = self.frame.at(p.clamp(-1.0, 1.0), q.clamp(-1.0, 1.0));
        ((point.x - x).norm() <= tolerance).then_some(point)
    }

    /// The least box around it (grown by its rounding error).
    pub fn bounds(&self) -> Aabb {
        grown_for_rounding(Aabb::around(self.corners()))
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        4.0 * self.frame.area()
    }

    /// Least distance from `x` [m].
    pub fn distance(&self, x: &Point3) -> f64 {
        let (p, q, height) = self.frame.coordinates(x);
        if p.abs() <= 1.0 && q.abs() <= 1.0 {
            return height.abs();
        }
        let c = self.corners();
        (0..4)
            .map(|i| super::distance_to_segment(x, &c[i], &c[(i + 1) % 4]))
            .fold(f64::INFINITY, f64::min)
    }

    /// Where the ray's line meets the rectangle: ray parameter (of either sign) and point. A line that
    /// passes a border by less than the rounding error of this test counts as met, so that rectangles
    /// that share an edge do not leak. `None` for a ray that starts on its plane.
    pub fn crossing(&self, ray: &Ray) -> Option<(f64, SurfacePoint)> {
        let c = self.frame.crossing(ray)?;
        (c.p.abs() <= 1.0 + c.slack_p && c.q.abs() <= 1.0 + c.slack_q)
            .then(|| (c.t, self.frame.at(c.p.clamp(-1.0, 1.0), c.q.clamp(-1.0, 1.0))))
    }
}
