//! What a tape can be evaluated over.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::geometry::math;

/// A kind of number that formulas can be evaluated over: `f64`, an interval, a jet of either.
///
/// Outside a function's domain `f64` gives NaN or an infinity; intervals take the part inside.
pub trait Scalar:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant.
    fn constant(value: f64) -> Self;
    /// `self + c`.
    fn shifted(self, c: f64) -> Self;
    /// `c self`.
    fn scaled(self, c: f64) -> Self;
    /// Sine and cosine of an angle [rad].
    fn sin_cos(self) -> (Self, Self);
    /// Tangent of an angle [rad].
    fn tan(self) -> Self;
    /// Arc sine [rad].
    fn asin(self) -> Self;
    /// Arc cosine [rad].
    fn acos(self) -> Self;
    /// Arc tangent [rad].
    fn atan(self) -> Self;
    /// The angle of the point (x, y) = (`x`, `self`), in (−π, π] [rad].
    fn atan2(self, x: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Exponential function.
    fn exp(self) -> Self;
    /// Natural logarithm.
    fn log(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The lesser.
    fn min(self, other: Self) -> Self;
    /// The greater.
    fn max(self, other: Self) -> Self;
    /// `√(self² + other²)`.
    fn hypot(self, other: Self) -> Self;
    /// A whole power, by repeated multiplication.
    fn powi(self, n: i32) -> Self;
    /// A constant power of a base ≥ 0.
    fn powf(self, c: f64) -> Self;
    /// A power of a base ≥ 0.
    fn pow(self, exponent: Self) -> Self;
}

/// A scalar that jets can be built over: it has an order, as far as that is known.
pub trait Field: Scalar {
    /// `Some(true)` if `self ≤ other` for sure, `Some(false)` if `self ≥ other` for sure, `None` if
    /// both can be. A NaN counts as chosen: as the lesser in `self`, as the greater in `other`.
    fn at_most(self, other: Self) -> Option<bool>;
    /// Everything between the two.
    fn hull(self, other: Self) -> Self;
    /// A value of which nothing is known.
    fn unknown() -> Self;
    /// Whether `atan2(self, x)` may jump from −π to π.
    fn atan2_may_jump(self, x: Self) -> bool;
}

/// `x^n` by repeated squaring; the same products in the same order for every kind of scalar.
pub(super) fn power<T: Copy>(x: T, n: u32, one: T, mul: impl Fn(T, T) -> T) -> T {
    let (mut n, mut base, mut result) = (n, x, None);
    while n > 0 {
        if n & 1 == 1 {
            result = Some(result.map_or(base, |r| mul(r, base)));
        }
        n >>= 1;
        if n > 0 {
            base = mul(base, base);
        }
    }
    result.unwrap_or(one)
}

impl Scalar for f64 {
    fn constant(value: f64) -> Self {
        value
    }
    fn shifted(self, c: f64) -> Self {
        self + c
    }
    fn scaled(self, c: f64) -> Self {
        self * c
    }
    fn sin_cos(self) -> (Self, Self) {
        math::sin_cos(self)
    }
    fn tan(self) -> Self {
        math::tan(self)
    }
    fn asin(self) -> Self {
        math::asin(self)
    }
    fn acos(self) -> Self {
        math::acos(self)
    }
    fn atan(self) -> Self {
        math::atan(self)
    }
    fn atan2(self, x: Self) -> Self {
        // Adding zero turns −0 into +0: formulas know one zero only.
        math::atan2(self + 0.0, x + 0.0)
    }
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    fn exp(self) -> Self {
        math::exp(self)
    }
    fn log(self) -> Self {
        math::log(self)
    }
    fn abs(self) -> Self {
        f64::abs(self)
    }
    fn min(self, other: Self) -> Self {
        // Unlike f64::min, lets NaN through.
        if other < self || other.is_nan() { other } else { self }
    }
    fn max(self, other: Self) -> Self {
        if other > self || other.is_nan() { other } else { self }
    }
    fn hypot(self, other: Self) -> Self {
        math::hypot(self, other)
    }
    fn powi(self, n: i32) -> Self {
        let p = power(self, n.unsigned_abs(), 1.0, |a, b| a * b);
        if n < 0 { 1.0 / p } else { p }
    }
    fn powf(self, c: f64) -> Self {
        Scalar::pow(self, c)
    }
    fn pow(self, exponent: Self) -> Self {
        // A negative base has powers at whole exponents only: no function of a variable exponent.
        if self < 0.0 { f64::NAN } else { math::pow(self + 0.0, exponent) }
    }
}

impl Field for f64 {
    fn at_most(self, other: Self) -> Option<bool> {
        Some(!(other < self || other.is_nan()))
    }
    fn hull(self, _: Self) -> Self {
        f64::NAN // never asked: numbers are always ordered
    }
    fn unknown() -> Self {
        f64::NAN
    }
    fn atan2_may_jump(self, _: Self) -> bool {
        false
    }
}
