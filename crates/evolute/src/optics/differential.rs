//! First derivatives along a chain by forward differentiation: the wavefront from the receiver as a
//! pair of Jacobi fields.
//!
//! A [`Dual`] carries a value and its derivatives with respect to the two coordinates (a, b) of a
//! domain of first rays. A [`DualRay`] carries a ray and how its origin and direction move with
//! (a, b): the same information as the curvature tensor of the wavefront from the receiver, but
//! without a pole where the wavefront has a focus.
//!
//! Guarantee: derivatives are those of the exact formulas, to rounding. Limit: where the map itself
//! has an infinite derivative (limb, total reflection) the derivative is infinite or not a number;
//! callers cut there.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::geometry::{Matrix3, Point3, Vector3, math};

/// A number and its derivatives with respect to two coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Dual {
    /// Value.
    pub v: f64,
    /// Derivative with respect to a.
    pub a: f64,
    /// Derivative with respect to b.
    pub b: f64,
}

impl Dual {
    /// A number that does not move.
    pub const fn constant(v: f64) -> Self {
        Self { v, a: 0.0, b: 0.0 }
    }

    /// Value and derivatives.
    pub const fn new(v: f64, a: f64, b: f64) -> Self {
        Self { v, a, b }
    }

    /// Chain rule for a function with value `f` and derivative `df` at `self.v`.
    pub fn chain(self, f: f64, df: f64) -> Self {
        Self { v: f, a: df * self.a, b: df * self.b }
    }

    /// Square root.
    pub fn sqrt(self) -> Self {
        let r = self.v.sqrt();
        self.chain(r, 0.5 / r)
    }

    /// Reciprocal.
    pub fn recip(self) -> Self {
        let r = 1.0 / self.v;
        self.chain(r, -r * r)
    }

    /// Square.
    pub fn squared(self) -> Self {
        self.chain(self.v * self.v, 2.0 * self.v)
    }

    /// Sine.
    pub fn sin(self) -> Self {
        let (s, c) = math::sin_cos(self.v);
        self.chain(s, c)
    }

    /// Cosine.
    pub fn cos(self) -> Self {
        let (s, c) = math::sin_cos(self.v);
        self.chain(c, -s)
    }

    /// Arc sine.
    pub fn asin(self) -> Self {
        self.chain(math::asin(self.v), 1.0 / (1.0 - self.v * self.v).sqrt())
    }

    /// Whether value and derivatives are finite.
    pub fn is_finite(&self) -> bool {
        self.v.is_finite() && self.a.is_finite() && self.b.is_finite()
    }
}

impl Add for Dual {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { v: self.v + o.v, a: self.a + o.a, b: self.b + o.b }
    }
}
impl Sub for Dual {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { v: self.v - o.v, a: self.a - o.a, b: self.b - o.b }
    }
}
impl Neg for Dual {
    type Output = Self;
    fn neg(self) -> Self {
        Self { v: -self.v, a: -self.a, b: -self.b }
    }
}
impl Mul for Dual {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { v: self.v * o.v, a: self.a * o.v + self.v * o.a, b: self.b * o.v + self.v * o.b }
    }
}
impl Div for Dual {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let r = 1.0 / o.v;
        let q = self.v * r;
        Self { v: q, a: (self.a - q * o.a) * r, b: (self.b - q * o.b) * r }
    }
}
impl Mul<f64> for Dual {
    type Output = Self;
    fn mul(self, f: f64) -> Self {
        Self { v: self.v * f, a: self.a * f, b: self.b * f }
    }
}
impl Add<f64> for Dual {
    type Output = Self;
    fn add(self, f: f64) -> Self {
        Self { v: self.v + f, ..self }
    }
}

/// A vector and its derivatives with respect to two coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualVector {
    /// Value.
    pub v: Vector3,
    /// Derivative with respect to a.
    pub a: Vector3,
    /// Derivative with respect to b.
    pub b: Vector3,
}

