//! Where rays meet a parametric surface, with certificates.
//!
//! On a patch `x(c + d) = x + x_s d_s + x_t d_t + r` with a proved bound of r, a ray `o + τ w` meets
//! the surface where d = M (o − x) − M r, with the two rows of M orthogonal to the ray and dual to
//! (x_s, x_t). Hence
//! - no root if |M (o − x)| − |M| |r| is outside the cell;
//! - at most one if ‖M E‖ < ½, E the bound of ∂x − ∂x(centre) (then d ↦ d − M g(d) contracts);
//!   Newton's iteration finds it or shows that it is not in the cell;
//! - otherwise the patch is split and its parts are asked.
//!
//! Splitting ends where the surface is flat to within rounding: there a ray that is still undecided
//! is tangent to it, or the parametrisation is singular.
//!
//! Guarantees: every root whose existence does not hang on rounding is found. A root is accepted a
//! little beyond the cell's border (10⁻¹³, or its own rounding error), so that borders do not leak. A
//! ray that starts on the surface does not meet it at its start: the cell that holds the start and
//! provably one root holds no other. Not guaranteed: whether a ray that is tangent to within rounding
//! (some 10⁻⁸ of the radius of curvature) is reported.

use arrayvec::ArrayVec;

use super::Parametric;
use super::patch::{Cell, OVERLAP, Patch};
use crate::geometry::{Aabb, Point3, Ray, Vector3};

/// Beyond the border of a cell [parameters] roots are accepted up to here at least: some hundred
/// rounding errors of a parameter near 1.
const BORDER: f64 = 1e-13;

/// Most parts of one leaf asked for one ray. Tangent rays need a few hundred, those through a pole up to
/// some thousand; the limit keeps pathological surfaces (a kink along the ray) from running away.
const MAX_PARTS: u32 = 10_000;

/// Within this of the start [sizes of the surface] a nearly tangent ray's second root is computed from
/// the second-order expansion at the start: further away ordinary certificates hold (they need
/// tangent angles above some 10⁻⁷), nearer they drown in rounding.
const NEAR_START: f64 = 1e-4;

/// Distance between ray and surface up to which a root is one [sizes of the surface].
const RESIDUAL: f64 = 1e-12;

/// What a patch says to a ray.
enum Verdict {
    Miss,
    /// At most one root.
    One(Certificate),
    /// Neither proved.
    Open,
}

/// A proof that a patch holds at most one root, and where that may be.
struct Certificate {
    /// First guess [parameters, from the centre].
    guess: [f64; 2],
    /// The root's rounding error [parameters].
    blur: [f64; 2],
    /// How far beyond the cell it is accepted [parameters].
    border: [f64; 2],
    /// ‖M E‖.
    contraction: f64,
    /// The same for τ: how much E may change it over the cell.
    tau_slope: f64,
}

/// A ray, and what is known of its start.
struct Query<'r> {
    ray: &'r Ray,
    /// 1/|w|².
    inverse_square: f64,
    /// Size of the origin's coordinates [m], for rounding errors.
    reach: f64,
    t_min: f64,
    t_max: f64,
    /// Where on the surface the ray starts, if it does and the leaf is near.
    start: Option<Start>,
}

/// A start on the surface.
#[derive(Clone, Copy)]
struct Start {
    /// (s, t).
    p: [f64; 2],
    /// The parameter (0: s, 1: t) that may be changed without leaving the point, if there is one: the
    /// start is a pole.
    idle: Option<usize>,
}

impl Parametric {
    /// Number of leaves: pieces with boxes of their own.
    pub fn leaf_count(&self) -> usize {
        self.leaves.patches.len()
    }

    /// The box of a leaf [m]: proved, rounding included.
    pub fn leaf_bounds(&self, leaf: usize) -> Aabb {
        self.leaves.patches.get(leaf).map_or(Aabb::EMPTY, |p| p.bounds)
    }

    /// The cell of a leaf.
    pub fn leaf_cell(&self, leaf: usize) -> Option<Cell> {
        self.leaves.patches.get(leaf).map(|p| p.cell)
    }

