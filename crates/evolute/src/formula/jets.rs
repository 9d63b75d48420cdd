//! Values with their derivatives by two variables: forward differentiation.
//!
//! Over intervals a derivative contains the derivatives at all points of the box, and is unbounded
//! where the function may have a kink or a jump inside it; at a kink on the border it is one-sided.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::scalar::{Field, Scalar};

/// Value and gradient by (s, t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet1<T> {
    /// Value.
    pub v: T,
    /// ∂/∂s, ∂/∂t.
    pub g: [T; 2],
}

/// Value, gradient and second derivatives by (s, t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jet2<T> {
    /// Value.
    pub v: T,
    /// ∂/∂s, ∂/∂t.
    pub g: [T; 2],
    /// ∂²/∂s², ∂²/∂s∂t, ∂²/∂t².
    pub h: [T; 3],
}

impl<T: Field> Jet1<T> {
    /// The variables (s, t) themselves.
    pub fn variables(s: T, t: T) -> [Self; 2] {
        let (one, zero) = (T::constant(1.0), T::constant(0.0));
        [Self { v: s, g: [one, zero] }, Self { v: t, g: [zero, one] }]
    }

    /// Each part through a linear map.
    fn linear(self, f: impl Fn(T) -> T) -> Self {
        Self { v: f(self.v), g: self.g.map(&f) }
    }

    fn linear2(self, o: Self, f: impl Fn(T, T) -> T) -> Self {
        Self { v: f(self.v, o.v), g: std::array::from_fn(|i| f(self.g[i], o.g[i])) }
    }

    /// `f(self)`, given f, f' and f''.
    fn chain(self, f: T, f1: T, _: impl FnOnce() -> T) -> Self {
        Self { v: f, g: self.g.map(|g| f1 * g) }
    }

    /// `f(self, o)`, given f, its gradient and (f_aa, f_ab, f_bb).
    fn chain2(self, o: Self, f: T, [fa, fb]: [T; 2], _: impl FnOnce() -> [T; 3]) -> Self {
        Self { v: f, g: std::array::from_fn(|i| fa * self.g[i] + fb * o.g[i]) }
    }

    fn product(self, o: Self) -> Self {
        Self { v: self.v * o.v, g: std::array::from_fn(|i| self.g[i] * o.v + self.v * o.g[i]) }
    }

    fn quotient(self, o: Self) -> Self {
        let q = self.v / o.v;
        Self { v: q, g: std::array::from_fn(|i| (self.g[i] - q * o.g[i]) / o.v) }
    }

    /// Either of two, one does not know which; their derivatives may jump.
    fn either(self, o: Self, v: T) -> Self {
        Self { v, g: std::array::from_fn(|i| self.g[i].hull(o.g[i])) }
    }

    fn without_derivatives(v: T) -> Self {
        Self { v, g: [T::unknown(); 2] }
    }

    fn still(v: T) -> Self {
        Self { v, g: [T::constant(0.0); 2] }
    }
}

impl<T: Field> Jet2<T> {
    /// The variables (s, t) themselves.
    pub fn variables(s: T, t: T) -> [Self; 2] {
        let (one, zero) = (T::constant(1.0), T::constant(0.0));
        [Self { v: s, g: [one, zero], h: [zero; 3] }, Self { v: t, g: [zero, one], h: [zero; 3] }]
    }

    fn linear(self, f: impl Fn(T) -> T) -> Self {
        Self { v: f(self.v), g: self.g.map(&f), h: self.h.map(&f) }
    }

    fn linear2(self, o: Self, f: impl Fn(T, T) -> T) -> Self {
        Self {
            v: f(self.v, o.v),
            g: std::array::from_fn(|i| f(self.g[i], o.g[i])),
            h: std::array::from_fn(|i| f(self.h[i], o.h[i])),
        }
    }

