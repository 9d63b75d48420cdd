//! Rays that are nearly tangent: along the curve of the surface that lies straight under the ray, the
//! surface's height over the ray has an extremum, and its sign there says whether there are two roots
//! or none.

use super::Root;
use super::quartering::{Cell, Sight};
use evolute::geometry::{Point3, Vector3};

/// How far the curve is followed both ways [sizes of the surface]: further than two roots lie apart
/// that quartering cannot tell apart, and not so far that the surface turns.
const AROUND: f64 = 1e-4;

/// The surface's curve under a ray, by one parameter.
struct Curve<'c, F: Fn(f64, f64) -> Point3> {
    sight: &'c Sight<'c, F>,
    /// Along the surface's normal and across it.
    axes: [Vector3; 2],
    /// The parameter followed.
    free: usize,
    /// Range of the other.
    other: [f64; 2],
}

impl<F: Fn(f64, f64) -> Point3> Curve<'_, F> {
    fn place(&self, u: f64, v: f64) -> [f64; 2] {
        if self.free == 0 { [u, v] } else { [v, u] }
    }

    /// Parameters and position under the ray, by bisection.
    fn at(&self, u: f64) -> Option<([f64; 2], Vector3)> {
        let x = |v: f64| {
            let [p, q] = self.place(u, v);
            self.sight.at(p, q)
        };
        let side = |v: f64| self.axes[1].dot(&x(v)) > 0.0;
        let [mut low, mut high] = self.other;
        let below = side(low);
        if below == side(high) {
            return None;
        }
        loop {
            let v = 0.5 * (low + high);
            if v <= low || v >= high {
                return Some((self.place(u, v), x(v)));
            }
            if side(v) == below { low = v } else { high = v }
        }
    }

    fn height(&self, u: f64) -> Option<f64> {
        Some(self.axes[0].dot(&self.at(u)?.1))
    }

    /// Adds the root between two places of different sign.
    fn bisect(&self, mut a: f64, mut b: f64, roots: &mut Vec<Root>) -> Option<()> {
        let width = (b - a).abs();
        let above = self.height(a)? > 0.0;
        loop {
            let m = 0.5 * (a + b);
            if m <= a.min(b) || m >= a.max(b) {
                break;
            }
            if (self.height(m)? > 0.0) == above { a = m } else { b = m }
        }
        // Where the height is beyond rounding on both sides.
        let mut du = f64::EPSILON * a.abs().max(1e-3);
        let far = |u: f64| self.height(u).is_none_or(|h| h.abs() > self.sight.noise);
        while du < width && !(far(a - du) && far(a + du)) {
            du *= 2.0;
        }
        let (place, x) = self.at(a)?;
        let doubt = match (self.at(a - du), self.at(a + du)) {
            (Some(l), Some(r)) => (l.1 - x).norm().max((r.1 - x).norm()),
            _ => AROUND * self.sight.chart.size,
        };
        match self.sight.chart.within(place, [du; 2]) {
            Some(false) => {}
            within => {
                roots.push(Root { t: x.dot(&self.sight.w), doubt, certain: within.is_some() })
            }
        }
        Some(())
    }
}

impl<F: Fn(f64, f64) -> Point3> Sight<'_, F> {
    /// Adds the roots near a cell that lies within rounding of the ray, at τ = `along` [m].
    pub(super) fn settle(&self, cell: Cell, along: f64, roots: &mut Vec<Root>) {
        let mut found = vec![];
        if self.follow(cell, &mut found).is_some() {
            roots.extend(found);
        } else {
            let doubt = AROUND * self.chart.size;
            roots.push(Root { t: along, doubt, certain: false });
        }
    }

    /// `None` where the height's extremum is nothing to within rounding.
    fn follow(&self, (c, h): Cell, roots: &mut Vec<Root>) -> Option<()> {
        // Tangents by differences, one-sided where the domain ends.
        let range = |k: usize, h: f64| [(c[k] - h).max(0.0), (c[k] + h).min(1.0)];
        let wide = |k: usize, h: f64| {
            let ([a, b], mut p, mut q) = (range(k, h), c, c);
            (p[k], q[k]) = (a, b);
            (self.at(q[0], q[1]) - self.at(p[0], p[1])) / (b - a)
        };
        let step = 1e-5f64;
        let v = [0, 1].map(|k: usize| wide(k, step.max(h[k])));
        let reach = v.map(|v| AROUND * self.chart.size / v.norm());
        if !reach.iter().all(|r| *r < 0.1) {
            return None;
        }
        let axes = self.axes(&v[0].cross(&v[1]));
        // The parameter that is solved for is the one that moves more across the ray.
        let across = [0, 1].map(|k| (axes[1].dot(&v[k]) / v[k].norm()).abs());
        let free = usize::from(across[0] > across[1]);
        let curve =
            Curve { sight: self, axes, free, other: range(1 - free, 4.0 * reach[1 - free]) };
        let [low, high] = range(free, reach[free]);
        let ends = [curve.height(low)?, curve.height(high)?];
        if ends.iter().any(|e| e.abs() <= self.noise) {
            return None;
        }
        if (ends[0] > 0.0) != (ends[1] > 0.0) {
            return curve.bisect(low, high, roots);
        }
        let sign = ends[0].signum();
        let (mut a, mut b) = (low, high);
        for _ in 0..60 {
            const GOLDEN: f64 = 0.618_033_988_749_894_9;
            let (c, d) = (b - GOLDEN * (b - a), a + GOLDEN * (b - a));
            if sign * curve.height(c)? < sign * curve.height(d)? { b = d } else { a = c }
        }
        let least = 0.5 * (a + b);
        let height = sign * curve.height(least)?;
        if height.abs() <= self.noise {
            return None;
        }
        if height < 0.0 {
            curve.bisect(least, low, roots)?;
            curve.bisect(least, high, roots)?;
        }
        Some(())
    }
}
