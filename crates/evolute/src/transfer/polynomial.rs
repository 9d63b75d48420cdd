//! Bicubic Bernstein polynomials over a unit cell, built from corner values and gradients.
//!
//! Sides are cubic Hermite, the inside is their Coons blend: twelve data, O(h⁴) for a smooth
//! function on a cell of side h. Coefficients bound the polynomial from both sides.

use crate::optics::Dual;

/// Coefficients `c[4 i + j]` of the Bernstein products `B³_i(a) B³_j(b)` over the unit cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch(pub [f64; 16]);

impl Patch {
    /// The polynomial with the given values and gradients at the corners (0,0), (1,0), (0,1), (1,1);
    /// gradients per unit of the coordinates in which the cell has sides `ha`, `hb`.
    pub fn hermite(corners: &[Dual; 4], ha: f64, hb: f64) -> Self {
        const THIRD: f64 = 1.0 / 3.0;
        let [p, q, r, s] = corners;
        let side =
            |x: &Dual, y: &Dual, dx: f64, dy: f64| [x.v, x.v + dx * THIRD, y.v - dy * THIRD, y.v];
        let low = side(p, q, p.a * ha, q.a * ha);
        let high = side(r, s, r.a * ha, s.a * ha);
        let left = side(p, r, p.b * hb, r.b * hb);
        let right = side(q, s, q.b * hb, s.b * hb);
        let mut c = [0.0; 16];
        for i in 0..4 {
            let a = i as f64 * THIRD;
            for j in 0..4 {
                let b = j as f64 * THIRD;
                let blend =
                    (1.0 - a) * ((1.0 - b) * p.v + b * r.v) + a * ((1.0 - b) * q.v + b * s.v);
                c[4 * i + j] =
                    (1.0 - b) * low[i] + b * high[i] + (1.0 - a) * left[j] + a * right[j] - blend;
            }
        }
        Self(c)
    }

    /// The polynomial with the given coefficients c(i, j).
    pub fn tensor(c: impl Fn(usize, usize) -> f64) -> Self {
        Self(std::array::from_fn(|k| c(k / 4, k % 4)))
    }

    /// Adds `height` times the bump 16 a(1−a) b(1−b), which is one at the centre and zero on the sides.
    pub fn add_bump(&mut self, height: f64) {
        // a(1−a) has the cubic coefficients (0, 1/3, 1/3, 0).
        let h = height * 16.0 / 9.0;
        for k in [5, 6, 9, 10] {
            self.0[k] += h;
        }
    }

    /// Adds a constant.
    pub fn shifted(&self, by: f64) -> Self {
        Self(self.0.map(|c| c + by))
    }

    /// A lower and an upper bound over the cell.
    pub fn bounds(&self) -> (f64, f64) {
        self.0.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &c| (l.min(c), h.max(c)))
    }

    /// The integral over the unit cell.
    pub fn integral(&self) -> f64 {
        self.0.iter().sum::<f64>() / 16.0
    }

    /// The value at (a, b).
    pub fn value(&self, a: f64, b: f64) -> f64 {
        let row = self.at_a(a);
        cubic(&row, b)
    }

    /// The cubic in b at fixed a, by Bernstein coefficients.
    pub fn at_a(&self, a: f64) -> [f64; 4] {
        let w = weights(a);
        std::array::from_fn(|j| {
            w[0] * self.0[j] + w[1] * self.0[4 + j] + w[2] * self.0[8 + j] + w[3] * self.0[12 + j]
        })
    }

    /// Value and gradient at the centre, per side of the cell.
    pub fn centre(&self) -> Dual {
        let row = self.at_a(0.5);
        let w = [0.125, 0.375, 0.375, 0.125];
        let da: [f64; 4] = std::array::from_fn(|j| {
            0.75 * (self.0[12 + j] + self.0[8 + j] - self.0[4 + j] - self.0[j])
        });
        Dual {
            v: (0..4).map(|j| w[j] * row[j]).sum(),
            a: (0..4).map(|j| w[j] * da[j]).sum(),
            b: 0.75 * (row[3] + row[2] - row[1] - row[0]),
        }
    }

    /// Exchanges a and b.
    pub fn transposed(&self) -> Self {
        Self(std::array::from_fn(|k| self.0[4 * (k % 4) + k / 4]))
    }

    /// Halves of the cell along a, each on its own unit cell.
    pub fn split_a(&self) -> (Self, Self) {
        let (mut l, mut r) = (*self, *self);
        for j in 0..4 {
            let c = [self.0[j], self.0[4 + j], self.0[8 + j], self.0[12 + j]];
            let (p, q) = halves(&c);
            for i in 0..4 {
                l.0[4 * i + j] = p[i];
                r.0[4 * i + j] = q[i];
            }
        }
        (l, r)
    }

    /// Halves of the cell along b, each on its own unit cell.
    pub fn split_b(&self) -> (Self, Self) {
        let (mut l, mut r) = (*self, *self);
        for i in 0..4 {
            let c = [self.0[4 * i], self.0[4 * i + 1], self.0[4 * i + 2], self.0[4 * i + 3]];
            let (p, q) = halves(&c);
            l.0[4 * i..4 * i + 4].copy_from_slice(&p);
            r.0[4 * i..4 * i + 4].copy_from_slice(&q);
        }
        (l, r)
    }

    /// Largest distance of a coefficient from the plane `c + ga (a − ½) + gb (b − ½)` through the
    /// mean of the corners, and that plane.
    pub fn plane(&self) -> (f64, [f64; 3]) {
        let [p, r, q, s] = [self.0[0], self.0[3], self.0[12], self.0[15]];
        let (c, ga, gb) = (0.25 * (p + q + r + s), 0.5 * (q + s - p - r), 0.5 * (r + s - p - q));
        let mut off = 0f64;
        for i in 0..4 {
            for j in 0..4 {
                let flat = c + ga * (i as f64 / 3.0 - 0.5) + gb * (j as f64 / 3.0 - 0.5);
                off = off.max((self.0[4 * i + j] - flat).abs());
            }
        }
        (off, [c, ga, gb])
    }

    /// +1 or −1 if the polynomial provably rises or falls along b everywhere in the cell, nowhere
    /// slower than `evenness` times its fastest; else 0.
    pub fn trend_b(&self, evenness: f64) -> i32 {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..4 {
            for j in 0..3 {
                let step = self.0[4 * i + j + 1] - self.0[4 * i + j];
                low = low.min(step);
                high = high.max(step);
            }
        }
        if low > evenness * high {
            1
        } else if high < evenness * low {
            -1
        } else {
            0
        }
    }
}