    fn chain(self, f: T, f1: T, f2: impl FnOnce() -> T) -> Self {
        let [a, b] = self.g;
        let f2 = f2();
        Self {
            v: f,
            g: [f1 * a, f1 * b],
            h: [
                f1 * self.h[0] + f2 * a.powi(2),
                f1 * self.h[1] + f2 * (a * b),
                f1 * self.h[2] + f2 * b.powi(2),
            ],
        }
    }

    fn chain2(self, o: Self, f: T, [fa, fb]: [T; 2], second: impl FnOnce() -> [T; 3]) -> Self {
        let [aa, ab, bb] = second();
        let (p, q) = (self.g, o.g);
        let h = |k: usize, i: usize, j: usize| {
            fa * self.h[k]
                + fb * o.h[k]
                + aa * (p[i] * p[j])
                + ab * (p[i] * q[j] + p[j] * q[i])
                + bb * (q[i] * q[j])
        };
        Self {
            v: f,
            g: std::array::from_fn(|i| fa * p[i] + fb * q[i]),
            h: [h(0, 0, 0), h(1, 0, 1), h(2, 1, 1)],
        }
    }

    fn product(self, o: Self) -> Self {
        let (p, q) = (self.g, o.g);
        let h = |k: usize| self.h[k] * o.v + self.v * o.h[k];
        Self {
            v: self.v * o.v,
            g: std::array::from_fn(|i| p[i] * o.v + self.v * q[i]),
            h: [
                h(0) + (p[0] * q[0]).scaled(2.0),
                h(1) + (p[0] * q[1] + p[1] * q[0]),
                h(2) + (p[1] * q[1]).scaled(2.0),
            ],
        }
    }

    fn quotient(self, o: Self) -> Self {
        let q = self.v / o.v;
        let g: [T; 2] = std::array::from_fn(|i| (self.g[i] - q * o.g[i]) / o.v);
        let h = |k: usize, i: usize, j: usize| {
            (self.h[k] - q * o.h[k] - (g[i] * o.g[j] + g[j] * o.g[i])) / o.v
        };
        Self { v: q, g, h: [h(0, 0, 0), h(1, 0, 1), h(2, 1, 1)] }
    }

    fn either(self, o: Self, v: T) -> Self {
        let g = std::array::from_fn(|i| self.g[i].hull(o.g[i]));
        Self { v, g, h: [T::unknown(); 3] }
    }

    fn without_derivatives(v: T) -> Self {
        Self { v, g: [T::unknown(); 2], h: [T::unknown(); 3] }
    }

    fn still(v: T) -> Self {
        Self { v, g: [T::constant(0.0); 2], h: [T::constant(0.0); 3] }
    }
}

