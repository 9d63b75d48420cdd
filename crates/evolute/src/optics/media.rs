//! Directions at a smooth boundary: the law of reflection and Snell's law as vectors.
//!
//! One relation holds both: n₂ d₂ − n₁ d₁ = γ N, with unit directions d along the light before and
//! after and the unit normal N on either side. At a reflection n₂ = n₁ and γ = −2 n₁ (d₁·N); at a
//! refraction, with the cosines i and t taken positive and N facing the light,
//! γ = n₁ cos i − n₂ cos t = (n₁² − n₂²)/(n₁ cos i + n₂ cos t). The second form does not cancel where
//! the indices are close, and gives exactly 0 where they are equal.

use crate::geometry::{UnitVector3, Vector3};

/// What a smooth surface does to a ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interaction {
    /// Back into the same medium.
    Reflection,
    /// Through, into the other medium.
    Refraction,
}

/// A ray's direction after a refraction, and both cosines with the normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Refraction {
    /// Direction after.
    pub direction: UnitVector3,
    /// Cosine of the angle of incidence, ≥ 0.
    pub cos_i: f64,
    /// Cosine of the angle of refraction, ≥ 0.
    pub cos_t: f64,
    /// γ of n₂ d₂ − n₁ d₁ = γ N, for the normal as it was given.
    pub gamma: f64,
}

/// Direction after a reflection of `d` at a surface with normal `n` (either side).
pub fn reflect_direction(d: &UnitVector3, n: &UnitVector3) -> UnitVector3 {
    // The image of a unit vector has length one up to rounding; without the normalisation the error
    // would add up over hundreds of reflections.
    UnitVector3::new_normalize(d.into_inner() - n.into_inner() * (2.0 * d.dot(n)))
}

/// Direction after a refraction of `d` at a surface with normal `n` (either side), from a medium of
/// refractive index `n1` into one of `n2`. `None` at total reflection.
pub fn refract_direction(d: &UnitVector3, n: &UnitVector3, n1: f64, n2: f64) -> Option<Refraction> {
    let along = d.dot(n);
    let cos_i = along.abs();
    let cos_t = cos_after(d.cross(n).norm(), n1, n2)?;
    let gamma = refraction_gamma(along, cos_t.copysign(along), n1, n2);
    let direction: Vector3 = d.into_inner() * n1 + n.into_inner() * gamma;
    let direction = UnitVector3::try_new(direction, 0.0)?;
    Some(Refraction { direction, cos_i, cos_t, gamma })
}

/// γ of a refraction from d₁·N (`along`) and d₂·N (`after`), both of one sign.
pub(super) fn refraction_gamma(along: f64, after: f64, n1: f64, n2: f64) -> f64 {
    // The quotient is γ for the normal that faces the light; the signs of the cosines turn it.
    (n2 * n2 - n1 * n1) / (n1 * along + n2 * after)
}

/// Cosine of the angle of refraction for an angle of incidence of sine `sin_i`; `None` at total
/// reflection.
fn cos_after(sin_i: f64, n1: f64, n2: f64) -> Option<f64> {
    let sin_t = sin_i * n1 / n2;
    let square = (1.0 - sin_t) * (1.0 + sin_t);
    (square >= 0.0).then(|| square.sqrt())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn unit(x: f64, y: f64, z: f64) -> UnitVector3 {
        UnitVector3::new_normalize(Vector3::new(x, y, z))
    }

    #[test]
    fn reflection_keeps_the_tangential_part_and_turns_the_normal_part() {
        let (d, n) = (unit(1.0, -2.0, 0.5), unit(0.2, 1.0, -0.3));
        let r = reflect_direction(&d, &n);
        assert!((d.cross(&n) - r.cross(&n)).norm() < 1e-15);
        assert!((d.dot(&n) + r.dot(&n)).abs() < 1e-15);
    }

    #[test]
    fn refraction_obeys_snell_on_either_side_of_the_normal() {
        let (d, n) = (unit(1.0, -2.0, 0.5), unit(0.2, 1.0, -0.3));
        for (n1, n2) in [(1.0, 1.5), (1.5, 1.3), (1.2, 1.2)] {
            for n in [n, -n] {
                let r = refract_direction(&d, &n, n1, n2).unwrap();
                assert!((d.cross(&n) * n1 - r.direction.cross(&n) * n2).norm() < 2e-15);
                assert!((r.direction.dot(&n).abs() - r.cos_t).abs() < 1e-15);
                assert_eq!(r.direction.dot(&n) < 0.0, d.dot(&n) < 0.0);
                let gamma = n2 * r.direction.dot(&n) - n1 * d.dot(&n);
                assert!((gamma - r.gamma).abs() < 1e-15);
            }
        }
        assert_eq!(refract_direction(&d, &n, 1.3, 1.3).unwrap().gamma, 0.0);
    }

    #[test]
    fn beyond_the_critical_angle_nothing_passes() {
        let critical: f64 = 1.0 / 1.5;
        for (sin_i, passes) in [(critical - 1e-12, true), (critical + 1e-12, false)] {
            let d = unit(sin_i, 0.0, -(1.0 - sin_i * sin_i).sqrt());
            assert_eq!(refract_direction(&d, &unit(0.0, 0.0, 1.0), 1.5, 1.0).is_some(), passes);
        }
    }
}