/// The four cubic Bernstein polynomials at t.
pub fn weights(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
}

/// Value of a cubic in Bernstein form.
pub fn cubic(c: &[f64; 4], t: f64) -> f64 {
    let w = weights(t);
    w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3]
}

/// Derivative of a cubic in Bernstein form.
pub fn cubic_derivative(c: &[f64; 4], t: f64) -> f64 {
    let s = 1.0 - t;
    3.0 * (s * s * (c[1] - c[0]) + 2.0 * s * t * (c[2] - c[1]) + t * t * (c[3] - c[2]))
}

/// Integral of a cubic in Bernstein form over [0, t].
pub fn cubic_integral(c: &[f64; 4], t: f64) -> f64 {
    // Coefficients of the quartic antiderivative are running sums of quarters.
    let k = [
        0.25 * c[0],
        0.25 * (c[0] + c[1]),
        0.25 * (c[0] + c[1] + c[2]),
        0.25 * (c[0] + c[1] + c[2] + c[3]),
    ];
    let s = 1.0 - t;
    t * (4.0 * s * s * s * k[0] + t * (6.0 * s * s * k[1] + t * (4.0 * s * k[2] + t * k[3])))
}

/// The two halves of a cubic by de Casteljau.
fn halves(c: &[f64; 4]) -> ([f64; 4], [f64; 4]) {
    let p = [0.5 * (c[0] + c[1]), 0.5 * (c[1] + c[2]), 0.5 * (c[2] + c[3])];
    let q = [0.5 * (p[0] + p[1]), 0.5 * (p[1] + p[2])];
    let m = 0.5 * (q[0] + q[1]);
    ([c[0], p[0], q[0], m], [m, q[1], p[2], c[3]])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The blend reproduces its twelve-dimensional space: cubics and a³b, ab³.
    #[test]
    fn reproduces_cubics() {
        let f = |a: f64, b: f64| {
            Dual::new(
                1.0 + 2.0 * a - b + a * b * b - 0.5 * a * a * a + a * a * a * b,
                2.0 + b * b - 1.5 * a * a + 3.0 * a * a * b,
                -1.0 + 2.0 * a * b + a * a * a,
            )
        };
        let (a0, b0, h) = (0.3, -0.2, 0.7);
        let p = Patch::hermite(&[f(a0, b0), f(a0 + h, b0), f(a0, b0 + h), f(a0 + h, b0 + h)], h, h);
        for (a, b) in [(0.1, 0.9), (0.5, 0.5), (0.33, 0.2)] {
            assert!((p.value(a, b) - f(a0 + a * h, b0 + b * h).v).abs() < 1e-14);
        }
        let c = p.centre();
        let t = f(a0 + 0.5 * h, b0 + 0.5 * h);
        assert!((c.v - t.v).abs() + (c.a - h * t.a).abs() + (c.b - h * t.b).abs() < 1e-14);
        let (l, r) = p.split_a();
        assert!((l.value(0.5, 0.3) - p.value(0.25, 0.3)).abs() < 1e-14);
        assert!((r.split_b().1.value(0.5, 0.5) - p.value(0.75, 0.75)).abs() < 1e-14);
        assert!((p.transposed().value(0.2, 0.7) - p.value(0.7, 0.2)).abs() < 1e-14);
    }

    #[test]
    fn antiderivative() {
        let c = [0.3, -1.0, 2.0, 0.7];
        let n = 1000;
        let sum: f64 = (0..n).map(|i| cubic(&c, 0.37 * (i as f64 + 0.5) / n as f64)).sum();
        assert!((cubic_integral(&c, 0.37) - 0.37 * sum / n as f64).abs() < 1e-7);
    }
}
