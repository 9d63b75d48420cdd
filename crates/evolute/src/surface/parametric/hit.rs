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
use super::newton::newton_step;
use super::patch::{Cell, OVERLAP, Patch};
use crate::geometry::{Aabb, Point3, Ray, Vector3};

/// Beyond the border of a cell [parameters] roots are accepted up to here at least: some hundred
/// rounding errors of a parameter near 1.
const BORDER: f64 = 1e-13;

/// Most parts of one leaf asked for one ray. Tangent rays need a few hundred, those through a pole up to
/// some thousand; the limit keeps pathological surfaces (a kink along the ray) from running away.
const MAX_PARTS: u32 = 10_000;

/// Within this of an end [sizes of the surface] a nearly tangent ray's second root is computed from the
/// second-order expansion at that end: further away ordinary certificates hold (they need
/// tangent angles above some 10⁻⁷), nearer they drown in rounding.
pub(super) const NEAR_END: f64 = 1e-4;

/// Distance between ray and surface up to which a root is one [sizes of the surface].
pub(super) const RESIDUAL: f64 = 1e-12;

/// What a patch says to a ray.
enum Verdict {
    Miss,
    /// At most one root.
    One(Certificate),
    /// Neither proved.
    Open,
}

/// A proof that a patch holds at most one root, and where that may be.
#[derive(Clone, Copy)]
pub(super) struct Certificate {
    /// First guess [parameters, from the centre].
    pub guess: [f64; 2],
    /// The root's rounding error [parameters].
    pub blur: [f64; 2],
    /// How far beyond the cell it is accepted [parameters].
    pub border: [f64; 2],
    /// ‖M E‖.
    pub contraction: f64,
    /// The same for τ: how much E may change it over the cell.
    pub tau_slope: f64,
}

/// A ray, and what is known of its ends.
pub(super) struct Query<'r> {
    pub ray: &'r Ray,
    /// 1/|w|².
    pub inverse_square: f64,
    /// Size of the origin's coordinates [m], for rounding errors.
    pub reach: f64,
    pub t_min: f64,
    pub t_max: f64,
    /// Ends of the ray that lie on the surface, if the leaf is near them: roots not to be reported.
    pub ends: &'r [End],
}

