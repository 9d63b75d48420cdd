//! The integral of a polynomial over the part of a cell where several others are positive.
//!
//! Cells are halved (polynomials only, no ray is traced) until no constraint, one constraint that is
//! monotone along an axis, or nearly straight constraints remain. The second kind is integrated
//! along that axis in closed form and across it by Gauss's rule between the points where the curve
//! enters and leaves; the third is a polygon. Of several constraints at once, bounding planes show halves in which
//! together they leave nothing, and those that the others imply (chains of many reflections have twenty, and most of
//! their cells nothing).
//!
//! Guarantee: the error committed by taking nearly straight curves for straight is at most about
//! the tolerance given, or 1e-8 of the cell if that is more. Limit: it integrates the polynomials; how far they are
//! from the functions they stand for is the caller's concern.

use arrayvec::ArrayVec;

use super::polynomial::{Patch, cubic, cubic_derivative, cubic_integral};

/// Most constraints on one cell.
pub const MAX_CONSTRAINTS: usize = 20;
/// A cell is halved at most this many times along each axis: 2⁻¹² of a cell is below what its
/// polynomials resolve.
const MAX_DEPTH: u32 = 12;
/// A curve is followed across the cell where its slope varies this little: five Gauss nodes are then
/// right to about 1e-8 of the cell. Near a vertical tangent they would not be.
const EVENNESS: f64 = 0.65;
/// Nodes and weights of the 5-point Gauss-Legendre rule on [0, 1].
const GAUSS5: [(f64, f64); 5] = [
    (0.046_910_077_030_668_0, 0.118_463_442_528_094_54),
    (0.230_765_344_947_158_45, 0.239_314_335_249_683_24),
    (0.5, 0.284_444_444_444_444_45),
    (0.769_234_655_052_841_6, 0.239_314_335_249_683_24),
    (0.953_089_922_969_332, 0.118_463_442_528_094_54),
];
/// Nodes of the 2-point rule, exact for cubics; both weights are ½.
const GAUSS2: [f64; 2] = [0.211_324_865_405_187_1, 0.788_675_134_594_812_9];

/// One or three weights (colour channels).
pub type Weights = ArrayVec<Patch, 3>;
/// Constraints that vanish in a cell.
type Cuts = ArrayVec<Patch, MAX_CONSTRAINTS>;
/// Planes of constraints, and how far these are off them.
type Planes = ArrayVec<([f64; 3], f64), MAX_CONSTRAINTS>;
/// A convex polygon.
type Polygon = ArrayVec<[f64; 2], { MAX_CONSTRAINTS + 6 }>;
/// Integrals, a channel each.
pub type Integrals = [f64; 3];

/// ∫∫ w over the part of the unit cell where every constraint is positive, to about `tolerance`.
pub fn cut_integral(weights: &Weights, constraints: &[Patch], tolerance: f64) -> Integrals {
    let mut sum = [0.0; 3];
    recurse(weights, constraints, 1.0, tolerance, 0, &mut sum);
    sum
}