    /// Where the ray meets a leaf first with `t_min < τ ≤ t_max`: `(τ, s, t)`, τ in units of the ray's
    /// direction.
    ///
    /// `leaving` says that the ray starts on this surface, at these parameters; that root, and no
    /// other, is not reported.
    pub fn intersect_leaf(
        &self,
        leaf: usize,
        ray: &Ray,
        t_min: f64,
        t_max: f64,
        leaving: Option<(f64, f64)>,
    ) -> Option<(f64, f64, f64)> {
        let patch = self.leaves.patches.get(leaf)?;
        let mut moved = *ray;
        let mut start = None;
        if let Some((s, t)) = leaving {
            // Far from the start nothing special happens. Near it the ray starts exactly on the
            // surface: the caller's point may be off by more than our rounding.
            if patch.bounds.grown(NEAR_START * self.size).contains(&ray.origin) {
                let (x, xs, xt) = self.evaluator.jet1(s, t);
                moved.origin = x;
                let still = |v: &Vector3| v.norm() <= 16.0 * f64::EPSILON * self.size;
                let idle = if still(&xs) { Some(0) } else { still(&xt).then_some(1) };
                start = Some(Start { p: [s, t], idle });
            }
        }
        let query = Query {
            ray: &moved,
            inverse_square: 1.0 / moved.direction.norm_squared(),
            reach: moved.origin.coords.amax(),
            t_min,
            t_max,
            start,
        };
        match query.verdict(patch) {
            Verdict::Miss => None,
            Verdict::One(certificate) => query.single(self, patch, &certificate),
            Verdict::Open => query.divided(self, patch),
        }
    }

    /// Where the ray's line meets the surface continued beyond [0, 1]², by Newton's iteration from
    /// `guess` = (s, t): `(τ, s, t)`, τ of either sign. `None` if the iteration does not get to a
    /// residual below 10⁻¹² of the surface's size, or leaves the formulas' domain.
    pub fn extended_hit(&self, ray: &Ray, guess: (f64, f64)) -> Option<(f64, f64, f64)> {
        let w = &ray.direction;
        let inverse_square = 1.0 / w.norm_squared();
        let (mut s, mut t) = guess;
        let mut best: Option<(f64, f64, f64, f64)> = None;
        // Quadratic convergence takes five or six steps from a fair guess; what needs more than a
        // few dozen wanders.
        for _ in 0..32 {
            let (x, xs, xt) = self.evaluator.jet1(s, t);
            let along = (x - ray.origin).dot(w) * inverse_square;
            let r = ray.origin + w * along - x;
            let residual = r.norm();
            if !residual.is_finite() {
                return None;
            }
            if best.is_some_and(|(old, ..)| residual >= old) && residual <= RESIDUAL * self.size {
                break;
            }
            if best.is_none_or(|(old, ..)| residual < old) {
                best = Some((residual, along, s, t));
            }
            let ([ds, dt], _) = newton_step(&r, &xs, &xt, w)?;
            // A longer step than a quarter of the domain leaves the ground on which it was made.
            let scale = (0.25 / ds.abs().max(dt.abs())).min(1.0);
            (s, t) = (s + scale * ds, t + scale * dt);
        }
        best.filter(|(residual, ..)| *residual <= RESIDUAL * self.size)
            .map(|(_, along, s, t)| (along, s, t))
    }

    /// Where the ray meets the surface first: [`Parametric::intersect_leaf`] over all leaves.
    pub fn intersect(
        &self,
        ray: &Ray,
        t_min: f64,
        t_max: f64,
        leaving: Option<(f64, f64)>,
    ) -> Option<(f64, f64, f64)> {
        let inverse = ray.direction.map(|d| 1.0 / d);
        let nearest = std::cell::Cell::new((t_max, None));
        self.leaves.for_each(
            |b| meets(b, &ray.origin, &inverse, t_min, nearest.get().0),
            |leaf| {
                if let Some(hit) = self.intersect_leaf(leaf, ray, t_min, nearest.get().0, leaving) {
                    nearest.set((hit.0, Some(hit)));
                }
            },
        );
        nearest.get().1
    }
}