impl DualVector {
    /// A vector that does not move.
    pub fn constant(v: Vector3) -> Self {
        Self { v, a: Vector3::zeros(), b: Vector3::zeros() }
    }

    /// Value and derivatives.
    pub fn new(v: Vector3, a: Vector3, b: Vector3) -> Self {
        Self { v, a, b }
    }

    /// Scalar product.
    pub fn dot(&self, o: &Self) -> Dual {
        Dual {
            v: self.v.dot(&o.v),
            a: self.a.dot(&o.v) + self.v.dot(&o.a),
            b: self.b.dot(&o.v) + self.v.dot(&o.b),
        }
    }

    /// Scalar product with a vector that does not move.
    pub fn dot_constant(&self, o: &Vector3) -> Dual {
        Dual { v: self.v.dot(o), a: self.a.dot(o), b: self.b.dot(o) }
    }

    /// Vector product.
    pub fn cross(&self, o: &Self) -> Self {
        Self {
            v: self.v.cross(&o.v),
            a: self.a.cross(&o.v) + self.v.cross(&o.a),
            b: self.b.cross(&o.v) + self.v.cross(&o.b),
        }
    }

    /// Squared length.
    pub fn norm_squared(&self) -> Dual {
        Dual {
            v: self.v.norm_squared(),
            a: 2.0 * self.v.dot(&self.a),
            b: 2.0 * self.v.dot(&self.b),
        }
    }

    /// Product with a number.
    pub fn scaled(&self, f: Dual) -> Self {
        Self { v: self.v * f.v, a: self.a * f.v + self.v * f.a, b: self.b * f.v + self.v * f.b }
    }

    /// Image under a linear map that does not move.
    pub fn mapped(&self, m: &Matrix3) -> Self {
        Self { v: m * self.v, a: m * self.a, b: m * self.b }
    }
}

impl Add for DualVector {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { v: self.v + o.v, a: self.a + o.a, b: self.b + o.b }
    }
}
impl Sub for DualVector {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { v: self.v - o.v, a: self.a - o.a, b: self.b - o.b }
    }
}
impl Neg for DualVector {
    type Output = Self;
    fn neg(self) -> Self {
        Self { v: -self.v, a: -self.a, b: -self.b }
    }
}
impl Mul<f64> for DualVector {
    type Output = Self;
    fn mul(self, f: f64) -> Self {
        Self { v: self.v * f, a: self.a * f, b: self.b * f }
    }
}

/// A ray of a two-parameter family: origin on the last surface, unit direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DualRay {
    /// Origin [m], as a vector from the world's origin.
    pub o: DualVector,
    /// Unit direction.
    pub d: DualVector,
}

impl DualRay {
    /// The family's points at distance `t` [m] of the central ray, where they meet the surface
    /// through `at` whose normal is `n`: neighbours run a little longer or shorter. `None` if the
    /// central ray is tangent to the surface.
    pub fn met(&self, t: f64, at: &Point3, n: &Vector3) -> Option<DualVector> {
        let dn = self.d.v.dot(n);
        if dn == 0.0 {
            return None;
        }
        let along = |o: &Vector3, d: &Vector3| {
            let x = o + d * t;
            x - self.d.v * (n.dot(&x) / dn)
        };
        Some(DualVector {
            v: at.coords,
            a: along(&self.o.a, &self.d.a),
            b: along(&self.o.b, &self.d.b),
        })
    }
}

/// The unit direction after reflection of the unit direction `d` at the unit normal `n` (either side).
pub fn reflected(d: &DualVector, n: &DualVector) -> DualVector {
    let c = d.dot(n);
    *d - n.scaled(c * 2.0)
}

/// The unit direction after refraction and the cosine inside, for the unit direction `d` at the unit
/// normal `n` **on the side that `d` comes from**, eta = n₁/n₂, `cos_i` = −d·n.
///
/// `None` for total reflection. For `cos_i` < 0 this is the analytic continuation past the limb.
pub fn refracted(
    d: &DualVector,
    n: &DualVector,
    eta: f64,
    cos_i: Dual,
) -> Option<(DualVector, Dual)> {
    let cos2_t = (cos_i.squared() * -1.0 + 1.0) * (-eta * eta) + 1.0;
    if cos2_t.v <= 0.0 {
        return None;
    }
    let cos_t = cos2_t.sqrt();
    Some((*d * eta + n.scaled(cos_i * eta - cos_t), cos_t))
}

