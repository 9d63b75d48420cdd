//! Triples of spectral values.

use std::ops::{Add, AddAssign, Index, Mul, Sub};

use serde::{Deserialize, Serialize};

/// A value per colour channel (linear Rec. 709 primaries): a reflectance, a radiance
/// [W/(m² sr)] or an irradiance [W/m²].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rgb(pub [f64; 3]);

impl Rgb {
    /// Nothing in any channel.
    pub const BLACK: Self = Self([0.0; 3]);
    /// One in every channel.
    pub const WHITE: Self = Self([1.0; 3]);

    /// The same value in every channel.
    pub const fn grey(value: f64) -> Self {
        Self([value; 3])
    }

    /// `.2126 R + .7152 G + .0722 B` (Rec. 709).
    pub fn luminance(&self) -> f64 {
        0.2126 * self.0[0] + 0.7152 * self.0[1] + 0.0722 * self.0[2]
    }

    /// The largest channel.
    pub fn max(&self) -> f64 {
        self.0[0].max(self.0[1]).max(self.0[2])
    }

    /// Whether every channel is zero.
    pub fn is_black(&self) -> bool {
        self.0 == [0.0; 3]
    }

    /// Whether every channel is a finite number.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|x| x.is_finite())
    }

    /// Each channel through `f`.
    pub fn map(&self, f: impl Fn(f64) -> f64) -> Self {
        Self(self.0.map(f))
    }
}

impl Add for Rgb {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] + other.0[i]))
    }
}

impl AddAssign for Rgb {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Rgb {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] - other.0[i]))
    }
}

impl Mul for Rgb {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        Self(std::array::from_fn(|i| self.0[i] * other.0[i]))
    }
}

impl Mul<f64> for Rgb {
    type Output = Self;
    fn mul(self, factor: f64) -> Self {
        self.map(|x| x * factor)
    }
}

impl Index<usize> for Rgb {
    type Output = f64;
    fn index(&self, channel: usize) -> &f64 {
        &self.0[channel]
    }
}
