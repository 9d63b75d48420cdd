//! Every surface of a scene, in world space: position, derivatives, fundamental forms, bounds.
//!
//! A surface knows geometry only; materials and emission belong to [`crate::scene::Shape`].

mod chart;
mod cylinder;
mod disk;
mod error;
mod jet;
mod mesh;
mod parametric;
mod plane;
mod rectangle;
mod sphere;

pub use chart::ChartPoint;
pub(crate) use chart::sphere_charts;
pub use cylinder::Cylinder;
pub use disk::Disk;
pub use error::SurfaceError;
pub use jet::{Jet, LocalGeometry, PrincipalCurvatures};
pub(crate) use mesh::PatchRoot;
pub use mesh::{Mesh, MeshSmoothing};
pub use parametric::{Cell, Parametric};
pub use plane::contact_tolerance;
pub use rectangle::Rectangle;
pub use sphere::Sphere;

use crate::geometry::{Aabb, Point3, math};

/// A point on a surface, with the coordinates in which the surface itself knows it best.
///
/// The intrinsic coordinates (p, q) are, by kind: rectangle, disk: x, y in object space, where the
/// shape is [−1, 1]² or the unit disk; cylinder: unused, height in [0, 1]; sphere: unused; mesh: the
/// barycentric weights of the triangle's second and third vertex; parametric: (s, t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Triangle of a mesh, else 0.
    pub primitive: u32,
    /// First intrinsic coordinate.
    pub p: f64,
    /// Second intrinsic coordinate.
    pub q: f64,
    /// Position, world frame [m].
    pub x: Point3,
}

/// The closed set of surfaces, prepared in world space.
#[derive(Clone, Debug)]
pub enum Surface {
    /// A parallelogram.
    Rectangle(Rectangle),
    /// A filled ellipse.
    Disk(Disk),
    /// A sphere.
    Sphere(Sphere),
    /// An open circular cylinder.
    Cylinder(Cylinder),
    /// Triangles.
    Mesh(Mesh),
    /// Formulas of (s, t).
    Parametric(Parametric),
}

impl Surface {
    /// The point of texture coordinates (u, v), which are Mitsuba 3's for the shape; `None` outside
    /// the shape's domain ([0, 1]² but on meshes).
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        match self {
            Self::Rectangle(s) => s.point(u, v),
            Self::Disk(s) => s.point(u, v),
            Self::Sphere(s) => s.point(u, v),
            Self::Cylinder(s) => s.point(u, v),
            Self::Mesh(s) => s.point(u, v),
            Self::Parametric(p) => in_unit_square(u, v).then(|| p.point(u, v)),
        }
    }

    /// Position and derivatives by texture coordinates; `None` outside the domain.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        match self {
            Self::Rectangle(s) => s.jet(u, v),
            Self::Disk(s) => s.jet(u, v),
            Self::Sphere(s) => s.jet(u, v),
            Self::Cylinder(s) => s.jet(u, v),
            Self::Mesh(s) => s.jet(u, v),
            Self::Parametric(p) => in_unit_square(u, v).then(|| p.jet(u, v)),
        }
    }

    /// Texture coordinates of a point.
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        match self {
            Self::Rectangle(s) => s.uv(point),
            Self::Disk(s) => s.uv(point),
            Self::Sphere(s) => s.uv(point),
            Self::Cylinder(s) => s.uv(point),
            Self::Mesh(s) => s.uv(point),
            Self::Parametric(_) => [point.p, point.q],
        }
    }

    /// Normal on the front side and its derivative at a point; `None` where the surface has no
    /// normal (a degenerate triangle, a singular corner of a parametrisation).
    pub fn local(&self, point: &SurfacePoint) -> Option<LocalGeometry> {
        match self {
            Self::Rectangle(s) => Some(s.local(point)),
            Self::Disk(s) => Some(s.local(point)),
            Self::Sphere(s) => s.local(point),
            Self::Cylinder(s) => s.local(point),
            Self::Mesh(s) => s.local(point),
            Self::Parametric(p) => p.local(point.p, point.q),
        }
    }

    /// The surface point at `x`, if `x` lies on the surface to within [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        match self {
            Self::Rectangle(s) => s.locate(x),
            Self::Disk(s) => s.locate(x),
            Self::Sphere(s) => s.locate(x),
            Self::Cylinder(s) => s.locate(x),
            Self::Mesh(s) => s.locate(x),
            Self::Parametric(p) => p.locate(x).map(|(s, t)| p.point(s, t)),
        }
    }

    /// A box that contains the whole surface, every point that the methods here return included [m].
    pub fn bounds(&self) -> Aabb {
        match self {
            Self::Rectangle(s) => s.bounds(),
            Self::Disk(s) => s.bounds(),
            Self::Sphere(s) => s.bounds(),
            Self::Cylinder(s) => s.bounds(),
            Self::Mesh(s) => s.bounds(),
            Self::Parametric(p) => p.bounds(),
        }
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        match self {
            Self::Rectangle(s) => s.area(),
            Self::Disk(s) => s.area(),
            Self::Sphere(s) => s.area(),
            Self::Cylinder(s) => s.area(),
            Self::Mesh(s) => s.area(),
            // As good as the closed forms of the others, to what anyone will notice.
            Self::Parametric(p) => p.area(1e-9),
        }
    }
}

/// Whether both are in [0, 1].
fn in_unit_square(u: f64, v: f64) -> bool {
    (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v)
}

/// The angle of (x, y) as a fraction of a full turn, in [0, 1).
fn turn(y: f64, x: f64) -> f64 {
    let a = math::atan2(y, x) / std::f64::consts::TAU;
    // −ε + 1 rounds to 1, which is the angle 0.
    if a < 0.0 { Some(a + 1.0).filter(|&a| a < 1.0).unwrap_or(0.0) } else { a }
}

/// Distance from `x` to the segment from `a` to `b` [m].
fn distance_to_segment(x: &Point3, a: &Point3, b: &Point3) -> f64 {
    let (ab, ax) = (b - a, x - a);
    let w = ab.dot(&ax) / ab.norm_squared();
    let w = if w.is_finite() { w.clamp(0.0, 1.0) } else { 0.0 };
    (ax - ab * w).norm()
}