/// Fresnel's reflectance of unpolarised light at a smooth boundary, from the cosines on both sides and
/// the refractive indices of the side that light comes from and of the other.
pub fn fresnel_dielectric(cos_i: Dual, cos_t: Dual, n_i: f64, n_t: f64) -> Dual {
    let (ii, tt) = (cos_i * n_i, cos_t * n_t);
    let (it, ti) = (cos_t * n_i, cos_i * n_t);
    let perpendicular = (ii - tt) / (ii + tt);
    let parallel = (ti - it) / (ti + it);
    (perpendicular.squared() + parallel.squared()) * 0.5
}

/// Fresnel's reflectance of unpolarised light at a metal of complex index `eta + i k` in air.
pub fn fresnel_conductor(cos_i: Dual, eta: f64, k: f64) -> Dual {
    let c2 = cos_i.squared();
    let s2 = c2 * -1.0 + 1.0;
    // u + i v is the root of (eta + i k)² − sin² i; m = u² + v².
    let t = s2 * -1.0 + (eta * eta - k * k);
    let m = (t.squared() + 4.0 * eta * eta * k * k).sqrt();
    let u = ((m + t) * 0.5).sqrt();
    let (sum, cross) = (m + c2, u * cos_i * 2.0);
    let perpendicular = (sum - cross) / (sum + cross);
    let (high, low) = (c2 * m + s2.squared(), cross * s2);
    let parallel = perpendicular * ((high - low) / (high + low));
    (perpendicular + parallel) * 0.5
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// A family of rays through a sphere surface, differentiated by hand-made central differences.
    fn chain(a: f64, b: f64, eta: f64) -> (Vector3, Vector3) {
        let d = Vector3::new(0.2 + a, 0.1 + b, -1.0).normalize();
        let o = Vector3::new(0.1, -0.2, 3.0);
        let (q, c) = (o.dot(&d), o.norm_squared() - 1.0);
        let t = -q - (q * q - c).sqrt();
        let x = o + d * t;
        let n = x;
        let ci = -d.dot(&n);
        let ct = (1.0 - eta * eta * (1.0 - ci * ci)).sqrt();
        (x, d * eta + n * (eta * ci - ct))
    }

    #[test]
    fn refraction_agrees_with_central_differences() {
        let (h, eta) = (1e-6, 1.0 / 1.5);
        let raw = Vector3::new(0.2, 0.1, -1.0);
        let dv = DualVector::new(raw, Vector3::x(), Vector3::y());
        let d = dv.scaled(dv.norm_squared().sqrt().recip());
        let o = Vector3::new(0.1, -0.2, 3.0);
        let ray = DualRay { o: DualVector::constant(o), d };
        let (x0, out0) = chain(0.0, 0.0, eta);
        let t = (x0 - o).norm();
        let x = ray.met(t, &Point3::from(x0), &x0).unwrap();
        let n = x; // the unit sphere's normal is its position
        let (out, _) = refracted(&d, &n, eta, -d.dot(&n)).unwrap();
        assert!((out.v - out0).norm() < 1e-14);
        for (got_x, got_d, (da, db)) in [(x.a, out.a, (h, 0.0)), (x.b, out.b, (0.0, h))] {
            let (xp, dp) = chain(da, db, eta);
            let (xm, dm) = chain(-da, -db, eta);
            assert!((got_x - (xp - xm) / (2.0 * h)).norm() < 1e-8);
            assert!((got_d - (dp - dm) / (2.0 * h)).norm() < 1e-8);
        }
        let back = reflected(&d, &n);
        assert!((back.v.norm() - 1.0).abs() < 1e-14 && back.v.dot(&back.a).abs() < 1e-13);
    }
}
