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

    /// Whether the halves across `axis` are still different cells in double precision.
    pub(super) fn is_divisible(&self, axis: usize) -> bool {
        let (c, h) = (self.centre[axis], 0.5 * self.half[axis]);
        c - h < c && c < c + h
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

/// Generations of parts that share one bound of second derivatives: evaluating it costs some five times
/// the rest of a part, and after four halvings little is left to gain by sharing.
const INHERITED: u8 = 4;

/// The surface over a cell: `x(c + d) = x + x_s d_s + x_t d_t + r`, with bounds of r and of its
/// derivatives in any direction.
///
/// The second derivatives are kept as their values at the centre and the deviation from these: in the
/// direction of the normal they are much smaller than along the surface (near a pole by orders of
/// magnitude), and a box of magnitudes would forget that.
#[derive(Clone, Debug)]
#[repr(C)] // what every ray reads comes first, in as few cache lines as possible
pub(super) struct Patch {
    /// x_s × x_t at the centre.
    pub normal: Vector3,
    /// Dual basis of (x_s, x_t) in the tangent plane; not finite where that is singular.
    pub dual: [Vector3; 2],
    pub cell: Cell,
    /// Bounds of |x_ss − x_ss(c)|, |x_st − …|, |x_tt − …| on the widened cell, each coordinate.
    second_error: [f64; 3],
    /// Rounding error of computed positions [m].
    pub noise: f64,
    /// At the centre.
    pub jet: Jet,
    /// Where second derivatives are not bounded (at kinks): bounds of |x_s − x_s(c)|, |x_t − x_t(c)|.
    first_error: Option<Box<[Vector3; 2]>>,
    /// For how many generations `second_error` has been taken over from the whole.
    inherited: u8,
    pub bounds: Aabb,
}

/// Bounds over a (widened) patch in one direction `row`.
#[derive(Clone, Copy)]
pub(super) struct Deviation {
    /// |row · r|.
    pub remainder: f64,
    /// |row · (x_s − x_s(c))| times the half width along s, plus the same for t.
    pub slope: f64,
}

fn deviation(b: &[Interval; 3], centre: &Vector3) -> Vector3 {
    Vector3::from_fn(|i, _| {
        let d = b[i] - Interval::point(centre[i]);
        // An empty interval says that there is nothing to bound; unbounded is the safe reading.
        if d.is_empty() { f64::INFINITY } else { d.magnitude() }
    })
}

impl Patch {
    /// The patch over a cell, bounded by second-order interval jets.
    pub fn new(evaluator: &Evaluator, cell: Cell) -> Self {
        let jet = evaluator.jet(cell.centre[0], cell.centre[1]);
        let b = evaluator.jet_box(cell.widened());
        let second = [
            deviation(&b.xss, &jet.xuu).amax(),
            deviation(&b.xst, &jet.xuv).amax(),
            deviation(&b.xtt, &jet.xvv).amax(),
        ];
        let first = [deviation(&b.xs, &jet.xu), deviation(&b.xt, &jet.xv)];
        let point = Cell { centre: cell.centre, half: [0.0; 2] };
        // The width of an interval evaluation at one point is a bound of its rounding error.
        let noise = evaluator
            .position_box(point.intervals())
            .iter()
            .map(Interval::width)
            .fold(0.0, f64::max);
        let mut patch = Self::assembled(cell, jet, second, noise);
        if second.iter().any(|x| !x.is_finite()) {
            patch.first_error = Some(Box::new(first));
        }
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

    /// A part of this patch: its second derivatives are still bounded as in the whole, which saves most
    /// of the work; but not for long, for near a pole they shrink with the cell. Its box is left empty.
    pub fn part(&self, evaluator: &Evaluator, cell: Cell) -> Self {
        if self.inherited >= INHERITED || self.first_error.is_some() {
            return Self::new(evaluator, cell);
        }
        let jet = evaluator.jet(cell.centre[0], cell.centre[1]);
        let [ss, st, tt] = self.second_error;
        let second = [
            ss + (self.jet.xuu - jet.xuu).amax(),
            st + (self.jet.xuv - jet.xuv).amax(),
            tt + (self.jet.xvv - jet.xvv).amax(),
        ];
        let inherited = self.inherited + 1;
        Self { inherited, ..Self::assembled(cell, jet, second, self.noise) }
    }

    fn assembled(cell: Cell, jet: Jet, second_error: [f64; 3], noise: f64) -> Self {
        let normal = jet.area_vector();
        let squared = normal.norm_squared();
        let dual = [jet.xv.cross(&normal) / squared, normal.cross(&jet.xu) / squared];
        let bounds = Aabb::EMPTY;
        Self {
            cell,
            jet,
            normal,
            dual,
            second_error,
            first_error: None,
            inherited: 0,
            noise,
            bounds,
        }
    }

    /// Bounds in the direction `row` [units of row times m].
    #[inline]
    pub fn deviation(&self, row: &Vector3) -> Deviation {
        let [hs, ht] = self.cell.half.map(|h| h * (1.0 + OVERLAP));
        if let Some(first) = &self.first_error {
            // The mean value theorem.
            let ([s, t], size) = (&**first, row.abs());
            let slope = size.dot(s) * hs + size.dot(t) * ht;
            return Deviation { remainder: slope, slope };
        }
        let size = row.x.abs() + row.y.abs() + row.z.abs();
        let [ss, st, tt] = self.second_error.map(|e| e * size);
        let ss = row.dot(&self.jet.xuu).abs() + ss;
        let st = row.dot(&self.jet.xuv).abs() + st;
        let tt = row.dot(&self.jet.xvv).abs() + tt;
        // Taylor's formula: ½ x_ss ds² + x_st ds dt + ½ x_tt dt².
        let slope = (ss * hs + st * ht) * hs + (st * hs + tt * ht) * ht;
        Deviation { remainder: 0.5 * slope, slope }
    }

    /// Bounds of |x_s − x_s(c)| (`axis` 0) or |x_t − x_t(c)| (1), by coordinate.
    pub fn velocity_error(&self, axis: usize) -> Vector3 {
        if let Some(first) = &self.first_error {
            return first[axis];
        }
        let [hs, ht] = self.cell.half.map(|h| h * (1.0 + OVERLAP));
        let [ss, st, tt] = self.second_error;
        let (j, mixed) = (&self.jet, self.jet.xuv.abs().add_scalar(st));
        if axis == 0 {
            j.xuu.abs().add_scalar(ss) * hs + mixed * ht
        } else {
            mixed * hs + j.xvv.abs().add_scalar(tt) * ht
        }
    }

    /// Bounds of the remainder by coordinate.
    fn remainder(&self) -> Vector3 {
        Vector3::from_fn(|i, _| self.deviation(&Vector3::ith(i, 1.0)).remainder)
    }

    /// Least and greatest coordinates by the expansion at the centre.
    fn taylor_box(&self) -> (Vector3, Vector3) {
        let [hs, ht] = self.cell.half;
        // A few roundings of numbers up to the reach, beside those of the formulas.
        let remainder = self.remainder();
        let reach = self.jet.x.coords.abs() + remainder;
        let half = self.jet.xu.abs() * hs
            + self.jet.xv.abs() * ht
            + remainder
            + (reach * (8.0 * f64::EPSILON)).add_scalar(2.0 * self.noise);
        (self.jet.x.coords - half, self.jet.x.coords + half)
    }

    /// Whether derivatives jump, or are not bounded, somewhere in the patch; then its box is at hand.
    pub fn has_kink(&self) -> bool {
        self.first_error.is_some()
    }

    /// Whether splitting has nothing more to give where positions are known to `noise` [m]: the patch
    /// is plane to that accuracy in all directions, or it is so along its normal and its parameters
    /// are regular, so that only a tangent ray can be undecided.
    pub fn is_flat(&self, noise: f64) -> bool {
        if self.remainder().amax() <= noise || (self.has_kink() && self.bounds.diagonal() <= noise)
        {
            return true;
        }
        let regular = (0..2).all(|k| self.deviation(&self.dual[k]).slope < 0.5 * self.cell.half[k]);
        let n = self.normal / self.normal.norm();
        regular && self.deviation(&n).remainder <= noise
    }

    /// Across which parameter to split: the physically longer side if it is much longer (near a pole,
    /// where one direction shrinks to nothing), but not if nothing bends along it (on a cylinder's
    /// line); else where the surface bends more. At a kink, the parameter across it.
    pub fn split_axis(&self) -> usize {
        let h = self.cell.half;
        if let Some(first) = &self.first_error {
            let jump = [0, 1].map(|k: usize| first[k].norm() * h[k]);
            if jump[0] != jump[1] {
                return usize::from(jump[1] > jump[0]);
            }
        }
        let length = [(0, self.jet.xu), (1, self.jet.xv)]
            .map(|(k, v)| (v.norm() + self.velocity_error(k).norm().min(f64::MAX)) * h[k]);
        let [ss, st, tt] = self.second_error;
        let bend =
            [(self.jet.xuu.norm() + ss) * h[0] * h[0], (self.jet.xvv.norm() + tt) * h[1] * h[1]];
        let twist = (self.jet.xuv.norm() + st) * h[0] * h[1];
        for k in 0..2 {
            // More than four to one is called much longer: bends may make cells that slender, not more.
            // A sixteenth of the other's bend is called none.
            if length[k] > 4.0 * length[1 - k] {
                return if 16.0 * (bend[k] + twist) < bend[1 - k] { 1 - k } else { k };
            }
        }
        let unlike = bend.iter().all(|b| b.is_finite()) && bend[0] != bend[1];
        let [a, b] = if unlike { bend } else { length };
        usize::from(b > a)
    }

    /// Physical half extents, summed [m].
    pub fn extent(&self) -> f64 {
        let [hs, ht] = self.cell.half;
        self.jet.xu.norm() * hs + self.jet.xv.norm() * ht + self.remainder().norm()
    }

    /// Whether the box is bounded.
    pub fn is_bounded(&self) -> bool {
        self.bounds.min.iter().chain(self.bounds.max.iter()).all(|x| x.is_finite())
    }

    /// Area over the cell as seen from its centre [m²].
    pub fn area(&self) -> f64 {
        4.0 * self.cell.half[0] * self.cell.half[1] * self.normal.norm()
    }

    /// Share of the rays through this patch that its certificate leaves undecided, for rays that hit
    /// it from random directions (their cosines c are distributed as 2c dc).
    pub fn undecided_share(&self) -> f64 {
        let Some(n) = self.normal.try_normalize(0.0) else { return 1.0 };
        // ‖M E‖ row by row: tangentially, and through the slope times the normal part, which grows
        // like 1/cos of the angle of incidence.
        let sag = self.deviation(&n).slope;
        let (mut tangential, mut normal) = (0f64, 0f64);
        for k in 0..2 {
            tangential = tangential.max(self.deviation(&self.dual[k]).slope / self.cell.half[k]);
            normal = normal.max(self.dual[k].norm() * sag / self.cell.half[k]);
        }
        let cosine = normal / (0.5 - tangential);
        // NaN and negative: nothing is decided.
        if (0.0..1.0).contains(&cosine) { cosine * cosine } else { 1.0 }
    }
}
