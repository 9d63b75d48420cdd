//! Normals (also where the parametrisation is singular), parameters of points, area.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::Parametric;
use super::patch::Cell;
use crate::geometry::{Matrix3, Point3, UnitVector3, Vector3};
use crate::surface::{Jet, LocalGeometry, contact_tolerance};

/// Below this share of the surface's largest |x_s × x_t| the parametrisation counts as singular. Nearer
/// to a pole curvatures lose more digits to rounding than the extrapolation loses.
const SINGULAR: f64 = 1e-6;

/// Step of the extrapolation [parameters] and number of samples: its error is near step⁶ times a sixth
/// derivative, about 10⁻¹⁰ for a surface with a wave or two; rounding grows 2⁶-fold.
const STEP: f64 = 1.0 / 512.0;
const SAMPLES: usize = 6;

/// How far the limits along two directions may differ and still be called one (normals: absolutely;
/// their derivatives: relatively).
const AGREEMENT: f64 = 1e-5;

/// Most cells of an area: enough for 10⁻¹⁰ on any smooth surface and for 10⁻⁴ along a kink, within
/// a tenth of a second.
const MAX_AREA_CELLS: usize = 20_000;

/// A cell with its area and how uncertain that is [m²]; the most uncertain is the greatest.
struct AreaCell {
    cell: Cell,
    area: f64,
    error: f64,
}

impl Ord for AreaCell {
    fn cmp(&self, other: &Self) -> Ordering {
        let [a, b] = [self, other].map(|c| c.cell.centre);
        self.error.total_cmp(&other.error).then(a[0].total_cmp(&b[0])).then(a[1].total_cmp(&b[1]))
    }
}
impl PartialOrd for AreaCell {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for AreaCell {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for AreaCell {}

impl Parametric {
    /// Position, front normal and its derivative at (s, t), also beyond [0, 1]². Where the
    /// parametrisation is singular (a pole, a collapsed side or corner), the limit from inside; `None`
    /// if there is none (a cone's tip) or the formulas are not defined there.
    pub fn local(&self, s: f64, t: f64) -> Option<LocalGeometry> {
        let jet = self.jet(s, t);
        let flip = self.normal_sign() < 0.0;
        if self.is_regular(&jet) {
            return jet.local(flip).filter(|l| l.dn_dx.iter().all(|x| x.is_finite()));
        }
        let x = Some(jet.x).filter(|x| x.iter().all(|x| x.is_finite()))?;
        // Two ways inward: the limits along both must be the same.
        let [(n, d), (n2, d2)] =
            [[0.47, 0.56], [0.61, 0.38]].map(|aim| self.limit(s, t, aim, flip)).map(|l| l.unzip());
        let (n, d, n2, d2) = (n?, d?, n2?, d2?);
        let one = (n - n2).norm() <= AGREEMENT
            && (d - d2).norm() <= AGREEMENT * (d.norm() + 1.0 / self.size());
        let n = UnitVector3::try_new(n, 0.5).filter(|_| one)?;
        Some(LocalGeometry { x, n, ng: n, dn_dx: d })
    }

    /// Whether x_s × x_t is far enough from zero to give a normal.
    pub(super) fn is_regular(&self, jet: &Jet) -> bool {
        jet.area_vector().norm() > SINGULAR * self.area_scale
    }

    /// Normal and its derivative, extrapolated to (s, t) from points on the way to `aim`.
    fn limit(&self, s: f64, t: f64, aim: [f64; 2], flip: bool) -> Option<(Vector3, Matrix3)> {
        let way = [aim[0] - s, aim[1] - t];
        let length = way[0].abs().max(way[1].abs());
        let step = way.map(|w| w / length * STEP);
        let (mut n, mut d) = (Vector3::zeros(), Matrix3::zeros());
        // The polynomial through samples at 1, 2, …, k has the value Σ (−1)^(i+1) C(k, i) f(i) at 0.
        let mut weight = 1.0;
        for i in 1..=SAMPLES {
            let m = i as f64;
            weight *= ((SAMPLES - i + 1) as f64) / m;
            let sign = if i % 2 == 1 { weight } else { -weight };
            let jet = self.jet(s + m * step[0], t + m * step[1]);
            let l = jet.local(flip).filter(|_| self.is_regular(&jet))?;
            n += l.n.into_inner() * sign;
            d += l.dn_dx * sign;
        }
        (n.iter().chain(d.iter()).all(|x| x.is_finite())).then_some((n, d))
    }

    /// The parameters in [0, 1]² of the point `x`, if `x` lies on the surface to within
    /// [`contact_tolerance`]. The first found of several (at seams and crossings).
    pub fn locate(&self, x: &Point3) -> Option<(f64, f64)> {
        let tolerance = contact_tolerance(x, &self.bounds());
        let mut found = None;
        let mut candidates = Vec::new();
        self.leaves.for_each(|b| b.grown(tolerance).contains(x), |leaf| candidates.push(leaf));
        for leaf in candidates {
            let cell = self.leaves.patches[leaf].cell;
            // Also from the corners: a leaf at a pole bends all the way round.
            let corner = |a: f64, b: f64| {
                (cell.centre[0] + a * cell.half[0], cell.centre[1] + b * cell.half[1])
            };
            let starts = [(0.0, 0.0), (-0.9, -0.9), (0.9, -0.9), (-0.9, 0.9), (0.9, 0.9)];
            for (a, b) in starts {
                let (p, distance) = self.nearest(x, corner(a, b), cell);
                if distance <= tolerance && found.is_none_or(|(_, d)| distance < d) {
                    found = Some((p, distance));
                }
                if found.is_some() {
                    break;
                }
            }
        }
        found.map(|(p, _)| p)
    }