fn recurse(
    weights: &Weights,
    constraints: &[Patch],
    area: f64,
    tolerance: f64,
    depth: u32,
    sum: &mut Integrals,
) {
    let mut cuts = Cuts::new();
    for c in constraints {
        let (low, high) = c.bounds();
        if high <= 0.0 {
            return;
        }
        if low < 0.0 {
            cuts.push(*c);
        }
    }
    if cuts.is_empty() {
        for (s, w) in sum.iter_mut().zip(weights) {
            *s += area * w.integral();
        }
        return;
    }
    // How much of the cell the bends of the curves can be worth.
    let mut bend = 0.0;
    let mut planes = Planes::new();
    for c in &cuts {
        let (off, plane) = c.plane();
        let slope = (plane[1] * plane[1] + plane[2] * plane[2]).sqrt();
        bend += if off < slope { off / slope } else { 1.0 };
        planes.push((plane, off));
    }
    let heaviest =
        weights.iter().map(|w| w.bounds()).fold(0f64, |m, (l, h)| m.max(l.abs()).max(h.abs()));
    // A strip of that width is at most √2 long and may lie on either side.
    if 2.0 * bend * heaviest * area <= tolerance || depth >= MAX_DEPTH {
        return polygon(weights, &planes, area, sum);
    }
    let mut halves = [[true; 2]; 2];
    if cuts.len() > 1 {
        // What the planes leave, moved out by as much as the polynomials are off them, holds all that these leave:
        // nothing, often, though each of them leaves something; and of some all that the others leave.
        let around = clipped(&planes, 1.0);
        if around.is_empty() {
            return;
        }
        for (axis, [low, high]) in halves.iter_mut().enumerate() {
            *low = around.iter().any(|p| p[axis] < 0.0);
            *high = around.iter().any(|p| p[axis] > 0.0);
        }
        let mut at = planes.iter();
        cuts.retain(|_| {
            at.next().is_some_and(|(plane, off)| around.iter().any(|p| value(plane, p) <= *off))
        });
        if cuts.is_empty() {
            return recurse(weights, &cuts, area, tolerance, depth, sum);
        }
    }
    if let [only] = cuts.as_slice() {
        if only.trend_b(EVENNESS) != 0 {
            return arcs(weights, only, area, sum);
        }
        let across = only.transposed();
        if across.trend_b(EVENNESS) != 0 {
            let turned: Weights = weights.iter().map(Patch::transposed).collect();
            return arcs(&turned, &across, area, sum);
        }
    }
    let (mut wl, mut wr) = (Weights::new(), Weights::new());
    for w in weights {
        let (l, r) = w.split_a();
        wl.push(l);
        wr.push(r);
    }
    let (mut cl, mut cr) = (Cuts::new(), Cuts::new());
    for c in &cuts {
        let (l, r) = c.split_a();
        cl.push(l);
        cr.push(r);
    }
    let [[left, right], halves_b] = halves;
    if left {
        halve_b(&wl, &cl, 0.25 * area, tolerance, depth + 1, halves_b, sum);
    }
    if right {
        halve_b(&wr, &cr, 0.25 * area, tolerance, depth + 1, halves_b, sum);
    }
}

/// Both halves along b, as far as they are wanted.
fn halve_b(
    weights: &Weights,
    cuts: &[Patch],
    area: f64,
    tolerance: f64,
    depth: u32,
    [below, above]: [bool; 2],
    sum: &mut Integrals,
) {
    if cuts.iter().any(|c| c.bounds().1 <= 0.0) {
        return;
    }
    let (mut wl, mut wr) = (Weights::new(), Weights::new());
    for w in weights {
        let (l, r) = w.split_b();
        wl.push(l);
        wr.push(r);
    }
    let (mut cl, mut cr) = (Cuts::new(), Cuts::new());
    for c in cuts {
        let (l, r) = c.split_b();
        cl.push(l);
        cr.push(r);
    }
    // A quarter of the tolerance for each: areas shrink by four as well.
    if below {
        recurse(&wl, &cl, area, 0.25 * tolerance, depth, sum);
    }
    if above {
        recurse(&wr, &cr, area, 0.25 * tolerance, depth, sum);
    }
}

/// One constraint that rises or falls along b everywhere: a single curve b(a).
fn arcs(weights: &Weights, cut: &Patch, area: f64, sum: &mut Integrals) {
    let bottom = [cut.0[0], cut.0[4], cut.0[8], cut.0[12]];
    let top = [cut.0[3], cut.0[7], cut.0[11], cut.0[15]];
    let mut breaks: ArrayVec<f64, 8> = ArrayVec::new();
    breaks.push(0.0);
    breaks.extend(cubic_roots(&bottom));
    breaks.extend(cubic_roots(&top));
    breaks.push(1.0);
    breaks.sort_by(f64::total_cmp);
    for pair in breaks.windows(2) {
        let (from, to) = (pair[0], pair[1]);
        let length = to - from;
        if length <= 0.0 {
            continue;
        }
        let mid = 0.5 * (from + to);
        let (low, high) = (cubic(&bottom, mid) > 0.0, cubic(&top, mid) > 0.0);
        if low && high {
            for node in GAUSS2 {
                let a = from + node * length;
                for (s, w) in sum.iter_mut().zip(weights) {
                    *s += area * 0.5 * length * w.at_a(a).iter().sum::<f64>() * 0.25;
                }
            }
        } else if low != high {
            for (node, weight) in GAUSS5 {
                let a = from + node * length;
                let b = monotone_root(&cut.at_a(a));
                for (s, w) in sum.iter_mut().zip(weights) {
                    let row = w.at_a(a);
                    let below = cubic_integral(&row, b);
                    let part = if low { below } else { row.iter().sum::<f64>() * 0.25 - below };
                    *s += area * weight * length * part;
                }
            }
        }
    }
}

