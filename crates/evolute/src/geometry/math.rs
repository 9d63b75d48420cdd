//! Elementary functions that give the same bits on every machine (the `libm` crate), in one place.
//!
//! `sqrt`, `abs`, `floor`, `min`, `max` of the standard library are exact by IEEE 754 and may be
//! used directly; `sin`, `exp`, `powf` and their like may not.

pub use libm::{acos, asin, atan, atan2, cbrt, cos, exp, hypot, log, pow, sin, tan};

/// Sine and cosine of `x` [rad].
pub fn sin_cos(x: f64) -> (f64, f64) {
    libm::sincos(x)
}
