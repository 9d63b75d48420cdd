//! `<transform>`: translate, rotate, scale, lookat, matrix, in the order of the file.

use crate::geometry::{Matrix4, Point3, Transform, Vector3, math, tangent_frame};

use super::message::{Checked, Complaint};
use super::source::Span;

/// Largest coordinate [m]: seven times the distance of the sun; beyond it a double is coarser than
/// a tenth of a millimetre and products of a few coordinates leave its range.
pub(super) const MAX_COORDINATE: f64 = 1e12;

/// `inner`, then `step`.
///
/// # Errors
/// When the product leaves the range in which it can be inverted.
pub(super) fn compose(step: &Transform, inner: &Transform, span: Span) -> Checked<Transform> {
    let product = step.after(inner);
    let inverse = product.inverse();
    let origins = [product.point(&Point3::origin()), inverse.point(&Point3::origin())];
    let numbers = product.linear().iter().chain(inverse.linear().iter());
    let fine = numbers.chain(origins.iter().flat_map(|p| p.iter())).all(|x| x.is_finite());
    let determinant = product.determinant();
    if fine
        && determinant.is_finite()
        && determinant != 0.0
        && origins[0].coords.amax() <= MAX_COORDINATE
    {
        Ok(product)
    } else {
        Err(Complaint::at(span, "with this step the transform leaves the range of numbers").help(
            format!("keep coordinates within ±{MAX_COORDINATE:e} m and scales well away from 0"),
        ))
    }
}

/// Rotation about the unit vector `axis` by `degrees`, right-handed. Quarter turns are exact: their
/// sines and cosines are 0 and ±1.
pub(super) fn rotation(axis: Vector3, degrees: f64) -> Option<Transform> {
    let (s, c) = sin_cos_degrees(degrees);
    let linear = crate::geometry::Matrix3::identity() * c
        + axis.cross_matrix() * s
        + axis * axis.transpose() * (1.0 - c);
    Transform::from_matrix(&linear.to_homogeneous())
}

/// Sine and cosine of an angle in degrees, exact at multiples of 90.
fn sin_cos_degrees(degrees: f64) -> (f64, f64) {
    // The remainder is exact; the quarter is 0, ±1, … ±4.
    let turn = degrees % 360.0;
    let quarter = (turn / 90.0).round();
    let (s, c) = math::sin_cos((turn - quarter * 90.0).to_radians());
    match (quarter as i32).rem_euclid(4) {
        0 => (s, c),
        1 => (c, -s),
        2 => (-s, -c),
        _ => (-c, s),
    }
}

/// The frame at `origin` whose z looks at `target` and whose y is `up` as far as it can; x is then
/// to the left, as in Mitsuba 3. Without `up`, any.
pub(super) fn look_at(origin: Point3, target: Point3, up: Option<Vector3>) -> Option<Transform> {
    let forward = (target - origin).try_normalize(0.0)?;
    let up = match up {
        Some(up) => (up / up.amax()).try_normalize(0.0)?,
        None => tangent_frame(&nalgebra::Unit::new_unchecked(forward)).0,
    };
    // Two unit vectors nearer to parallel than this leave no significant digits of "left".
    let left = up.cross(&forward).try_normalize(1e-9)?;
    let up = forward.cross(&left);
    let m = Matrix4::new(
        left.x, up.x, forward.x, origin.x, //
        left.y, up.y, forward.y, origin.y, //
        left.z, up.z, forward.z, origin.z, //
        0.0, 0.0, 0.0, 1.0,
    );
    Transform::from_matrix(&m)
}

/// A matrix given by 16 numbers (rows of 4) or 9 (rows of 3, no translation).
pub(super) fn matrix(numbers: &[f64]) -> Option<Transform> {
    match numbers.len() {
        16 => Transform::from_matrix(&Matrix4::from_row_slice(numbers)),
        9 => Transform::from_matrix(
            &crate::geometry::Matrix3::from_row_slice(numbers).to_homogeneous(),
        ),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn quarter_turns_are_exact() {
        for (degrees, s, c) in [
            (0.0, 0.0, 1.0),
            (90.0, 1.0, 0.0),
            (-90.0, -1.0, 0.0),
            (180.0, 0.0, -1.0),
            (-450.0, -1.0, 0.0),
        ] {
            assert_eq!(sin_cos_degrees(degrees), (s, c), "{degrees}");
        }
        let (s, c) = sin_cos_degrees(30.0);
        assert!((s - 0.5).abs() < 1e-16 && (c - 3f64.sqrt() / 2.0).abs() < 1.2e-16);
        for degrees in [-777.7, -44.9, 12.3, 89.0, 91.0, 200.0, 1e6 + 0.25] {
            let (s, c) = sin_cos_degrees(degrees);
            let (s0, c0) = math::sin_cos(degrees % 360.0 * std::f64::consts::PI / 180.0);
            assert!((s - s0).abs() < 1e-14 && (c - c0).abs() < 1e-14, "{degrees}");
        }
    }

    #[test]
    fn rotation_is_right_handed() {
        let t = rotation(Vector3::z(), 90.0).unwrap();
        assert_eq!(t.point(&Point3::new(1.0, 0.0, 0.0)), Point3::new(0.0, 1.0, 0.0));
    }

    /// Mitsuba 3.9.1: `lookat origin="0,0,0" target="1,0,0"` has the columns (0,−1,0), (0,0,−1),
    /// (1,0,0); with `up` the first column is up × forward.
    #[test]
    fn look_at_has_mitsuba_s_columns() {
        let o = Point3::origin();
        let t = look_at(o, Point3::new(1.0, 0.0, 0.0), None).unwrap();
        assert_eq!(t.vector(&Vector3::x()), Vector3::new(0.0, -1.0, 0.0));
        assert_eq!(t.vector(&Vector3::y()), Vector3::new(0.0, 0.0, -1.0));
        let t = look_at(o, Point3::new(0.0, 0.0, 5.0), Some(Vector3::new(0.0, 3.0, 0.0))).unwrap();
        assert_eq!(t.vector(&Vector3::x()), Vector3::x());
        let t = look_at(o, Point3::new(0.0, 0.0, -5.0), Some(Vector3::new(0.0, 3.0, 1.0))).unwrap();
        assert_eq!(t.vector(&Vector3::x()), -Vector3::x());
        assert!(look_at(o, o, None).is_none());
        assert!(look_at(o, Point3::new(0.0, 2.0, 0.0), Some(Vector3::y())).is_none());
        assert!(look_at(o, Point3::new(0.0, 2.0, 0.0), Some(Vector3::zeros())).is_none());
    }
}