macro_rules! jet_arithmetic {
    ($jet:ident) => {
        impl<T: Field> Add for $jet<T> {
            type Output = Self;
            fn add(self, o: Self) -> Self {
                self.linear2(o, |a, b| a + b)
            }
        }

        impl<T: Field> Sub for $jet<T> {
            type Output = Self;
            fn sub(self, o: Self) -> Self {
                self.linear2(o, |a, b| a - b)
            }
        }

        impl<T: Field> Neg for $jet<T> {
            type Output = Self;
            fn neg(self) -> Self {
                self.linear(|a| -a)
            }
        }

        impl<T: Field> Mul for $jet<T> {
            type Output = Self;
            fn mul(self, o: Self) -> Self {
                self.product(o)
            }
        }

        impl<T: Field> Div for $jet<T> {
            type Output = Self;
            fn div(self, o: Self) -> Self {
                self.quotient(o)
            }
        }

        impl<T: Field> Scalar for $jet<T> {
            fn constant(value: f64) -> Self {
                Self::still(T::constant(value))
            }
            fn shifted(self, c: f64) -> Self {
                Self { v: self.v.shifted(c), ..self }
            }
            fn scaled(self, c: f64) -> Self {
                self.linear(|a| a.scaled(c))
            }
            fn sin_cos(self) -> (Self, Self) {
                let (s, c) = self.v.sin_cos();
                (self.chain(s, c, || -s), self.chain(c, -s, || -c))
            }
            fn tan(self) -> Self {
                let t = self.v.tan();
                let d = t.powi(2).shifted(1.0);
                self.chain(t, d, || (t * d).scaled(2.0))
            }
            fn asin(self) -> Self {
                let d = one_over_root(self.v);
                self.chain(self.v.asin(), d, || self.v * d.powi(3))
            }
            fn acos(self) -> Self {
                let d = one_over_root(self.v);
                self.chain(self.v.acos(), -d, || -(self.v * d.powi(3)))
            }
            fn atan(self) -> Self {
                let d = T::constant(1.0) / self.v.powi(2).shifted(1.0);
                self.chain(self.v.atan(), d, || (self.v * d.powi(2)).scaled(-2.0))
            }
            fn atan2(self, x: Self) -> Self {
                let y = self;
                let v = y.v.atan2(x.v);
                if y.v.atan2_may_jump(x.v) {
                    return Self::without_derivatives(v);
                }
                let r2 = x.v.powi(2) + y.v.powi(2);
                let (p, q) = (x.v / r2, y.v / r2);
                y.chain2(x, v, [p, -q], || {
                    let pq = (p * q).scaled(2.0);
                    [-pq, q.powi(2) - p.powi(2), pq]
                })
            }
            fn sqrt(self) -> Self {
                let r = self.v.sqrt();
                let d = T::constant(0.5) / r;
                self.chain(r, d, || -(d / self.v.max(T::constant(0.0))).scaled(0.5))
            }
            fn exp(self) -> Self {
                let e = self.v.exp();
                self.chain(e, e, || e)
            }
            fn log(self) -> Self {
                let d = T::constant(1.0) / self.v.max(T::constant(0.0));
                self.chain(self.v.log(), d, || -d.powi(2))
            }
            fn abs(self) -> Self {
                match T::constant(0.0).at_most(self.v) {
                    Some(true) => self,
                    Some(false) => -self,
                    None => self.either(-self, self.v.abs()),
                }
            }
            fn min(self, o: Self) -> Self {
                match self.v.at_most(o.v) {
                    Some(true) => self,
                    Some(false) => o,
                    None => self.either(o, self.v.min(o.v)),
                }
            }
            fn max(self, o: Self) -> Self {
                match o.v.at_most(self.v) {
                    Some(true) => self,
                    Some(false) => o,
                    None => self.either(o, self.v.max(o.v)),
                }
            }
            fn hypot(self, o: Self) -> Self {
                let r = self.v.hypot(o.v);
                let (a, b) = (unit(self.v / r), unit(o.v / r));
                self.chain2(o, r, [a, b], || [b.powi(2) / r, -(a * b) / r, a.powi(2) / r])
            }
            fn powi(self, n: i32) -> Self {
                let (m, x) = (f64::from(n), self.v);
                match n {
                    0 => Self::constant(1.0),
                    1 => self,
                    2 => self.chain(x.powi(2), x.scaled(2.0), || T::constant(2.0)),
                    _ => {
                        let first = x.powi(n.saturating_sub(1)).scaled(m);
                        self.chain(x.powi(n), first, || {
                            x.powi(n.saturating_sub(2)).scaled(m * (m - 1.0))
                        })
                    }
                }
            }
            fn powf(self, c: f64) -> Self {
                let x = self.v;
                self.chain(x.powf(c), x.powf(c - 1.0).scaled(c), || {
                    x.powf(c - 2.0).scaled(c * (c - 1.0))
                })
            }
            fn pow(self, e: Self) -> Self {
                let (x, y) = (self.v, e.v);
                let (f, l) = (x.pow(y), x.log());
                let (below, below2) = (x.pow(y.shifted(-1.0)), x.pow(y.shifted(-2.0)));
                self.chain2(e, f, [y * below, f * l], || {
                    [y * y.shifted(-1.0) * below2, below * (y * l).shifted(1.0), f * l.powi(2)]
                })
            }
        }
    };
}

