//! Where certificates end: poles, tangents to within rounding, kinks.

use super::Parametric;
use super::hit::{End, NEAR_END, Query, RESIDUAL};
use super::patch::{OVERLAP, Patch};
use crate::geometry::Vector3;

impl Query<'_> {
    /// The end that is a pole on a side of the patch, and the parameter that moves away from it.
    fn pole_of(&self, patch: &Patch) -> Option<(&End, usize)> {
        self.ends.iter().find_map(|end| {
            let k = 1 - end.idle?;
            let (distance, h) = ((patch.cell.centre[k] - end.p[k]).abs(), patch.cell.half[k]);
            // On the patch's side, not somewhere within.
            let touches = distance <= h * (1.0 + OVERLAP) && distance >= h * (1.0 - OVERLAP);
            touches.then_some((end, k))
        })
    }

    /// Across which parameter to split a patch. At a pole from which the ray starts, by what widens the
    /// cone of directions in which the patch lies (see [`Query::departs`]).
    pub(super) fn split_axis(&self, patch: &Patch) -> usize {
        let Some((_, k)) = self.pole_of(patch) else { return patch.split_axis() };
        let (j, h) = (&patch.jet, patch.cell.half);
        let along = if k == 0 { j.xuu } else { j.xvv }.norm() * h[k];
        if j.xuv.norm() * h[1 - k] > along { 1 - k } else { k }
    }

    /// Whether the patch touches a pole at which the ray starts or ends, and provably holds no other
    /// root: if x does not change with s at t = t0, then x − pole = (t − t0) ξ with ξ among the values
    /// of x_t over the patch, and the ray has to run through their box.
    pub(super) fn departs(&self, surface: &Parametric, patch: &Patch) -> bool {
        let Some((end, k)) = self.pole_of(patch) else { return false };
        let (p, idle) = (end.p, 1 - k);
        let (c, h) = (&patch.cell.centre, &patch.cell.half);
        // From the pole into the ray, and into the patch.
        let away = if end.tau > 0.0 { -self.ray.direction } else { self.ray.direction };
        let side = c[k] - p[k];
        // The pole must be one all along the patch: the same point at both ends and in the middle.
        let one_point = [-1.0, 0.0, 1.0].iter().all(|a| {
            let mut q = p;
            q[idle] = c[idle] + a * h[idle];
            (surface.position(q[0], q[1]) - end.x).norm() <= 2.0 * self.noise(patch)
        });
        let velocity = if k == 0 { patch.jet.xu } else { patch.jet.xv };
        let (middle, error) = (velocity * side.signum(), patch.velocity_error(k));
        // A slab test: origin 0, direction `away`, box middle ± error.
        let (mut near, mut far) = (0f64, f64::INFINITY);
        for i in 0..3 {
            let (w, e) = (away[i], error[i]);
            let (a, b) = ((middle[i] - e) / w, (middle[i] + e) / w);
            // NaN cuts nothing.
            near = if a.min(b) > near { a.min(b) } else { near };
            far = if a.max(b) < far { a.max(b) } else { far };
        }
        one_point && near > far * (1.0 + 8.0 * f64::EPSILON)
    }

    /// A patch that is flat, or a point, to within rounding, and still undecided: the ray is tangent,
    /// or the parametrisation singular.
    pub(super) fn at_rounding(
        &self,
        surface: &Parametric,
        patch: &Patch,
    ) -> Option<(f64, f64, f64)> {
        let extent = patch.extent();
        let near = |end: &&End| (patch.jet.x - end.x).norm() <= NEAR_END * surface.size + extent;
        if let Some(end) = self.ends.iter().find(near) {
            return self.second_root(surface, patch, end).unwrap_or_else(|| {
                // Further roots lie close by, as near an inflection.
                let (tau, p, distance) = self.closest(surface, patch);
                let root = distance <= 4.0 * self.noise(patch)
                    && tau > self.t_min
                    && tau <= self.t_max
                    && self.ends.iter().all(|end| self.parts_from(surface, patch, end, tau, p));
                root.then_some((tau, p[0], p[1]))
            });
        }
        let slope = patch.normal.dot(&self.ray.direction)
            / (patch.normal.norm() * self.ray.direction.norm());
        if extent > NEAR_END * surface.size && slope.abs() * extent <= 8.0 * self.noise(patch) {
            return None; // a plane, and the ray in it or parallel to it
        }
        let (tau, [s, t], distance) = self.closest(surface, patch);
        let near = distance <= RESIDUAL * surface.size;
        (near && tau > self.t_min && tau <= self.t_max).then_some((tau, s, t))
    }

    /// The point of the patch nearest to the ray's line: τ, (s, t), distance.
    fn closest(&self, surface: &Parametric, patch: &Patch) -> (f64, [f64; 2], f64) {
        // Least squares, then by turns to stay in the cell. That closes in slowly along a common
        // direction of both, but there any point will do.
        let w = &self.ray.direction;
        let across = |v: Vector3| v - w * (v.dot(w) * self.inverse_square);
        let (c, h) = (patch.cell.centre, patch.cell.half);
        let mut p = c;
        for _ in 0..4 {
            let (x, xs, xt) = surface.evaluator.jet1(p[0], p[1]);
            // Along an unbounded derivative there is no step to take.
            let v = [xs, xt].map(|v| Some(across(v)).filter(|v| v.norm().is_finite()));
            let (r, v) = (across(x - self.ray.origin), v.map(Option::unwrap_or_default));
            let (e, f, g) = (v[0].norm_squared(), v[0].dot(&v[1]), v[1].norm_squared());
            let (a, b) = (v[0].dot(&r), v[1].dot(&r));
            let det = e * g - f * f;
            let mut d = [(f * b - g * a) / det, (f * a - e * b) / det];
            for k in 0..2 {
                let q = (p[k] + d[k] - c[k]).clamp(-h[k], h[k]) + c[k] - p[k];
                d[k] = if q.is_finite() { q } else { 0.0 };
            }
            for k in [0, 1, 0, 1] {
                let rest = r + v[1 - k] * d[1 - k];
                let step = -v[k].dot(&rest) / v[k].norm_squared();
                if step.is_finite() {
                    d[k] = (p[k] + step - c[k]).clamp(-h[k], h[k]) + c[k] - p[k];
                }
            }
            p = [p[0] + d[0], p[1] + d[1]];
        }
        let x = surface.position(p[0], p[1]);
        let tau = (x - self.ray.origin).dot(w) * self.inverse_square;
        (tau, p, (self.ray.at(tau) - x).norm())
    }

    /// Whether the surface leaves the ray by more than rounding half-way between an end and a point
    /// where both are together again: then that is a root of its own. False also where the end is not
    /// found from there (beyond a seam).
    fn parts_from(
        &self,
        surface: &Parametric,
        patch: &Patch,
        end: &End,
        tau: f64,
        p: [f64; 2],
    ) -> bool {
        // The foot of a point of the ray on the surface, from parameters close by: Gauss and Newton's
        // steps converge fast over NEAR_END.
        let foot = |tau: f64, mut p: [f64; 2]| {
            for _ in 0..8 {
                let (x, xs, xt) = surface.evaluator.jet1(p[0], p[1]);
                let r = self.ray.at(tau) - x;
                let (e, f, g) = (xs.norm_squared(), xs.dot(&xt), xt.norm_squared());
                let (a, b) = (xs.dot(&r), xt.dot(&r));
                let det = e * g - f * f;
                p[0] = (p[0] + (g * a - f * b) / det).clamp(0.0, 1.0);
                p[1] = (p[1] + (e * b - f * a) / det).clamp(0.0, 1.0);
            }
            (p, surface.position(p[0], p[1]))
        };
        let (middle, x) = foot(0.5 * (tau + end.tau), p);
        let height = (self.ray.at(0.5 * (tau + end.tau)) - x).norm();
        let (_, there) = foot(end.tau, middle);
        let noise = self.noise(patch);
        height > 4.0 * noise && (there - end.x).norm() <= 4.0 * noise
    }

    /// The second root of a nearly tangent ray close to its end, with the first divided out: for
    /// x(τ) = end + w τ, the normal part n·x_dd τ²/2 = n·w τ gives τ = 2 n·w / n·x_dd, where d is the
    /// ray's direction in parameters. Its relative error is of the order of τ times the change of
    /// curvature. The outer `None` where the expansion does not hold: its root is off the surface by more
    /// than rounding.
    fn second_root(
        &self,
        surface: &Parametric,
        patch: &Patch,
        end: &End,
    ) -> Option<Option<(f64, f64, f64)>> {
        let j = surface.jet(end.p[0], end.p[1]);
        if !surface.is_regular(&j) {
            return Some(None); // at a pole there are no directions of parameters
        }
        let w = &self.ray.direction;
        let n = j.area_vector();
        let squared = n.norm_squared();
        let slope = n.dot(w);
        if slope.abs() <= 4.0 * f64::EPSILON * n.norm() * w.norm() {
            return Some(None); // tangent: both roots are one
        }
        let dual = [j.xv.cross(&n) / squared, n.cross(&j.xu) / squared];
        let d = [dual[0].dot(w), dual[1].dot(w)];
        let bend = j.xuu * (d[0] * d[0]) + j.xuv * (2.0 * d[0] * d[1]) + j.xvv * (d[1] * d[1]);
        let step = 2.0 * slope / n.dot(&bend);
        let tau = end.tau + step;
        let [s, t] = std::array::from_fn(|k| {
            end.p[k] + d[k] * step - 0.5 * dual[k].dot(&bend) * step * step
        });
        if [s, t].iter().any(|q| !(-OVERLAP..=1.0 + OVERLAP).contains(q)) {
            return None;
        }
        let root = [s, t].map(|q| q.clamp(0.0, 1.0));
        // The expansion's third order, and what it is worth: nothing where the surface has a kink.
        let off = (surface.position(root[0], root[1]) - self.ray.at(tau)).norm();
        // Written so that NaN does not hold.
        let holds = off <= 8.0 * self.noise(patch);
        if !holds {
            return None;
        }
        // The other end of a short chord is no root to report; the expansion is good to far better than
        // a hundredth here.
        let other = |e: &End| e.tau != end.tau && (tau - e.tau).abs() <= 0.01 * step.abs();
        let in_range = tau > self.t_min.max(0.0) && tau <= self.t_max;
        // Before the start and after the end the ray is none.
        if !in_range || (tau > end.tau) != (end.tau == 0.0) || self.ends.iter().any(other) {
            return Some(None);
        }
        // A share of the step is as uncertain as the expansion; the neighbour takes what falls there.
        if !patch.cell.contains([s, t], 1.0 + OVERLAP) {
            return Some(None);
        }
        Some(Some((tau, root[0], root[1])))
    }
}
