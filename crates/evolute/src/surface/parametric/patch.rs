//! A piece of a parametric surface: its jet at the centre and proved bounds of all that is left.

use super::evaluate::Evaluator;
use crate::formula::Interval;
use crate::geometry::{Aabb, Point3, Vector3};
use crate::surface::Jet;

/// A rectangle of parameters: centre and half widths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// (s, t) of the middle.
    pub centre: [f64; 2],
    /// Half the width along s and t, positive.
    pub half: [f64; 2],
}

impl Cell {
    /// The whole domain [0, 1]².
    pub const DOMAIN: Self = Self { centre: [0.5; 2], half: [0.5; 2] };

    /// The cell [s0, s1] × [t0, t1].
    pub fn spanning(s: [f64; 2], t: [f64; 2]) -> Self {
        Self {
            centre: [0.5 * (s[0] + s[1]), 0.5 * (t[0] + t[1])],
            half: [0.5 * (s[1] - s[0]), 0.5 * (t[1] - t[0])],
        }
    }

    /// The two halves across s (`axis` 0) or t (1).
    pub fn split(&self, axis: usize) -> [Self; 2] {
        let half = 0.5 * self.half[axis];
        [-half, half].map(|shift| {
            let mut c = *self;
            c.half[axis] = half;
            c.centre[axis] += shift;
            c
        })
    }

    /// Whether (s, t) lies in the cell with its half widths scaled by `scale`.
    pub fn contains(&self, p: [f64; 2], scale: f64) -> bool {
        (0..2).all(|k| (p[k] - self.centre[k]).abs() <= scale * self.half[k])
    }

    /// Both ranges of parameters, rounded outward.
    pub(super) fn intervals(&self) -> [Interval; 2] {
        let at = |k: usize| {
            let (c, h) = (Interval::point(self.centre[k]), Interval::point(self.half[k]));
            Interval { lo: (c - h).lo, hi: (c + h).hi }
        };
        [at(0), at(1)]
    }

    /// Both ranges widened by [`OVERLAP`], but not beyond the domain (if the cell lies inside), where
    /// formulas need not be defined.
    fn widened(&self) -> [Interval; 2] {
        std::array::from_fn(|k| {
            let (c, h) = (self.centre[k], self.half[k]);
            let g = h * (1.0 + OVERLAP);
            let (lo, hi) = (c - g, c + g);
            Interval {
                lo: if c - h >= 0.0 { lo.max(0.0) } else { lo },
                hi: if c + h <= 1.0 { hi.min(1.0) } else { hi },
            }
        })
    }
}

/// Bounds hold on the cell widened by this fraction of its half widths, so that neighbours overlap
/// and a root on their common border is certified by both. Roots whose rounding error is larger than
/// this are left to smaller pieces.
pub(super) const OVERLAP: f64 = 1.0 / 64.0;

/// The surface over a cell: `x(c + d) = x + x_s d_s + x_t d_t + r`, with bounds per coordinate.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    pub cell: Cell,
    /// At the centre.
    pub jet: Jet,
    /// x_s × x_t at the centre.
    pub normal: Vector3,
    /// Dual basis of (x_s, x_t) in the tangent plane; not finite where that is singular.
    pub dual: [Vector3; 2],
    /// |x_ss|, |x_st|, |x_tt| on the widened cell are at most this.
    pub second: [Vector3; 3],
    /// |∂x − ∂x(centre)| on the widened cell is at most this, for ∂ = ∂/∂s, ∂/∂t.
    pub first_error: [Vector3; 2],
    /// |r| on the widened cell is at most this.
    pub remainder: Vector3,
    /// Rounding error of computed positions [m].
    pub noise: f64,
    pub bounds: Aabb,
}

fn magnitudes(b: &[Interval; 3]) -> Vector3 {
    // An empty interval says that there is nothing to bound; unbounded is the safe reading.
    Vector3::from_fn(|i, _| if b[i].is_empty() { f64::INFINITY } else { b[i].magnitude() })
}

fn deviation(b: &[Interval; 3], centre: &Vector3) -> Vector3 {
    magnitudes(&std::array::from_fn(|i| b[i] - Interval::point(centre[i])))
}

impl Patch {
    /// The patch over a cell, bounded by second-order interval jets.
    pub fn new(evaluator: &Evaluator, cell: Cell) -> Self {
        let wide = cell.widened();
        let jet = evaluator.jet(cell.centre[0], cell.centre[1]);
        let b = evaluator.jet_box(wide);
        let second = [magnitudes(&b.xss), magnitudes(&b.xst), magnitudes(&b.xtt)];
        let point = Cell { centre: cell.centre, half: [0.0; 2] };
        // The width of an interval evaluation at one point is a bound of its rounding error.
        let noise = evaluator
            .position_box(point.intervals())
            .iter()
            .map(Interval::width)
            .fold(0.0, f64::max);
        let first = [deviation(&b.xs, &jet.xu), deviation(&b.xt, &jet.xv)];
        let mut patch = Self::assembled(cell, jet, second, Some(first), noise);
        let (lo, hi) = patch.taylor_box();
        // Both enclose the surface, and so does what they have in common.
        patch.bounds = Aabb {
            min: Point3::from(Vector3::from_fn(|i, _| b.x[i].lo.max(lo[i]))),
            max: Point3::from(Vector3::from_fn(|i, _| b.x[i].hi.min(hi[i]))),
        };
        if b.x.iter().any(Interval::is_empty) {
            patch.bounds = Aabb::EMPTY;
        }
        patch
    }