jet_arithmetic!(Jet1);
jet_arithmetic!(Jet2);

/// `1/√(1 − x²)`, with the factors apart for accuracy near ±1.
fn one_over_root<T: Field>(x: T) -> T {
    let (a, b) = (x.shifted(1.0), (-x).shifted(1.0));
    let zero = T::constant(0.0);
    T::constant(1.0) / (a.max(zero) * b.max(zero)).sqrt()
}

/// A quotient known to lie in [−1, 1].
fn unit<T: Field>(x: T) -> T {
    x.max(T::constant(-1.0)).min(T::constant(1.0))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use num_dual::{DualNum, hessian};

    use super::*;
    use crate::formula::{Formula, Interval, Tape};

    /// A formula and the same thing written for the oracle.
    macro_rules! cases {
        ($check:ident: $($text:literal, |$s:ident, $t:ident| $body:expr;)*) => {
            $($check($text, |v| {
                let ($s, $t) = (v[0].clone(), v[1].clone());
                $body
            });)*
        };
    }

    type Dual = num_dual::Dual2DVec64;

    fn check(text: &str, oracle: impl Fn(nalgebra::DVector<Dual>) -> Dual) {
        let tape = Tape::compile(&[Formula::parse(text, &["s", "t"], &[]).unwrap()]).unwrap();
        for i in 0..200 {
            // A lattice of low discrepancy in [−1, 1]².
            let (s, t) =
                ((0.7548776662 * f64::from(i)).fract(), (0.5698402910 * f64::from(i)).fract());
            let (s, t) = (2.0 * s - 1.0 + 1e-3, 2.0 * t - 1.0 + 2e-3);
            let (v, g, h) = hessian(&oracle, &nalgebra::DVector::from_vec(vec![s, t]));
            let [j] = tape.evaluate::<Jet2<f64>, 1>(&Jet2::variables(s, t));
            let expected = [v, g[0], g[1], h[(0, 0)], h[(0, 1)], h[(1, 1)]];
            let got = [j.v, j.g[0], j.g[1], j.h[0], j.h[1], j.h[2]];
            for (a, b) in got.iter().zip(&expected) {
                let near = (a - b).abs() <= 1e-11 * (1.0 + a.abs().max(b.abs()));
                assert!(
                    near || (a.is_nan() && b.is_nan()),
                    "{text} at {s}, {t}: {got:?} {expected:?}"
                );
            }
        }
    }

    #[test]
    fn derivatives_agree_with_an_independent_crate() {
        cases! { check:
            "-5*cos(3*pi*(s-0.5))*cos(3*pi*(t-0.5))", |s, t| {
                let w = 3.0 * std::f64::consts::PI;
                ((s - 0.5) * w).cos() * ((t - 0.5) * w).cos() * -5.0
            };
            "s^3*t - t/(2+s)", |s, t| s.powi(3) * t.clone() - t / (s + 2.0);
            "sqrt(2+s*t)", |s, t| (s * t + 2.0).sqrt();
            "exp(s-t)*log(3+s)", |s, t| (s.clone() - t).exp() * (s + 3.0).ln();
            "tan(s/2)+atan(s*t)", |s, t| (s.clone() / 2.0).tan() + (s * t).atan();
            "asin(s*t/2)-acos(t/1.5)", |s, t| (s * t.clone() / 2.0).asin() - (t / 1.5).acos();
            "atan2(s, t+2)", |s, t| s.atan2(t + 2.0);
            "hypot(s-2, t)", |s, t| {
                let x: Dual = s - 2.0;
                (x.clone() * x + t.clone() * t).sqrt()
            };
            "(2+s)^(t/2)", |s, t| ((s + 2.0).ln() * (t / 2.0)).exp();
            "(2+s*t)^1.7+(3+t)^-2", |s, t| (s * t.clone() + 2.0).powf(1.7) + (t + 3.0).powi(-2);
            "(s+t)^5", |s, t| (s + t).powi(5);
            "2^(s*t)", |s, t| (s * t * 2f64.ln()).exp();
        }
    }

    #[test]
    fn kinks_have_one_side_each() {
        let jet = |text: &str, s: f64| {
            let tape = Tape::compile(&[Formula::parse(text, &["s", "t"], &[]).unwrap()]).unwrap();
            tape.evaluate::<Jet2<f64>, 1>(&Jet2::variables(s, 0.0))[0]
        };
        assert_eq!(jet("abs(s)^3", -2.0).g[0], -12.0);
        assert_eq!(jet("min(s, s^2)", 0.5).h[0], 2.0);
        assert_eq!(jet("max(s, s^2)", 0.5).g[0], 1.0);
    }

    /// A random formula of the variables, defined or not.
    fn random_formula(next: &mut impl FnMut() -> u32, depth: u32) -> String {
        if depth == 0 {
            return match next() % 4 {
                0 => "s".into(),
                1 => "t".into(),
                _ => format!("({})", f64::from(next() % 41) / 10.0 - 2.0),
            };
        }
        let mut sub = || random_formula(next, depth - 1);
        let (a, b) = (sub(), sub());
        match next() % 20 {
            0 | 1 => format!("({a}+{b})"),
            2 => format!("({a}-{b})"),
            3 | 4 => format!("({a}*{b})"),
            5 => format!("({a}/{b})"),
            6 => format!("({a})^{}", next() % 7),
            7 => format!("sin({a})"),
            8 => format!("cos({a})"),
            9 => format!("atan({a})"),
            10 => format!("atan2({a},{b})"),
            11 => format!("sqrt({a})"),
            12 => format!("exp({a})"),
            13 => format!("log({a})"),
            14 => format!("abs({a})"),
            15 => format!("min({a},{b})"),
            16 => format!("hypot({a},{b})"),
            17 => format!("asin({a})"),
            18 => format!("abs({a})^1.5"),
            _ => format!("tan({a})"),
        }
    }

    /// Boxes of random formulas contain values and derivatives at random points in them.
    #[test]
    fn intervals_contain_the_jets_of_their_points() {
        let mut state = 12_345u64;
        let mut next = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as u32
        };
        let (mut compared, mut bounded) = (0, 0);
        for k in 0..20_000 {
            let text = random_formula(&mut next, 1 + k % 4);
            let tape = Tape::compile(&[Formula::parse(&text, &["s", "t"], &[]).unwrap()]).unwrap();
            let mut unit = || f64::from(next()) / f64::from(1u32 << 31);
            let width = [0.5, 0.05, 0.001][k as usize % 3];
            let (s0, t0) = (2.0 * unit() - 1.0, 2.0 * unit() - 1.0);
            let side = |x: f64| Interval { lo: x, hi: x + width };
            let [b] = tape.evaluate::<Jet2<Interval>, 1>(&Jet2::variables(side(s0), side(t0)));
            let finite = tape.is_finite_on(&[side(s0), side(t0)]);
            for _ in 0..5 {
                let (s, t) = (s0 + width * unit(), t0 + width * unit());
                let [j] = tape.evaluate::<Jet2<f64>, 1>(&Jet2::variables(s, t));
                assert!(!finite || j.v.is_finite(), "{text} at {s}, {t}");
                let parts = [(b.v, j.v), (b.g[0], j.g[0]), (b.g[1], j.g[1])];
                let second = [(b.h[0], j.h[0]), (b.h[1], j.h[1]), (b.h[2], j.h[2])];
                for (n, (i, x)) in parts.into_iter().chain(second).enumerate() {
                    if !x.is_finite() {
                        continue;
                    }
                    compared += 1;
                    bounded += usize::from(i.is_bounded());
                    assert!(i.contains(x), "{text} at {s}, {t}: part {n}, {i:?} lacks {x}");
                }
            }
        }
        assert!(compared > 300_000 && bounded > compared / 2, "{compared} {bounded}");
    }
}