/// Whether a ray meets a box between two parameters (slabs, widened by a few roundings).
fn meets(b: &Aabb, origin: &Point3, inverse: &Vector3, t_min: f64, t_max: f64) -> bool {
    let (mut near, mut far) = (t_min, t_max);
    for i in 0..3 {
        if inverse[i].is_infinite() {
            if origin[i] < b.min[i] || origin[i] > b.max[i] {
                return false;
            }
            continue;
        }
        let a = (b.min[i] - origin[i]) * inverse[i];
        let c = (b.max[i] - origin[i]) * inverse[i];
        let (lo, hi) = if a <= c { (a, c) } else { (c, a) };
        near = if lo > near { lo } else { near };
        far = if hi < far { hi } else { far };
    }
    near <= far + 4.0 * f64::EPSILON * far.abs()
}

/// The step ((ds, dt), dτ) that takes the residual `r` = ray − surface to zero to first order.
fn newton_step(
    r: &Vector3,
    xs: &Vector3,
    xt: &Vector3,
    direction: &Vector3,
) -> Option<([f64; 2], f64)> {
    let n = xs.cross(xt);
    let dtau = -n.dot(r) / n.dot(direction);
    let p = r + direction * dtau;
    let inverse = 1.0 / n.norm_squared();
    let (ds, dt) = (p.cross(xt).dot(&n) * inverse, xs.cross(&p).dot(&n) * inverse);
    (ds.is_finite() && dt.is_finite() && dtau.is_finite()).then_some(([ds, dt], dtau))
}