    /// A part of this patch: second derivatives are still bounded as in the whole, unless they are not
    /// bounded there.
    pub fn part(&self, evaluator: &Evaluator, cell: Cell) -> Self {
        if self.second.iter().any(|m| m.iter().any(|x| !x.is_finite())) {
            return Self::new(evaluator, cell);
        }
        let jet = evaluator.jet(cell.centre[0], cell.centre[1]);
        let mut patch = Self::assembled(cell, jet, self.second, None, self.noise);
        let (lo, hi) = patch.taylor_box();
        patch.bounds = Aabb { min: Point3::from(lo), max: Point3::from(hi) };
        patch
    }

    fn assembled(
        cell: Cell,
        jet: Jet,
        second: [Vector3; 3],
        first: Option<[Vector3; 2]>,
        noise: f64,
    ) -> Self {
        let [hs, ht] = cell.half.map(|h| h * (1.0 + OVERLAP));
        let mut first_error = [second[0] * hs + second[1] * ht, second[1] * hs + second[2] * ht];
        // By second derivatives: ½ x_ss ds² + x_st ds dt + ½ x_tt dt².
        let mut remainder = (first_error[0] * hs + first_error[1] * ht) * 0.5;
        if let Some(first) = first {
            // By first derivatives (the mean value theorem): what is left at kinks.
            for k in 0..2 {
                first_error[k] = first_error[k].inf(&first[k]);
            }
            remainder = remainder.inf(&(first_error[0] * hs + first_error[1] * ht));
        }
        let normal = jet.area_vector();
        let squared = normal.norm_squared();
        let dual = [jet.xv.cross(&normal) / squared, normal.cross(&jet.xu) / squared];
        let bounds = Aabb::EMPTY;
        Self { cell, jet, normal, dual, second, first_error, remainder, noise, bounds }
    }

    /// Least and greatest coordinates by the expansion at the centre.
    fn taylor_box(&self) -> (Vector3, Vector3) {
        let [hs, ht] = self.cell.half;
        // A few roundings of numbers up to the reach, beside those of the formulas.
        let reach = self.jet.x.coords.abs() + self.remainder;
        let half = self.jet.xu.abs() * hs
            + self.jet.xv.abs() * ht
            + self.remainder
            + (reach * (8.0 * f64::EPSILON)).add_scalar(2.0 * self.noise);
        (self.jet.x.coords - half, self.jet.x.coords + half)
    }

    /// Across which parameter to split: the physically longer side if it is much longer (near a pole,
    /// where one direction shrinks to nothing), else where the surface bends more.
    pub fn split_axis(&self) -> usize {
        let [hs, ht] = self.cell.half;
        let length = [
            (self.jet.xu.norm() + self.first_error[0].norm().min(f64::MAX)) * hs,
            (self.jet.xv.norm() + self.first_error[1].norm().min(f64::MAX)) * ht,
        ];
        // More than four to one is called much longer: bends may make cells that slender, not more.
        if length[0] > 4.0 * length[1] {
            return 0;
        }
        if length[1] > 4.0 * length[0] {
            return 1;
        }
        let bend = [self.second[0].norm() * hs * hs, self.second[2].norm() * ht * ht];
        let unlike = bend.iter().all(|b| b.is_finite()) && bend[0] != bend[1];
        let [a, b] = if unlike { bend } else { length };
        usize::from(b > a)
    }

    /// Physical half extents, summed [m].
    pub fn extent(&self) -> f64 {
        let [hs, ht] = self.cell.half;
        self.jet.xu.norm() * hs + self.jet.xv.norm() * ht + self.remainder.norm()
    }

    /// Area over the cell as seen from its centre [m²].
    pub fn area(&self) -> f64 {
        4.0 * self.cell.half[0] * self.cell.half[1] * self.normal.norm()
    }

    /// Share of the rays through this patch that its certificate leaves undecided, for rays that hit
    /// it from random directions (their cosines c are distributed as 2c dc).
    pub fn undecided_share(&self) -> f64 {
        let Some(n) = self.normal.try_normalize(0.0) else { return 1.0 };
        let n = n.abs();
        let h = self.cell.half;
        let e = self.first_error[0] * h[0] + self.first_error[1] * h[1];
        // |A⁻¹|E row by row: tangentially, and through the slope times the normal part, which grows
        // like 1/cos of the angle of incidence.
        let tangential = (0..2).map(|k| self.dual[k].abs().dot(&e) / h[k]).fold(0.0, f64::max);
        let normal = (0..2).map(|k| self.dual[k].norm() * n.dot(&e) / h[k]).fold(0.0, f64::max);
        let cosine = normal / (0.5 - tangential);
        // NaN and negative: nothing is decided.
        if (0.0..1.0).contains(&cosine) { cosine * cosine } else { 1.0 }
    }
}