/// The root in [0, 1] of a cubic that rises or falls throughout, clamped to the ends.
fn monotone_root(c: &[f64; 4]) -> f64 {
    if (c[0] < 0.0) == (c[3] < 0.0) {
        // No sign change but for rounding: the end that is nearer to zero.
        return if c[0].abs() < c[3].abs() { 0.0 } else { 1.0 };
    }
    // By powers of t, so that value and slope cost five products.
    let (p1, p2) = (3.0 * (c[1] - c[0]), 3.0 * (c[2] - 2.0 * c[1] + c[0]));
    let p3 = c[3] - c[0] - p1 - p2;
    let rising = c[3] > c[0];
    let (mut low, mut high) = (0.0, 1.0);
    let mut t = c[0] / (c[0] - c[3]);
    // Newton, kept inside the bracket; it doubles its digits, so twenty rounds are never used up.
    for _ in 0..20 {
        let f = c[0] + t * (p1 + t * (p2 + t * p3));
        let slope = p1 + t * (2.0 * p2 + t * (3.0 * p3));
        if (f < 0.0) == rising {
            low = t;
        } else {
            high = t;
        }
        let next = t - f / slope;
        let next = if next >= low && next <= high { next } else { 0.5 * (low + high) };
        // A step of 1e-8 is followed by one of its square.
        if (next - t).abs() <= 1e-8 {
            return next;
        }
        t = next;
    }
    t
}

/// The roots in (0, 1) of a cubic in Bernstein form, each once.
fn cubic_roots(c: &[f64; 4]) -> ArrayVec<f64, 3> {
    let mut roots = ArrayVec::new();
    let (low, high) =
        c.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &x| (l.min(x), h.max(x)));
    if low > 0.0 || high < 0.0 {
        return roots;
    }
    // Where the derivative's quadratic p t² + q t + r vanishes.
    let d = [c[1] - c[0], c[2] - c[1], c[3] - c[2]];
    let (p, q, r) = (d[0] - 2.0 * d[1] + d[2], 2.0 * (d[1] - d[0]), d[0]);
    let mut stops: ArrayVec<f64, 4> = ArrayVec::new();
    stops.push(0.0);
    let disc = q * q - 4.0 * p * r;
    if disc > 0.0 {
        let s = -0.5 * (q + disc.sqrt().copysign(q));
        for t in [s / p, r / s] {
            if t > 0.0 && t < 1.0 {
                stops.push(t);
            }
        }
    }
    stops.push(1.0);
    stops.sort_by(f64::total_cmp);
    for pair in stops.windows(2) {
        let (mut low, mut high) = (pair[0], pair[1]);
        let (fl, fh) = (cubic(c, low), cubic(c, high));
        if (fl < 0.0) == (fh < 0.0) {
            continue;
        }
        let rising = fh > fl;
        let mut t = low + (high - low) * (fl / (fl - fh));
        for _ in 0..60 {
            let f = cubic(c, t);
            if (f < 0.0) == rising {
                low = t;
            } else {
                high = t;
            }
            let next = t - f / cubic_derivative(c, t);
            let next = if next > low && next < high { next } else { 0.5 * (low + high) };
            let step = (next - t).abs();
            t = next;
            // A step of 1e-8 is followed by one of its square.
            if step <= 1e-8 {
                break;
            }
        }
        if t > 0.0 && t < 1.0 && !roots.is_full() {
            roots.push(t);
        }
    }
    roots
}

/// The part of the unit cell, coordinates from its middle, where all planes, each moved out by `share` of how far its
/// polynomial is off it, are positive; no corners if there is none.
fn clipped(planes: &Planes, share: f64) -> Polygon {
    let mut shape = Polygon::new();
    shape.extend([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]);
    for (plane, off) in planes {
        let value = |p: &[f64; 2]| value(plane, p) + share * off;
        let mut kept = Polygon::new();
        for k in 0..shape.len() {
            let (p, q) = (shape[k], shape[(k + 1) % shape.len()]);
            let (fp, fq) = (value(&p), value(&q));
            if fp > 0.0 && !kept.is_full() {
                kept.push(p);
            }
            if (fp > 0.0) != (fq > 0.0) && !kept.is_full() {
                let t = fp / (fp - fq);
                kept.push([p[0] + t * (q[0] - p[0]), p[1] + t * (q[1] - p[1])]);
            }
        }
        shape = kept;
        if shape.len() < 3 {
            return Polygon::new();
        }
    }
    shape
}