impl Query<'_> {
    /// Rounding error of positions relative to the ray, near a patch [m]: of the formulas, and a few
    /// units in the last place of the coordinates.
    fn noise(&self, patch: &Patch) -> f64 {
        patch.noise + 8.0 * f64::EPSILON * (self.reach + patch.jet.x.coords.amax())
    }

    fn verdict(&self, patch: &Patch) -> Verdict {
        let (c, w, n) = (&patch.jet.x, &self.ray.direction, &patch.normal);
        // The ray's point nearest to the centre, and from there to the tangent plane.
        let to = c - self.ray.origin;
        let along = to.dot(w) * self.inverse_square;
        let r = w * along - to;
        let inverse = 1.0 / n.dot(w);
        let shift = -n.dot(&r) * inverse;
        let noise = self.noise(patch);
        // τ = τ0 + n·r/(n·w).
        let sag = patch.deviation(n);
        let tau_blur = noise * n.abs().sum() * inverse.abs();
        let dt = sag.remainder * inverse.abs() + tau_blur;
        let t0 = along + shift;
        if t0 + dt < self.t_min || t0 - dt > self.t_max {
            return Verdict::Miss;
        }
        let p = r + w * shift;
        let [mut guess, mut blur, mut border] = [[0.0; 2]; 3];
        let (mut contraction, mut certain) = (0f64, true);
        for k in 0..2 {
            let g = &patch.dual[k];
            let h = patch.cell.half[k];
            let row = g - n * (g.dot(w) * inverse);
            let bound = patch.deviation(&row);
            blur[k] = noise * row.abs().sum();
            guess[k] = g.dot(&p);
            // Its own rounding error, twice; never beyond what the bounds cover.
            border[k] = BORDER.min(OVERLAP * h).max(2.0 * blur[k]);
            if guess[k].abs() > h + border[k] + bound.remainder + blur[k] {
                return Verdict::Miss;
            }
            contraction = contraction.max(bound.slope / h);
            // Written so that NaN is not certain.
            certain &= border[k] <= OVERLAP * h && bound.slope < 0.5 * h;
        }
        if certain {
            let tau_slope = sag.slope * inverse.abs();
            Verdict::One(Certificate { guess, blur, border, contraction, tau_slope })
        } else {
            Verdict::Open
        }
    }

    /// The only root of a patch, if it is there, in range, and not the start.
    fn single(
        &self,
        surface: &Parametric,
        patch: &Patch,
        certificate: &Certificate,
    ) -> Option<(f64, f64, f64)> {
        if self.start.is_some_and(|start| patch.cell.contains(start.p, 1.0 + OVERLAP)) {
            return None; // the one root is the start
        }
        let (tau, [s, t], row) = self.newton(surface, patch, certificate)?;
        if !(tau > self.t_min && tau <= self.t_max) {
            return None;
        }
        if self.start.is_some() {
            // Where the surface passes through the start once more (a seam, a pole), the start is
            // recognised by its position, to within the rounding error of τ.
            if tau.abs() <= 4.0 * row * self.noise(patch) {
                return None;
            }
        }
        Some((tau, s, t))
    }

    /// Newton's iteration in a cell that holds at most one root: τ, parameters, and the sum of the
    /// row n/(n·w) that takes errors of positions to errors of τ.
    fn newton(
        &self,
        surface: &Parametric,
        patch: &Patch,
        certificate: &Certificate,
    ) -> Option<(f64, [f64; 2], f64)> {
        let Certificate { guess, blur, border, contraction, tau_slope } = *certificate;
        let (o, w) = (&self.ray.origin, &self.ray.direction);
        let (c, h) = (patch.cell.centre, patch.cell.half);
        let j = &patch.jet;
        // Second order from the centre: saves a step.
        let d = [0, 1].map(|k: usize| guess[k].clamp(-h[k], h[k]));
        let bend = (j.xuu * (d[0] * d[0]) + j.xvv * (d[1] * d[1])) * 0.5 + j.xuv * (d[0] * d[1]);
        let inverse = 1.0 / patch.normal.dot(w);
        let bend = bend - w * (patch.normal.dot(&bend) * inverse);
        let mut p: [f64; 2] = std::array::from_fn(|k| {
            c[k] + (guess[k] - patch.dual[k].dot(&bend)).clamp(-h[k], h[k])
        });
        // The root is within `contraction`/(1 − `contraction`) of a simplified step, in units of that
        // step; below ½ that is less than one.
        let doubt = contraction / (1.0 - contraction);
        for count in 0..64 {
            let (x, xs, xt) = surface.evaluator.jet1(p[0], p[1]);
            let along = (x - o).dot(w) * self.inverse_square;
            let r = o + w * along - x;
            // The step with the derivatives at the centre: slower, but in the cell it halves the error
            // at least, and 50 of them leave nothing.
            let simple = || {
                let dtau = -patch.normal.dot(&r) * inverse;
                let q = r + w * dtau;
                ([0, 1].map(|k: usize| patch.dual[k].dot(&q)), dtau)
            };
            // Newton's own steps have nearly always ended after three.
            let newton = count < 12;
            let (step, dtau) = if newton { newton_step(&r, &xs, &xt, w)? } else { simple() };
            let size = (step[0].abs() / h[0]).max(step[1].abs() / h[1]);
            let inside = (0..2).all(|k| (p[k] + step[k] - c[k]).abs() <= h[k] + border[k]);
            // Quadratic convergence: the next error is below the contraction times the square of this
            // step, and that of τ below its slope times the same. 10⁻¹⁵ of a cell or of τ is nothing, and little
            // is gained below the bound of the rounding error: a few steps are tried, for the error
            // itself is mostly smaller.
            let next = size * size;
            let rounded = count >= 4 && (0..2).all(|k| step[k].abs() <= blur[k]);
            let last = (newton
                && (contraction * next <= 1e-15 || rounded)
                && tau_slope * next <= 1e-15 * (along.abs() + tau_slope))
                || (!newton && rounded);
            if last || !inside {
                if last && inside {
                    let at = |k: usize| {
                        let q = p[k] + step[k];
                        // What the border lets through beyond the domain is rounding.
                        if c[k] - h[k] >= 0.0 && c[k] + h[k] <= 1.0 { q.clamp(0.0, 1.0) } else { q }
                    };
                    let n = xs.cross(&xt);
                    let row = n.abs().sum() / n.dot(w).abs();
                    return Some((along + dtau, [at(0), at(1)], row));
                }
                // Outside by more than the simplified step's error: proved that there is no root.
                let (simple, _) = simple();
                let length = (simple[0].abs() / h[0]).max(simple[1].abs() / h[1]);
                let out = |k: usize| {
                    let beyond = (p[k] + simple[k] - c[k]).abs() - h[k] - border[k];
                    beyond > doubt * length * h[k]
                };
                if out(0) || out(1) || last {
                    return None;
                }
            }
            p = [0, 1].map(|k: usize| c[k] + (p[k] + step[k] - c[k]).clamp(-h[k], h[k]));
        }
        None
    }

    /// Whether the patch touches the pole from which the ray starts, and provably holds no other root:
    /// if x does not change with s at t = t0, then x − start = (t − t0) ξ with ξ among the values of
    /// x_t over the patch, and the ray has to run through their box.
    fn departs(&self, surface: &Parametric, patch: &Patch) -> bool {
        let Some(Start { p, idle: Some(idle) }) = self.start else { return false };
        let k = 1 - idle;
        let (c, h) = (&patch.cell.centre, &patch.cell.half);
        // On which side of the pole the patch lies; it must not lie on both.
        let side = c[k] - p[k];
        if side.abs() > h[k] * (1.0 + OVERLAP) || side.abs() < h[k] * (1.0 - OVERLAP) {
            return false;
        }
        // The pole must be one all along the patch: the same point at both ends and in the middle.
        let one_point = [-1.0, 0.0, 1.0].iter().all(|a| {
            let mut q = p;
            q[idle] = c[idle] + a * h[idle];
            (surface.position(q[0], q[1]) - self.ray.origin).norm() <= 2.0 * self.noise(patch)
        });
        let velocity = if k == 0 { patch.jet.xu } else { patch.jet.xv };
        let (middle, error) = (velocity * side.signum(), patch.velocity_error(k));
        // A slab test: origin 0, direction w, box middle ± error.
        let (mut near, mut far) = (0f64, f64::INFINITY);
        for i in 0..3 {
            let (w, e) = (self.ray.direction[i], error[i]);
            let (a, b) = ((middle[i] - e) / w, (middle[i] + e) / w);
            // NaN cuts nothing.
            near = if a.min(b) > near { a.min(b) } else { near };
            far = if a.max(b) < far { a.max(b) } else { far };
        }
        one_point && near > far * (1.0 + 8.0 * f64::EPSILON)
    }

    /// Splits until every part is decided.
    #[cold]
    fn divided(&self, surface: &Parametric, whole: &Patch) -> Option<(f64, f64, f64)> {
        let mut nearest: Option<(f64, f64, f64)> = None;
        // Depth first: one waiting sibling a level, and parameters cannot be halved more often than
        // this down to 10⁻¹⁸.
        let mut waiting = ArrayVec::<Patch, 128>::new();
        waiting.push(whole.clone());
        let mut query = Query { ..*self };
        let inverse = self.ray.direction.map(|d| 1.0 / d);
        let mut parts = 0;
        while let Some(patch) = waiting.pop() {
            parts += 1;
            query.t_max = nearest.map_or(self.t_max, |(tau, ..)| tau);
            // Where derivatives are not bounded the box still is.
            if patch.has_kink()
                && !meets(&patch.bounds, &self.ray.origin, &inverse, 0.0, query.t_max)
            {
                continue;
            }
            let found = match query.verdict(&patch) {
                Verdict::Miss => None,
                Verdict::One(certificate) => query.single(surface, &patch, &certificate),
                Verdict::Open if query.departs(surface, &patch) => None,
                Verdict::Open => {
                    let flat = patch.is_flat(query.noise(&patch));
                    if flat || parts > MAX_PARTS || waiting.remaining_capacity() < 2 {
                        query.at_rounding(surface, &patch)
                    } else {
                        for cell in patch.cell.split(patch.split_axis()) {
                            waiting.push(patch.part(&surface.evaluator, cell));
                        }
                        None
                    }
                }
            };
            nearest = found.or(nearest);
        }
        nearest
    }

    /// A patch that is flat, or a point, to within rounding, and still undecided: the ray is tangent,
    /// or the parametrisation singular.
    fn at_rounding(&self, surface: &Parametric, patch: &Patch) -> Option<(f64, f64, f64)> {
        let extent = patch.extent();
        if let Some(start) = self.start {
            let x = self.ray.origin;
            if (patch.jet.x - x).norm() <= NEAR_START * surface.size + extent {
                return self.second_root(surface, patch, start.p);
            }
        }
        let slope = patch.normal.dot(&self.ray.direction)
            / (patch.normal.norm() * self.ray.direction.norm());
        if extent > NEAR_START * surface.size && slope.abs() * extent <= 8.0 * self.noise(patch) {
            return None; // a plane, and the ray in it or parallel to it
        }
        // The point of the patch nearest to the ray: least squares, then by turns to stay in the cell.
        // That closes in slowly along a common direction of both, but there any point will do.
        let w = &self.ray.direction;
        let across = |v: Vector3| v - w * (v.dot(w) * self.inverse_square);
        let (c, h) = (patch.cell.centre, patch.cell.half);
        let mut p = c;
        for _ in 0..4 {
            let (x, xs, xt) = surface.evaluator.jet1(p[0], p[1]);
            let (r, v) = (across(x - self.ray.origin), [across(xs), across(xt)]);
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
        let [s, t] = p;
        let x = surface.position(s, t);
        let tau = (x - self.ray.origin).dot(w) * self.inverse_square;
        let distance = (self.ray.at(tau) - x).norm();
        let near = distance <= RESIDUAL * surface.size;
        (near && tau > self.t_min && tau <= self.t_max).then_some((tau, s, t))
    }

    /// The second root of a nearly tangent ray close to its start, with the first divided out: for
    /// x(τ) = start + w τ, the normal part n·x_dd τ²/2 = n·w τ gives τ = 2 n·w / n·x_dd, where d is
    /// the ray's direction in parameters. Its relative error is of the order of τ times the change of
    /// curvature.
    fn second_root(
        &self,
        surface: &Parametric,
        patch: &Patch,
        start: [f64; 2],
    ) -> Option<(f64, f64, f64)> {
        let j = surface.jet(start[0], start[1]);
        if !surface.is_regular(&j) {
            return None; // at a pole there are no directions of parameters
        }
        let w = &self.ray.direction;
        let n = j.area_vector();
        let squared = n.norm_squared();
        let slope = n.dot(w);
        if slope.abs() <= 4.0 * f64::EPSILON * n.norm() * w.norm() {
            return None; // tangent: both roots are one
        }
        let dual = [j.xv.cross(&n) / squared, n.cross(&j.xu) / squared];
        let d = [dual[0].dot(w), dual[1].dot(w)];
        let bend = j.xuu * (d[0] * d[0]) + j.xuv * (2.0 * d[0] * d[1]) + j.xvv * (d[1] * d[1]);
        let tau = 2.0 * slope / n.dot(&bend);
        if !(tau > self.t_min.max(0.0) && tau <= self.t_max) {
            return None;
        }
        let [s, t] =
            std::array::from_fn(|k| start[k] + d[k] * tau - 0.5 * dual[k].dot(&bend) * tau * tau);
        // A share of the step is as uncertain as the expansion; the neighbour takes what falls there.
        if !patch.cell.contains([s, t], 1.0 + OVERLAP) {
            return None;
        }
        let (s, t) = (s.clamp(0.0, 1.0), t.clamp(0.0, 1.0));
        // The expansion's third order, and what it is worth: nothing where the surface has a kink.
        let off = (surface.position(s, t) - self.ray.at(tau)).norm();
        (off <= RESIDUAL * surface.size).then_some((tau, s, t))
    }
}
