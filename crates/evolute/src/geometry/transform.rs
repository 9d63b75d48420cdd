//! Affine maps between named frames.

use super::{Matrix3, Matrix4, Point3, Vector3, math};

/// An invertible affine map and its inverse. Name it target-from-source: `world_from_object`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    linear: Matrix3,
    translation: Vector3,
    inverse_linear: Matrix3,
}

impl Transform {
    /// The map that changes nothing.
    pub fn identity() -> Self {
        Self {
            linear: Matrix3::identity(),
            translation: Vector3::zeros(),
            inverse_linear: Matrix3::identity(),
        }
    }

    /// From a matrix whose last row is (0, 0, 0, 1); `None` if it is not, or has no inverse.
    pub fn from_matrix(m: &Matrix4) -> Option<Self> {
        if m.iter().any(|x| !x.is_finite()) || m.row(3) != Matrix4::identity().row(3) {
            return None;
        }
        let linear: Matrix3 = m.fixed_view::<3, 3>(0, 0).into_owned();
        Some(Self {
            linear,
            translation: m.fixed_view::<3, 1>(0, 3).into_owned(),
            inverse_linear: linear.try_inverse()?,
        })
    }

    /// A displacement [m].
    pub fn translation(by: Vector3) -> Self {
        Self { translation: by, ..Self::identity() }
    }

    /// Scaling along the axes; `None` if a factor is zero or not finite.
    pub fn scaling(factors: Vector3) -> Option<Self> {
        Self::from_matrix(&Matrix4::new_nonuniform_scaling(&factors))
    }

    /// Right-handed rotation about `axis` by `angle` [rad]; `None` if the axis has no direction.
    pub fn rotation(axis: Vector3, angle: f64) -> Option<Self> {
        let axis = axis.try_normalize(0.0).filter(|a| a.iter().all(|x| x.is_finite()))?;
        let (s, c) = math::sin_cos(angle);
        let linear =
            Matrix3::identity() * c + axis.cross_matrix() * s + axis * axis.transpose() * (1.0 - c);
        Some(Self { linear, translation: Vector3::zeros(), inverse_linear: linear.transpose() })
    }

    /// First `inner`, then `self`.
    pub fn after(&self, inner: &Self) -> Self {
        Self {
            linear: self.linear * inner.linear,
            translation: self.linear * inner.translation + self.translation,
            inverse_linear: inner.inverse_linear * self.inverse_linear,
        }
    }

    /// The way back.
    pub fn inverse(&self) -> Self {
        Self {
            linear: self.inverse_linear,
            translation: -(self.inverse_linear * self.translation),
            inverse_linear: self.linear,
        }
    }

    /// Maps a point.
    pub fn point(&self, p: &Point3) -> Point3 {
        Point3::from(self.linear * p.coords + self.translation)
    }

    /// Maps a displacement.
    pub fn vector(&self, v: &Vector3) -> Vector3 {
        self.linear * v
    }

    /// Maps a normal (by the inverse transpose; not normalised).
    pub fn normal(&self, n: &Vector3) -> Vector3 {
        self.inverse_linear.transpose() * n
    }

    /// The linear part.
    pub fn linear(&self) -> &Matrix3 {
        &self.linear
    }

    /// Determinant of the linear part: negative if handedness flips.
    pub fn determinant(&self) -> f64 {
        self.linear.determinant()
    }
}
