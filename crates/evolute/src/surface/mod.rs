//! Every surface of a scene, in world space: position, derivatives, fundamental forms, bounds.
//!
//! A surface knows geometry only; materials and emission belong to [`crate::scene::Shape`].

mod jet;

pub use jet::{Jet, LocalGeometry, PrincipalCurvatures};

use crate::geometry::Point3;

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

/// The closed set of surfaces.
#[derive(Clone, Debug)]
pub enum Surface {}
