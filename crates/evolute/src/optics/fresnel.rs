//! Fresnel's equations for unpolarised light at a smooth boundary: reflectance and transmittance as
//! fractions of the flux, with derivatives.
//!
//! A dielectric boundary is a rational function of the *two* cosines (Born & Wolf, Principles of
//! Optics, §1.5), so it stays smooth up to total reflection: there cos t → 0 and the transmittance
//! vanishes linearly in cos t, though as a square root in cos i. Integrate in cos t there.
//! A conductor has a complex index η + ik, relative to the medium of the light.

/// A boundary between two dielectrics, seen from the side of the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DielectricBoundary {
    /// Refractive index on the side of the light.
    pub n1: f64,
    /// Refractive index on the other side.
    pub n2: f64,
}

impl DielectricBoundary {
    /// The same boundary seen from the other side.
    pub fn reversed(&self) -> Self {
        Self { n1: self.n2, n2: self.n1 }
    }

    /// cos i at which total reflection begins; `None` where there is none (n₁ ≤ n₂).
    pub fn critical_cos(&self) -> Option<f64> {
        let sin = self.n2 / self.n1;
        (sin < 1.0).then(|| ((1.0 - sin) * (1.0 + sin)).sqrt())
    }

    /// Cosine of the angle of refraction; `None` at total reflection. For light that comes through
    /// already, `self.reversed().cos_t(cos_t)` is cos i.
    pub fn cos_t(&self, cos_i: f64) -> Option<f64> {
        let m = self.n1 / self.n2;
        let square = (1.0 - m) * (1.0 + m) + m * m * cos_i * cos_i;
        (square >= 0.0).then(|| square.sqrt())
    }

    /// d cos t / d cos i = (n₁/n₂)² cos i / cos t: infinite where total reflection begins.
    pub fn cos_t_derivative(&self, cos_i: f64, cos_t: f64) -> f64 {
        let m = self.n1 / self.n2;
        m * m * cos_i / cos_t
    }

    /// Reflected fraction α of the flux, for cosines that obey Snell's law; 1 at total reflection
    /// (`cos_t` = 0).
    pub fn reflectance(&self, cos_i: f64, cos_t: f64) -> f64 {
        let [s1, s2] = [self.n1 * cos_i, self.n2 * cos_t];
        let [p1, p2] = [self.n2 * cos_i, self.n1 * cos_t];
        let (s, p) = ((s1 - s2) / (s1 + s2), (p1 - p2) / (p1 + p2));
        0.5 * (s * s + p * p)
    }

    /// Transmitted fraction 1 − α of the flux, without cancellation; linear in cos t near 0.
    pub fn transmittance(&self, cos_i: f64, cos_t: f64) -> f64 {
        let [s1, s2] = [self.n1 * cos_i, self.n2 * cos_t];
        let [p1, p2] = [self.n2 * cos_i, self.n1 * cos_t];
        let part = |a: f64, b: f64| 2.0 * a * b / ((a + b) * (a + b));
        part(s1, s2) + part(p1, p2)
    }

    /// Partial derivatives of the transmittance with respect to cos i and cos t (those of the
    /// reflectance are their negatives). Bounded at total reflection.
    pub fn transmittance_partials(&self, cos_i: f64, cos_t: f64) -> [f64; 2] {
        let [s1, s2] = [self.n1 * cos_i, self.n2 * cos_t];
        let [p1, p2] = [self.n2 * cos_i, self.n1 * cos_t];
        // f = 2ab/(a+b)²: ∂f/∂a = 2b(b − a)/(a+b)³.
        let partial = |a: f64, b: f64| {
            let sum = a + b;
            2.0 * b * (b - a) / (sum * sum * sum)
        };
        [
            partial(s1, s2) * self.n1 + partial(p1, p2) * self.n2,
            partial(s2, s1) * self.n2 + partial(p2, p1) * self.n1,
        ]
    }

    /// Reflected and transmitted fraction at an angle of incidence; (1, 0) at total reflection.
    pub fn split(&self, cos_i: f64) -> (f64, f64) {
        match self.cos_t(cos_i) {
            Some(cos_t) if cos_i + cos_t > 0.0 => {
                (self.reflectance(cos_i, cos_t), self.transmittance(cos_i, cos_t))
            }
            _ => (1.0, 0.0),
        }
    }
}

/// A metal's complex refractive index η + ik, relative to the medium in front of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConductorIndex {
    /// Real part.
    pub eta: f64,
    /// Extinction coefficient, ≥ 0.
    pub k: f64,
}

