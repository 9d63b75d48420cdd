//! The roots of a ray and a surface of which nothing is known but positions: cells of parameters are
//! halved as long as the samples in them, widened by their own sagging, surround the ray. Where that
//! ends without a decision the ray is nearly tangent; its least height over the surface decides
//! (`tangency`).

use super::Root;
use evolute::geometry::{Point3, Ray, Vector3, tangent_frame};

/// A smooth map from [0, 1]², or its lower left triangle.
pub struct Chart<F: Fn(f64, f64) -> Point3> {
    pub at: F,
    /// Whether p + q ≤ 1 in the domain.
    pub triangle: bool,
    /// Of the surface [m].
    pub size: f64,
    /// Size of its coordinates [m].
    pub reach: f64,
}

/// A cell of parameters: centre and half sides.
pub type Cell = ([f64; 2], [f64; 2]);

/// What is to be done with a cell.
enum Verdict {
    Done,
    /// Halved across this parameter.
    Halve(usize),
    /// Within rounding of the ray all over, at this τ [m].
    Open(f64),
}

/// A ray with a unit direction, and two axes across it.
pub(super) struct Sight<'c, F: Fn(f64, f64) -> Point3> {
    pub chart: &'c Chart<F>,
    pub origin: Point3,
    pub w: Vector3,
    /// Eight roundings of the coordinates: what positions relative to the ray are known to [m].
    pub noise: f64,
}

impl<F: Fn(f64, f64) -> Point3> Chart<F> {
    /// Adds all roots (t of either sign) in a cell.
    pub fn search(&self, ray: &Ray, cell: Cell, roots: &mut Vec<Root>) {
        let speed = ray.direction.norm();
        let sight = Sight {
            chart: self,
            origin: ray.origin,
            w: ray.direction / speed,
            noise: 8.0 * f64::EPSILON * (self.reach + ray.origin.coords.amax()),
        };
        let before = roots.len();
        let mut open: Vec<(Cell, f64)> = vec![];
        let mut waiting = vec![cell];
        while let Some((c, h)) = waiting.pop() {
            match sight.look((c, h), roots) {
                Verdict::Done => {}
                Verdict::Open(along) => open.push(((c, h), along)),
                Verdict::Halve(axis) => {
                    for sign in [-0.5, 0.5] {
                        let (mut c, mut g) = (c, h);
                        c[axis] += sign * h[axis];
                        g[axis] *= 0.5;
                        waiting.push((c, g));
                    }
                }
            }
        }
        // Cells next to each other share one tangency.
        let mut settled: Vec<f64> = vec![];
        for (cell, along) in open {
            if settled.iter().all(|s| (s - along).abs() > 1e-6 * self.size) {
                settled.push(along);
                sight.settle(cell, along, roots);
            }
        }
        for root in &mut roots[before..] {
            root.t /= speed;
        }
    }
}

