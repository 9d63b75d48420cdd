//! Points, vectors, frames, transforms and boxes on top of the linear-algebra crate.
//!
//! Right-handed, metres, double precision. Elementary functions come from [`math`], so that the
//! same input gives the same bits on every machine.

mod bounds;
pub mod math;
mod rgb;
mod transform;

pub use bounds::Aabb;
pub use rgb::Rgb;
pub use transform::Transform;

/// A point of space [m].
pub type Point3 = nalgebra::Point3<f64>;
/// A displacement or a direction that is not normalised.
pub type Vector3 = nalgebra::Vector3<f64>;
/// A direction of length one.
pub type UnitVector3 = nalgebra::Unit<Vector3>;
/// A linear map of space.
pub type Matrix3 = nalgebra::Matrix3<f64>;
/// A row of it.
pub type RowVector3 = nalgebra::RowVector3<f64>;
/// An affine map in homogeneous coordinates.
pub type Matrix4 = nalgebra::Matrix4<f64>;
/// A linear map of a tangent plane.
pub type Matrix2 = nalgebra::Matrix2<f64>;
/// A vector of a tangent plane or of a parameter domain.
pub type Vector2 = nalgebra::Vector2<f64>;

/// A half-line `origin + t direction`, `t > 0`. The direction need not be of length one; `t` is in
/// units of its length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts [m].
    pub origin: Point3,
    /// Where it goes.
    pub direction: Vector3,
}

impl Ray {
    /// The ray from `origin` along `direction`.
    pub fn new(origin: Point3, direction: Vector3) -> Self {
        Self { origin, direction }
    }

    /// The point at parameter `t`.
    pub fn at(&self, t: f64) -> Point3 {
        self.origin + self.direction * t
    }
}

/// Two unit vectors that complete the unit vector `n` to a right-handed frame `(s, t, n)`.
///
/// Continuous but for n = −z (Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017).
pub fn tangent_frame(n: &UnitVector3) -> (Vector3, Vector3) {
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    (
        Vector3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
        Vector3::new(b, sign + n.y * n.y * a, -n.y),
    )
}