impl ConductorIndex {
    /// Reflected fraction of the flux at an angle of incidence; the rest is absorbed.
    pub fn reflectance(&self, cos_i: f64) -> f64 {
        self.reflectance_with_derivative(cos_i).0
    }

    /// Reflected fraction and its derivative with respect to cos i.
    pub fn reflectance_with_derivative(&self, cos_i: f64) -> (f64, f64) {
        // (a + ib)² = (η + ik)² − sin² i: the normal part of the transmitted wave vector.
        let c = cos_i;
        let s2 = (1.0 - c) * (1.0 + c);
        let (eta, k) = (self.eta, self.k);
        let t = eta * eta - k * k - s2;
        let modulus = (t * t + 4.0 * eta * eta * k * k).sqrt();
        // The smaller root by division: no cancellation.
        let (a, b) = if t >= 0.0 {
            let a = (0.5 * (modulus + t)).sqrt();
            (a, if a > 0.0 { eta * k / a } else { 0.0 })
        } else {
            let b = (0.5 * (modulus - t)).sqrt();
            (eta * k / b, b)
        };
        // d(a + ib)/dc = c/(a + ib).
        let (da, db) = if modulus > 0.0 { (c * a / modulus, -c * b / modulus) } else { (0.0, 0.0) };
        // |r_s|² = ((c−a)² + b²)/((c+a)² + b²); r_p = r_s (a+ib − s²/c)/(a+ib + s²/c), with both
        // sides times c to stay finite at grazing incidence.
        let ratio = |x: [f64; 2], dx: [f64; 2], y: [f64; 2], dy: [f64; 2]| {
            let (p, q) = (x[0] * x[0] + x[1] * x[1], y[0] * y[0] + y[1] * y[1]);
            let (dp, dq) =
                (2.0 * (x[0] * dx[0] + x[1] * dx[1]), 2.0 * (y[0] * dy[0] + y[1] * dy[1]));
            if q > 0.0 { (p / q, (dp - dq * p / q) / q) } else { (1.0, 0.0) }
        };
        let (rs, drs) = ratio([c - a, b], [1.0 - da, db], [c + a, b], [1.0 + da, db]);
        let (f, df) = ratio(
            [a * c - s2, b * c],
            [da * c + a + 2.0 * c, db * c + b],
            [a * c + s2, b * c],
            [da * c + a - 2.0 * c, db * c + b],
        );
        (0.5 * rs * (1.0 + f), 0.5 * (drs * (1.0 + f) + rs * df))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles of incidence from normal to nearly grazing.
    fn cosines() -> impl Iterator<Item = f64> {
        (1..=50).map(|i| i as f64 / 50.0)
    }

    #[test]
    fn normal_incidence_and_brewster() {
        let glass = DielectricBoundary { n1: 1.0, n2: 1.5 };
        assert!((glass.split(1.0).0 - 0.04).abs() < 1e-15);
        // At Brewster's angle tan i = n₂/n₁ only the s part is reflected: α = ½ ((n²−1)/(n²+1))².
        let cos_i = 1.0 / (1.0f64 + 2.25).sqrt();
        let s = 1.25 / 3.25;
        assert!((glass.split(cos_i).0 - 0.5 * s * s).abs() < 1e-15);
    }

    #[test]
    fn flux_is_kept_and_reversible() {
        for (n1, n2) in [(1.0, 1.5), (1.5, 1.0), (1.33, 1.31), (1.0, 1.0)] {
            let boundary = DielectricBoundary { n1, n2 };
            for cos_i in cosines() {
                let (r, t) = boundary.split(cos_i);
                assert!((r + t - 1.0).abs() < 1e-14 && (0.0..=1.0).contains(&r));
                if let Some(cos_t) = boundary.cos_t(cos_i) {
                    let (back, _) = boundary.reversed().split(cos_t);
                    assert!((r - back).abs() < 1e-12, "{r} {back}");
                    assert!(
                        (boundary.reversed().cos_t(cos_t).unwrap_or(9.0) - cos_i).abs() < 1e-14
                    );
                } else {
                    assert!(cos_i < boundary.critical_cos().unwrap_or(0.0));
                    assert_eq!((r, t), (1.0, 0.0));
                }
            }
        }
        assert_eq!(DielectricBoundary { n1: 1.2, n2: 1.2 }.split(0.3), (0.0, 1.0));
    }

    #[test]
    fn total_reflection_is_reached_linearly_in_cos_t() {
        let b = DielectricBoundary { n1: 1.5, n2: 1.0 };
        let cos_i = b.critical_cos().unwrap_or(0.0);
        assert_eq!(b.reflectance(cos_i, 0.0), 1.0);
        let slope = b.transmittance_partials(cos_i, 0.0)[1];
        assert!((slope - b.transmittance(cos_i, 1e-9) / 1e-9).abs() < 1e-6 * slope);
        assert!(b.cos_t(cos_i - 1e-9).is_none() && b.cos_t(cos_i + 1e-9).is_some());
    }

    #[test]
    fn derivatives_are_those_of_the_values() {
        let h = 1e-5;
        let boundary = DielectricBoundary { n1: 1.4, n2: 1.0 };
        let gold = ConductorIndex { eta: 0.143, k: 3.98 };
        let lossless = ConductorIndex { eta: 1.6, k: 0.0 };
        for c in cosines().filter(|c| *c < 0.999) {
            let f = |x: f64, y: f64| boundary.transmittance(x, y);
            let [di, dt] = boundary.transmittance_partials(c, 0.7);
            assert!((di - (f(c + h, 0.7) - f(c - h, 0.7)) / (2.0 * h)).abs() < 1e-7);
            let [_, dt2] = boundary.transmittance_partials(0.7, c);
            assert!((dt2 - (f(0.7, c + h) - f(0.7, c - h)) / (2.0 * h)).abs() < 1e-7);
            assert!(dt.is_finite());
            for metal in [gold, lossless] {
                let d = metal.reflectance_with_derivative(c).1;
                let fd = (metal.reflectance(c + h) - metal.reflectance(c - h)) / (2.0 * h);
                assert!((d - fd).abs() < 1e-6 * d.abs().max(1.0), "{c}: {d} {fd}");
            }
            if let Some(t) = boundary.cos_t(c).filter(|t| *t > 0.1) {
                let fd = boundary.cos_t(c + h).zip(boundary.cos_t(c - h)).map(|(p, m)| p - m);
                let d = boundary.cos_t_derivative(c, t);
                assert!((d - fd.unwrap_or(0.0) / (2.0 * h)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_conductor_without_absorption_is_a_dielectric() {
        for c in cosines() {
            for eta in [1.6, 0.7] {
                let (r, _) = DielectricBoundary { n1: 1.0, n2: eta }.split(c);
                let metal = ConductorIndex { eta, k: 0.0 }.reflectance(c);
                assert!((metal - r).abs() < 1e-13, "{eta} {c}: {metal} {r}");
            }
        }
    }

    #[test]
    fn conductor_against_complex_amplitudes() {
        // r_s = (c − w)/(c + w), r_p = (N² c − w)/(N² c + w), w = √(N² − sin² i), N = η + ik.
        type C = (f64, f64);
        let div = |a: C, b: C| {
            let m = b.0 * b.0 + b.1 * b.1;
            ((a.0 * b.0 + a.1 * b.1) / m, (a.1 * b.0 - a.0 * b.1) / m)
        };
        for (eta, k) in [(0.2, 3.9), (1.44, 7.6), (2.5, 0.3)] {
            assert!(
                (ConductorIndex { eta, k }.reflectance(1.0)
                    - ((eta - 1.0) * (eta - 1.0) + k * k) / ((eta + 1.0) * (eta + 1.0) + k * k))
                    .abs()
                    < 1e-15
            );
            for c in cosines() {
                let square: C = (eta * eta - k * k, 2.0 * eta * k);
                let inner: C = (square.0 - (1.0 - c * c), square.1);
                let angle = 0.5 * crate::geometry::math::atan2(inner.1, inner.0);
                let length = (inner.0 * inner.0 + inner.1 * inner.1).sqrt().sqrt();
                let (sin, cos) = crate::geometry::math::sin_cos(angle);
                let w: C = (length * cos, length * sin);
                let rs = div((c - w.0, -w.1), (c + w.0, w.1));
                let nc: C = (square.0 * c, square.1 * c);
                let rp = div((nc.0 - w.0, nc.1 - w.1), (nc.0 + w.0, nc.1 + w.1));
                let want = 0.5 * (rs.0 * rs.0 + rs.1 * rs.1 + rp.0 * rp.0 + rp.1 * rp.1);
                let got = ConductorIndex { eta, k }.reflectance(c);
                assert!((got - want).abs() < 1e-13, "{c}: {got} {want}");
            }
        }
        assert!((ConductorIndex { eta: 0.2, k: 3.9 }.reflectance(0.0) - 1.0).abs() < 1e-15);
    }
}
