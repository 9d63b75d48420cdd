//! The finest dyadic grid on a domain and a hash for its points.

use std::hash::{BuildHasherDefault, Hasher};

/// Domains are resolved to this many binary digits: cells of level 14 may still bisect their sides
/// ten times.
pub const GRID_BITS: u32 = 24;

/// A point of a domain on the finest dyadic grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GridPoint {
    /// a · 2^GRID_BITS.
    pub i: u32,
    /// b · 2^GRID_BITS.
    pub j: u32,
}

impl GridPoint {
    /// a and b in [0, 1].
    pub fn coordinates(&self) -> (f64, f64) {
        let unit = 1.0 / f64::from(1u32 << GRID_BITS);
        (f64::from(self.i) * unit, f64::from(self.j) * unit)
    }

    /// The one nearest to (a, b).
    pub fn nearest((a, b): (f64, f64)) -> Self {
        let to = |x: f64| (x.clamp(0.0, 1.0) * f64::from(1u32 << GRID_BITS)).round() as u32;
        Self { i: to(a), j: to(b) }
    }

    /// One number for both.
    pub fn key(&self) -> u64 {
        (u64::from(self.i) << 32) | u64::from(self.j)
    }
}

/// Multiplies grid keys by an odd constant (2⁶⁴ over the golden ratio) and folds; the map is only
/// ever asked for single keys, so its order never shows.
#[derive(Default)]
pub struct GridHash(u64);

impl Hasher for GridHash {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.write_u64(u64::from(*b));
        }
    }
    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

/// Builds hashers of grid keys.
pub type GridHasher = BuildHasherDefault<GridHash>;