    /// The point of the surface near a guess that is nearest to `x`, kept to a cell (a little widened):
    /// parameters and distance [m]. Levenberg's damped Gauss-Newton iteration.
    fn nearest(&self, x: &Point3, guess: (f64, f64), cell: Cell) -> ((f64, f64), f64) {
        let clamp = |k: usize, q: f64| {
            let h = 1.01 * cell.half[k];
            q.clamp(cell.centre[k] - h, cell.centre[k] + h).clamp(0.0, 1.0)
        };
        let mut p = guess;
        let mut damping = 1e-3;
        let mut at = self.evaluator.jet1(p.0, p.1);
        let mut distance = (x - at.0).norm();
        for _ in 0..60 {
            let (y, ys, yt) = at;
            let r = x - y;
            let (e, f, g) = (ys.norm_squared(), ys.dot(&yt), yt.norm_squared());
            let (a, b) = (ys.dot(&r), yt.dot(&r));
            // Damping in the scale of each parameter; a collapsed one does not move.
            let (e, g) = (e * (1.0 + damping), g * (1.0 + damping));
            let det = e * g - f * f;
            let (ds, dt) = if det > 0.0 {
                ((g * a - f * b) / det, (e * b - f * a) / det)
            } else {
                let along = |a: f64, e: f64| if e > 0.0 { a / e } else { 0.0 };
                (along(a, e), along(b, g))
            };
            let q = (clamp(0, p.0 + ds), clamp(1, p.1 + dt));
            if q == p {
                break;
            }
            let next = self.evaluator.jet1(q.0, q.1);
            let d = (x - next.0).norm();
            if d < distance {
                (p, at, distance) = (q, next, d);
                damping *= 0.1;
            } else {
                damping *= 10.0;
                if damping > 1e12 {
                    break;
                }
            }
        }
        (p, distance)
    }

    /// Area [m²] to within the share `accuracy` of it, as far as an estimate can tell: the cell whose
    /// value differs most from the sum of its quarters is quartered, until all these differences
    /// together are below the tolerance. Kinks are followed to `MAX_AREA_CELLS` cells.
    pub fn area(&self, accuracy: f64) -> f64 {
        let mut heap = BinaryHeap::new();
        let (mut total, mut error) = (0.0, 0.0);
        // Two levels to begin with: the first differences mean nothing.
        let quarter = |c: &Cell| c.split(0).map(|c| c.split(1)).concat();
        for c in quarter(&Cell::DOMAIN).iter().flat_map(quarter) {
            let cell = self.area_cell(c);
            (total, error) = (total + cell.area, error + cell.error);
            heap.push(cell);
        }
        let mut cells = heap.len();
        while error > accuracy * total && cells < MAX_AREA_CELLS {
            let Some(worst) = heap.pop() else { break };
            (total, error) = (total - worst.area, error - worst.error);
            for c in quarter(&worst.cell) {
                let cell = self.area_cell(c);
                (total, error) = (total + cell.area, error + cell.error);
                heap.push(cell);
            }
            cells += 3;
            if cells % 1024 == 0 {
                // Running sums drift; once in a while they are made anew.
                error = heap.iter().map(|c| c.error).sum();
            }
        }
        // In an order of its own: the heap's is no affair of the result's.
        let mut cells = heap.into_vec();
        cells.sort();
        cells.iter().map(|c| c.area).sum()
    }

    fn area_cell(&self, cell: Cell) -> AreaCell {
        let parts = cell.split(0).map(|c| c.split(1));
        let area: f64 = parts.iter().flatten().map(|c| self.area_over(*c)).sum();
        AreaCell { cell, area, error: (area - self.area_over(cell)).abs() }
    }

    /// Gauss's rule of 4 × 4 points for |x_s × x_t| over a cell [m²].
    fn area_over(&self, cell: Cell) -> f64 {
        const NODES: [(f64, f64); 4] = [
            (-0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
            (-0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
            (0.339_981_043_584_856_26, 0.652_145_154_862_546_1),
            (0.861_136_311_594_052_6, 0.347_854_845_137_453_85),
        ];
        let mut sum = 0.0;
        for (a, wa) in NODES {
            for (b, wb) in NODES {
                let s = cell.centre[0] + a * cell.half[0];
                let t = cell.centre[1] + b * cell.half[1];
                let (_, xs, xt) = self.evaluator.jet1(s, t);
                sum += wa * wb * xs.cross(&xt).norm();
            }
        }
        sum * cell.half[0] * cell.half[1]
    }
}
