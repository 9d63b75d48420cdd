//! Random numbers that are the same everywhere, and random motions.

use evolute::geometry::{Point3, Transform, Vector3};

/// SplitMix64 (Steele, Lea & Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    pub fn direction(&mut self) -> Vector3 {
        loop {
            let v = Vector3::from_fn(|_, _| self.between(-1.0, 1.0));
            if v.norm_squared() > 1e-4 && v.norm_squared() <= 1.0 {
                return v.normalize();
            }
        }
    }
    pub fn point(&mut self, size: f64) -> Point3 {
        Point3::from(Vector3::from_fn(|_, _| self.between(-size, size)))
    }
}

/// A random motion with a scale, in a cube of half side `spread`.
pub fn motion(r: &mut Random, spread: f64, stretch: Vector3) -> Transform {
    let turn = Transform::rotation(r.direction(), r.between(0.0, 6.0)).unwrap();
    Transform::translation(r.point(spread).coords)
        .after(&turn)
        .after(&Transform::scaling(stretch).unwrap())
}