fn value([c, ga, gb]: &[f64; 3], p: &[f64; 2]) -> f64 {
    c + ga * p[0] + gb * p[1]
}

/// All constraints taken as straight: clip the unit square, integrate the weights as planes.
fn polygon(weights: &Weights, planes: &Planes, area: f64, sum: &mut Integrals) {
    let [size, ma, mb] = moments(&clipped(planes, 0.0));
    for (s, w) in sum.iter_mut().zip(weights) {
        let (_, [c, ga, gb]) = w.plane();
        *s += area * (c * size + ga * ma + gb * mb);
    }
}

/// A convex polygon's area and first moments.
fn moments(shape: &Polygon) -> [f64; 3] {
    let (mut size, mut ma, mut mb) = (0.0, 0.0, 0.0);
    let Some((first, others)) = shape.split_first() else { return [0.0; 3] };
    for pair in others.windows(2) {
        let (p, q) = (pair[0], pair[1]);
        let t =
            0.5 * ((p[0] - first[0]) * (q[1] - first[1]) - (p[1] - first[1]) * (q[0] - first[0]));
        size += t;
        ma += t * (first[0] + p[0] + q[0]) / 3.0;
        mb += t * (first[1] + p[1] + q[1]) / 3.0;
    }
    [size, ma, mb]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::optics::Dual;

    fn patch(f: impl Fn(f64, f64) -> Dual) -> Patch {
        Patch::hermite(&[f(0.0, 0.0), f(1.0, 0.0), f(0.0, 1.0), f(1.0, 1.0)], 1.0, 1.0)
    }

    fn weights(p: Patch) -> Weights {
        let mut w = Weights::new();
        w.push(p);
        w
    }

    /// A quarter disc (a quadratic is exact in the blend's space).
    #[test]
    fn quarter_disc() {
        for r in [0.3, 0.8, 1.1] {
            let e = patch(|a, b| Dual::new(r * r - a * a - b * b, -2.0 * a, -2.0 * b));
            let one = weights(patch(|_, _| Dual::constant(1.0)));
            let exact = if r <= 1.0 {
                0.25 * std::f64::consts::PI * r * r
            } else {
                let x = (r * r - 1.0f64).sqrt();
                let t = (x / r).asin();
                x + 0.5 * r * r * (0.5 * std::f64::consts::PI - 2.0 * t)
            };
            for tolerance in [1e-2, 1e-4, 1e-6, 1e-8] {
                let got = cut_integral(&one, &[e], tolerance)[0];
                assert!((got - exact).abs() < 2.0 * tolerance.max(1e-8), "{r} {got} {exact}");
            }
        }
    }

    /// A rotated square, several constraints at once, and a tiny one that no corner sees.
    #[test]
    fn squares() {
        let one = weights(patch(|a, _| Dual::new(1.0 + a, 1.0, 0.0)));
        for half in [0.2, 0.01, 1e-4] {
            let (c, s) = (0.8, 0.6);
            let side = |u: f64, v: f64| {
                patch(move |a, b| Dual::new(half - u * (a - 0.37) - v * (b - 0.61), -u, -v))
            };
            let cuts = [side(c, s), side(-c, -s), side(-s, c), side(s, -c)];
            let exact = 4.0 * half * half * 1.37;
            let got = cut_integral(&one, &cuts, 1e-6 * exact)[0];
            assert!((got / exact - 1.0).abs() < 1e-9, "{half} {got} {exact}");
        }
    }

    /// Two curved constraints meet in a corner.
    #[test]
    fn lens_of_two_discs() {
        let one = weights(patch(|_, _| Dual::constant(1.0)));
        let disc = |x: f64| {
            patch(move |a, b| {
                let (p, q) = (a - x, b - 0.5);
                Dual::new(0.16 - p * p - q * q, -2.0 * p, -2.0 * q)
            })
        };
        let (r, d) = (0.4f64, 0.4f64);
        let exact = 2.0 * r * r * (d / (2.0 * r)).acos() - 0.5 * d * (4.0 * r * r - d * d).sqrt();
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let got = cut_integral(&one, &[disc(0.3), disc(0.7)], tolerance)[0];
            assert!((got - exact).abs() < tolerance, "{got} {exact}");
        }
    }
}