/// An end of a ray that lies on the surface.
#[derive(Clone, Copy)]
pub(super) struct End {
    /// (s, t).
    pub p: [f64; 2],
    /// Position [m].
    pub x: Point3,
    /// The ray parameter there.
    pub tau: f64,
    /// The parameter (0: s, 1: t) that may be changed without leaving the point, if there is one: the
    /// end is a pole.
    pub idle: Option<usize>,
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
        self.intersect_leaf_between(leaf, ray, [t_min, t_max], leaving, None)
    }

    /// As [`Parametric::intersect_leaf`], with `arriving` the parameters of the surface's point at
    /// τ = t_max, if the ray ends on this surface: that root is not reported either. What is found then
    /// lies between the ends.
    pub fn intersect_leaf_between(
        &self,
        leaf: usize,
        ray: &Ray,
        [t_min, t_max]: [f64; 2],
        leaving: Option<(f64, f64)>,
        arriving: Option<(f64, f64)>,
    ) -> Option<(f64, f64, f64)> {
        let patch = self.leaves.patches.get(leaf)?;
        let mut moved = *ray;
        let mut ends = ArrayVec::<End, 2>::new();
        if leaving.is_some() || arriving.is_some() {
            // Far from an end nothing special happens. Near it the ray passes exactly through the
            // surface's point: the caller's may be off by more than our rounding.
            let near = patch.bounds.grown(NEAR_END * self.size);
            if let Some(p) = leaving.filter(|_| near.contains(&ray.origin)) {
                ends.push(self.end(p, 0.0));
                moved.origin = ends[0].x;
            }
            if let Some(p) = arriving.filter(|_| near.contains(&ray.at(t_max))) {
                let end = self.end(p, t_max);
                moved.direction = (end.x - moved.origin) / t_max;
                ends.push(end);
            }
        }
        let query = Query {
            ray: &moved,
            inverse_square: 1.0 / moved.direction.norm_squared(),
            reach: moved.origin.coords.amax(),
            t_min,
            t_max,
            ends: &ends,
        };
        match query.verdict(patch) {
            Verdict::Miss => None,
            Verdict::One(certificate) => query.single(self, patch, &certificate),
            Verdict::Open => query.divided(self, patch),
        }
    }

    fn end(&self, (s, t): (f64, f64), tau: f64) -> End {
        let (x, xs, xt) = self.evaluator.jet1(s, t);
        let still = |v: &Vector3| v.norm() <= 16.0 * f64::EPSILON * self.size;
        let idle = if still(&xs) { Some(0) } else { still(&xt).then_some(1) };
        End { p: [s, t], x, tau, idle }
    }

    /// Where the ray's line meets the surface continued beyond [0, 1]², by Newton's iteration from
    /// `guess` = (s, t): `(τ, s, t)`, τ of either sign. `None` if the iteration does not get to a
    /// residual below 10⁻¹² of the surface's size, or leaves the formulas' domain.
    ///
    /// A root at `known` = (s, t), where the ray leaves the surface, is not the one asked for: there the
    /// system is deflated (Farrell, Birkisson & Funke 2015), which turns Newton's step around.
    pub fn extended_hit(
        &self,
        ray: &Ray,
        guess: (f64, f64),
        known: Option<(f64, f64)>,
    ) -> Option<(f64, f64, f64)> {
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
            let turn = known.map_or(1.0, |known| deflation((s - known.0, t - known.1), (ds, dt)));
            let (ds, dt) = (turn * ds, turn * dt);
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

/// What Newton's step `step` is to be multiplied by, `off` away from a root that is known, to be a step
/// for the system times 1 + 1/|off|².
fn deflation(off: (f64, f64), step: (f64, f64)) -> f64 {
    let square = off.0 * off.0 + off.1 * off.1;
    let towards = -2.0 * (off.0 * step.0 + off.1 * step.1);
    // Of the logarithm of the factor, along the step.
    let slope = towards / (square * (1.0 + square));
    let turn = 1.0 / (1.0 - slope);
    if turn.is_finite() { turn } else { 1.0 }
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

impl Query<'_> {
    /// Rounding error of positions relative to the ray, near a patch [m]: of the formulas, and a few
    /// units in the last place of the coordinates.
    pub(super) fn noise(&self, patch: &Patch) -> f64 {
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

    /// The only root of a patch, if it is there, in range, and no end of the ray.
    fn single(
        &self,
        surface: &Parametric,
        patch: &Patch,
        certificate: &Certificate,
    ) -> Option<(f64, f64, f64)> {
        if self.ends.iter().any(|end| patch.cell.contains(end.p, 1.0 + OVERLAP)) {
            return None; // the one root is the end
        }
        let (tau, [s, t], row) = self.newton(surface, patch, certificate)?;
        if !(tau > self.t_min && tau <= self.t_max) {
            return None;
        }
        // Where the surface passes through the end once more (a seam, a pole), the end is recognised by
        // its position, to within the rounding error of τ.
        let doubt = 4.0 * row * self.noise(patch);
        if self.ends.iter().any(|end| (tau - end.tau).abs() <= doubt) {
            return None;
        }
        Some((tau, s, t))
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
                    let axis = query.split_axis(&patch);
                    if patch.is_flat(query.noise(&patch))
                        || !patch.cell.is_divisible(axis)
                        || parts > MAX_PARTS
                        || waiting.remaining_capacity() < 2
                    {
                        query.at_rounding(surface, &patch)
                    } else {
                        for cell in patch.cell.split(axis) {
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
}