impl<F: Fn(f64, f64) -> Point3> Sight<'_, F> {
    /// Relative to the ray's origin.
    pub fn at(&self, p: f64, q: f64) -> Vector3 {
        (self.chart.at)(p, q) - self.origin
    }

    /// Two axes across the ray, the first near the normal `n`: a grazing ray is told apart best there.
    pub fn axes(&self, n: &Vector3) -> [Vector3; 2] {
        let a = (n - self.w * n.dot(&self.w)).try_normalize(1e-9 * n.norm());
        let a = a.unwrap_or_else(|| tangent_frame(&nalgebra::Unit::new_unchecked(self.w)).0);
        [a, self.w.cross(&a)]
    }

    /// Decides a cell. Roots get τ [m] for t.
    fn look(&self, (c, h): Cell, roots: &mut Vec<Root>) -> Verdict {
        let size = self.chart.size;
        if self.chart.triangle && c[0] - h[0] + c[1] - h[1] > 1.0 {
            return Verdict::Done;
        }
        // Centres and half sides are binary fractions: never beyond the domain, where formulas need
        // not be defined.
        let x: [Vector3; 9] = std::array::from_fn(|k| {
            let (i, j) = ((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0);
            self.at(c[0] + h[0] * i, c[1] + h[1] * j)
        });
        let [xp, xq] = [(x[5] - x[3]) * 0.5, (x[7] - x[1]) * 0.5];
        let f = self.axes(&xp.cross(&xq)).map(|across| x.map(|r| across.dot(&r)));
        let mut bend = [0f64; 2];
        for (f, bend) in f.iter().zip(&mut bend) {
            *bend = sagging(f);
            let lo = f.iter().copied().fold(f64::INFINITY, f64::min);
            let hi = f.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            if lo > *bend + self.noise || hi < -*bend - self.noise {
                return Verdict::Done;
            }
        }
        let length = |i: usize, j: usize| (x[i] - x[j]).norm();
        let sides = [length(3, 4) + length(4, 5), length(1, 4) + length(4, 7)];
        let halve = Verdict::Halve(usize::from(sides[1] > sides[0]));
        let flat = bend[0].max(bend[1]) <= self.noise || sides[0].max(sides[1]) < 1e-13 * size;
        // A plane piece of the surface is solved by Cramer's rule, from the samples: first parameter,
        // second, and how far off both may be for the sagging (once for each parameter, once for
        // both) and rounding.
        let [p, q] = f.map(|f| [f[4], 0.5 * (f[5] - f[3]), 0.5 * (f[7] - f[1])]);
        let det = p[1] * q[2] - p[2] * q[1];
        let u = [(p[2] * q[0] - p[0] * q[2]) / det, (p[0] * q[1] - p[1] * q[0]) / det];
        let [dp, dq] = bend.map(|b| 3.0 * b + self.noise);
        let e = [2, 1].map(|k: usize| (q[k].abs() * dp + p[k].abs() * dq) / det.abs());
        let along = x.map(|r| self.w.dot(&r));
        let doubt = 0.5 * (e[0] * sides[0] + e[1] * sides[1]) + 3.0 * sagging(&along);
        // Its place in the cell is known to a tenth, and itself to 1e-9 of the surface.
        let known = e[0] < 0.1 && e[1] < 0.1;
        if !(flat || known && doubt < 1e-9 * size) {
            return halve;
        }
        if !known {
            return Verdict::Open(x[4].dot(&self.w));
        }
        if (0..2).any(|k| u[k].abs() > 1.0 + e[k]) {
            return Verdict::Done;
        }
        // Beyond the border of the domain is beyond the surface.
        let place = [0, 1].map(|k| c[k] + h[k] * u[k]);
        match self.chart.within(place, [0, 1].map(|k| h[k] * e[k])) {
            Some(false) => return Verdict::Done,
            None if !flat => return halve,
            within => {
                let along = (x[4] + xp * u[0] + xq * u[1]).dot(&self.w);
                roots.push(Root { t: along, doubt, certain: within.is_some() });
            }
        }
        Verdict::Done
    }
}

impl<F: Fn(f64, f64) -> Point3> Chart<F> {
    /// Whether parameters are in the domain; open where their error leaves it so.
    pub(super) fn within(&self, p: [f64; 2], error: [f64; 2]) -> Option<bool> {
        let mut margins = [(1.0, 0.0); 3];
        for k in 0..2 {
            margins[k] = (p[k].min(1.0 - p[k]), error[k]);
        }
        if self.triangle {
            margins[2] = (1.0 - p[0] - p[1], error[0] + error[1]);
        }
        if margins.iter().any(|(m, e)| *m < -*e) {
            return Some(false);
        }
        margins.iter().all(|(m, e)| m > e).then_some(true)
    }
}

/// The largest second difference of samples on a 3 × 3 grid, halved.
fn sagging(f: &[f64; 9]) -> f64 {
    LINES.iter().map(|&[a, b, c]| (f[b] - 0.5 * (f[a] + f[c])).abs()).fold(0.0, f64::max)
}

/// Three samples on a line each: rows, columns, diagonals of a 3 × 3 grid.
const LINES: [[usize; 3]; 8] =
    [[0, 1, 2], [3, 4, 5], [6, 7, 8], [0, 3, 6], [1, 4, 7], [2, 5, 8], [0, 4, 8], [2, 4, 6]];
