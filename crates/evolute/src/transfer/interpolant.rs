//! The polynomials that stand for the integrand in one cell: weights, and the edge functions that may
//! vanish in it, from values and gradients at the corners and the centre.

use arrayvec::ArrayVec;

use super::cut::{Integrals, Weights, cut_integral};
use super::field::{FieldSample, MAX_FIELD_EDGES};
use super::landing::Darkness;
use super::polynomial::{Patch, cubic};
use crate::geometry::Rgb;
use crate::optics::Dual;

/// Share of the tolerance that one cell's curves may be straightened for.
const CUT_SHARE: f64 = 1e-3;
/// Share of a cell to which its lit part is known for its centroid to be found.
const CENTROID_ACCURACY: f64 = 1e-4;
/// A cell is dark when an edge function is negative by this share of how far its polynomial bends.
const DARK_MARGIN: f64 = 0.5;
/// Share of an edge function's bend in a cell by which it may be off where no sample is positive.
const UNSEEN_MARGIN: f64 = 0.5;
/// Share of a gradient's residual that counts as a value's: the residual of a quartic has that slope
/// half way to the side.
const GRADIENT_SHARE: f64 = 0.25;
/// Share of the centre's residual that is left after the bump at the centre took it up.
const LEFT_AFTER_BUMP: f64 = 0.5;
/// Share of a weight that samples of a torn cell may disagree about and still give its slope: at the
/// border where a surface begins to reflect all light, the transmittance falls to zero like a root.
const STEEP_SHARE: f64 = 0.25;
/// A cell whose edges, shifted, sweep less than this share of the tolerance needs no closer look: a
/// few dozen such cells are still well within it.
const NEGLIGIBLE_SHIFT: f64 = 2e-3;

/// Samples at (0,0), (1,0), (0,1), (1,1); `None` where the chain does not exist.
pub type Corners<'a> = [Option<&'a FieldSample>; 4];
/// Edge functions through the corners. Few of the many that there may be are there, and moving room for all took a
/// quarter of the time for direct light.
pub type Edges = Vec<Patch>;

/// The lamp's radiance [W/(m² sr)] and how many channels the weights have.
#[derive(Clone, Copy)]
pub struct Light {
    /// Radiance.
    pub radiance: Rgb,
    /// One, if the throughput is the same in all channels; else three.
    pub channels: usize,
}

impl Light {
    /// Irradiance of an integral over weights.
    pub fn irradiance(&self, integral: Integrals) -> Rgb {
        if self.channels == 1 { self.radiance * integral[0] } else { Rgb(integral) * self.radiance }
    }

    /// Its luminance.
    pub fn luminance(&self, integral: Integrals) -> f64 {
        self.irradiance(integral).luminance()
    }
}

/// The polynomials of one cell, over the unit square; weights carry the cell's area.
pub struct Interpolant {
    /// What the weights are multiplied by.
    pub light: Light,
    weights: Weights,
    weight_residual: f64,
    cuts: Vec<Patch>,
    shifts: ArrayVec<f64, MAX_FIELD_EDGES>,
}

impl Interpolant {
    /// The edge functions through the corners of a cell of side `h`.
    ///
    /// # Errors
    ///
    /// Why the cell is dark, if one of them says so with a margin for how much it bends.
    pub fn edges(corners: &Corners<'_>, guessed: bool, h: f64) -> Result<Edges, Darkness> {
        let missing = corners.iter().filter(|c| c.is_none()).count();
        let count = corners.iter().flatten().map(|c| c.edges.len()).min().unwrap_or(0);
        let mut edges = Edges::new();
        for k in 0..count {
            let patch = hermite(corners, h, |s| s.edges[k]);
            let negative = if missing == 0 || !guessed {
                is_dark(&patch, 1 + missing)
            } else {
                corners.iter().flatten().all(|s| stays_negative(&s.edges[k], h))
            };
            if negative {
                return Err(darkness(corners, k));
            }
            edges.push(patch);
        }
        Ok(edges)
    }

    /// Takes the centre in; where chains are missing, weights may reach the `ceiling` between the samples.
    ///
    /// # Errors
    ///
    /// Why the cell is dark, if it is even with its edges shifted by what they miss there.
    pub fn new(
        corners: &Corners<'_>,
        centre: Option<&FieldSample>,
        edges: Edges,
        guessed: bool,
        h: f64,
        light: Light,
        ceiling: f64,
    ) -> Result<Self, Darkness> {
        let torn = corners.iter().chain([&centre]).any(|s| s.is_none());
        let doubtful = torn && guessed;
        let left =
            |value: f64, slope: f64| LEFT_AFTER_BUMP * (value.abs() + GRADIENT_SHARE * slope);
        let mut weights = Weights::new();
        let mut weight_residual = 0.0;
        for c in 0..light.channels {
            let mut patch = hermite(corners, h, |s| s.weight[c] * (h * h));
            if torn {
                let (plane, doubt) = torn_weight(corners, centre, h, |s| s.weight[c] * (h * h));
                patch = plane;
                let share = if light.channels == 1 { 1.0 } else { LUMINANCE[c] };
                let more = (ceiling * h * h - plane.bounds().1).max(0.0);
                weight_residual += share * (doubt + STEEP_SHARE * more);
            } else if let Some(s) = centre {
                let (value, slope) = residual(&patch, &(s.weight[c] * (h * h)), h);
                patch.add_bump(value);
                let share = if light.channels == 1 { 1.0 } else { LUMINANCE[c] };
                weight_residual += share * left(value, slope);
            }
            weights.push(patch);
        }
        // The samples, and how much of a side it is from them to the farthest point.
        let samples = || {
            let reaches = [1.0, 1.0, 1.0, 1.0, 0.5];
            let all = corners.iter().copied().chain([centre]).zip(reaches);
            all.filter_map(|(s, reach)| Some((s?, reach)))
        };
        // Only edges that may vanish in the cell matter.
        let (mut cuts, mut shifts) = (Vec::new(), ArrayVec::new());
        for (k, mut patch) in edges.into_iter().enumerate() {
            let mut shift = 0.0;
            if let Some(s) = centre {
                let (value, slope) = residual(&patch, &s.edges[k], h);
                patch.add_bump(value);
                shift = left(value, slope);
            }
            if doubtful {
                shift += patch.plane().0;
                if samples().all(|(s, reach)| stays_negative(&s.edges[k], reach * h)) {
                    return Err(darkness(corners, k));
                }
            }
            // A function that is negative at all five samples may still be positive between them: the
            // more it bends, the less they say. Without this a round lamp inside a large cell is lost.
            if samples().all(|(s, _)| s.edges[k].v <= 0.0) {
                shift += UNSEEN_MARGIN * patch.plane().0;
            }
            let (low, high) = patch.bounds();
            if high + shift < 0.0 && !doubtful {
                return Err(darkness(corners, k));
            }
            if low - shift < 0.0 {
                cuts.push(patch);
                shifts.push(shift);
            }
        }
        Ok(Self { light, weights, weight_residual, cuts, shifts })
    }

    /// Luminance of the largest weight over the whole cell [W/m²].
    pub fn most(&self) -> f64 {
        let most = self.weights.iter().fold(0f64, |m, w| m.max(w.bounds().1));
        self.light.luminance([most; 3])
    }

    /// How much curves may be straightened for, in the weights' unit.
    fn straightening(&self, tolerance: f64) -> f64 {
        if tolerance > 0.0 {
            CUT_SHARE * tolerance / self.light.radiance.luminance().max(f64::MIN_POSITIVE)
        } else {
            CUT_SHARE * self.weights.first().map_or(0.0, Patch::integral).abs()
        }
    }

    /// The integral over the lit part and the error of its luminance.
    pub fn lit(&self, tolerance: f64) -> (Integrals, f64) {
        let luminance = |v: Integrals| self.light.luminance(v);
        let full: Integrals =
            std::array::from_fn(|c| self.weights.get(c).map_or(0.0, Patch::integral));
        if self.cuts.is_empty() {
            return (full, luminance([self.weight_residual; 3]).abs());
        }
        let straight = self.straightening(tolerance);
        let exact = cut_integral(&self.weights, &self.cuts, straight);
        let moved =
            self.cuts.iter().zip(&self.shifts).map(|(c, s)| displacement(c, *s)).sum::<f64>();
        let swept = self.most() * moved;
        let (shift_error, wide) = if swept <= NEGLIGIBLE_SHIFT * tolerance {
            // The strip that the shift sweeps is worth nothing; its size need not be known.
            (swept, exact)
        } else {
            let shifted = |sign: f64| -> Vec<Patch> {
                self.cuts.iter().zip(&self.shifts).map(|(c, s)| c.shifted(sign * s)).collect()
            };
            let wide = cut_integral(&self.weights, &shifted(1.0), straight);
            let narrow = cut_integral(&self.weights, &shifted(-1.0), straight);
            let missed = (luminance(exact) - 0.5 * (luminance(wide) + luminance(narrow))).abs();
            (0.5 * (luminance(wide) - luminance(narrow)).abs() + missed, wide)
        };
        let lit = if full[0].abs() > 0.0 { (wide[0] / full[0]).clamp(0.0, 1.0) } else { 1.0 };
        let straightened = if lit > 0.0 { luminance([straight; 3]) * 0.25 } else { 0.0 };
        let weight_error = luminance([self.weight_residual * lit; 3]).abs();
        // No cut can be worth more than the whole cell.
        let cut_error = (shift_error + straightened).min(self.most());
        (exact, cut_error + weight_error)
    }

    /// The integral where one more polynomial is positive, too.
    pub fn behind(&mut self, border: Patch, tolerance: f64) -> Integrals {
        // There is room for one more than a field has edges.
        self.cuts.push(border);
        cut_integral(&self.weights, &self.cuts, self.straightening(tolerance))
    }

    /// Puts the other side of the last cut in the place of the one that counts.
    pub fn turn_last_cut(&mut self) {
        if let Some(cut) = self.cuts.last_mut() {
            *cut = Patch(cut.0.map(|c| -c));
        }
    }

    /// Whether edge functions vanish in the cell.
    pub fn is_cut(&self) -> bool {
        !self.cuts.is_empty()
    }

    /// The point of a coarse grid where the least edge function is largest.
    pub fn brightest_point(&self) -> (f64, f64) {
        let mut best = (f64::NEG_INFINITY, (0.5, 0.5));
        for (least, at) in self.least_over_raster().into_iter().zip(raster()) {
            if least > best.0 {
                best = (least, at);
            }
        }
        best.1
    }

    /// Up to six points of the lit part: its centroid, which alone tells of a strip between a coarse grid's
    /// points, that one of them where the least edge function is largest, and the outermost ones along both
    /// diagonals.
    pub fn lit_points(&self) -> ArrayVec<(f64, f64), 6> {
        let mut points = ArrayVec::new();
        points.extend(self.centroid().filter(|at| self.least(*at) > 0.0));
        let lit: ArrayVec<[f64; 3], RASTER> = raster()
            .zip(self.least_over_raster())
            .map(|((a, b), least)| [a, b, least])
            .filter(|[_, _, least]| *least > 0.0)
            .collect();
        let ways = [[0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]];
        for way in ways.into_iter().chain([[-1.0, -1.0, 0.0]]) {
            let value = |p: &[f64; 3]| (0..3).map(|k| way[k] * p[k]).sum::<f64>();
            let best = lit.iter().max_by(|p, q| value(p).total_cmp(&value(q)));
            if let Some([a, b, _]) = best
                && !points.contains(&(*a, *b))
            {
                points.push((*a, *b));
            }
        }
        points
    }

    /// Centroid of the lit part.
    fn centroid(&self) -> Option<(f64, f64)> {
        let at = |k: usize| k as f64 / 3.0;
        let moments: Weights =
            [Patch([1.0; 16]), Patch::tensor(|i, _| at(i)), Patch::tensor(|_, j| at(j))].into();
        let [area, a, b] = cut_integral(&moments, &self.cuts, CENTROID_ACCURACY);
        (area > 0.0).then(|| (a / area, b / area))
    }

    /// The least edge function at a point, each as a share of its range in the cell.
    fn least(&self, (a, b): (f64, f64)) -> f64 {
        self.cuts.iter().fold(f64::INFINITY, |least, c| least.min(c.value(a, b) / range(c)))
    }

    /// The same at the points of the coarse grid.
    fn least_over_raster(&self) -> [f64; RASTER] {
        let mut least = [f64::INFINITY; RASTER];
        for c in &self.cuts {
            let range = range(c);
            let points = raster_side().flat_map(|a| {
                let row = c.at_a(a);
                raster_side().map(move |b| cubic(&row, b))
            });
            for (least, value) in least.iter_mut().zip(points) {
                *least = least.min(value / range);
            }
        }
        least
    }
}

/// How far the coefficients of a polynomial go apart, not nought.
fn range(patch: &Patch) -> f64 {
    let (low, high) = patch.bounds();
    (high - low).max(f64::MIN_POSITIVE)
}

/// The plane that stands for a weight in a torn cell, and how far it may be off: what the samples that
/// exist (those of legal chains, if there are any) say of the centre, and how much they disagree.
fn torn_weight(
    corners: &Corners<'_>,
    centre: Option<&FieldSample>,
    h: f64,
    pick: impl Fn(&FieldSample) -> Dual,
) -> (Patch, f64) {
    let known = || corners.iter().copied().chain([centre]).zip(OFF_CENTRE);
    let legal = known().any(|(s, _)| s.is_some_and(|s| s.legal));
    let mut said: ArrayVec<(f64, Dual), 5> = ArrayVec::new();
    for (s, [da, db]) in known().filter_map(|(s, at)| Some((s?, at))) {
        if s.legal == legal {
            let w = pick(s);
            said.push((w.v, Dual::new(w.v - h * (w.a * da + w.b * db), w.a * h, w.b * h)));
        }
    }
    let share = 1.0 / said.len().max(1) as f64;
    let range = |f: &dyn Fn(&(f64, Dual)) -> f64| {
        let (low, high) = said
            .iter()
            .map(f)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        (high - low).max(0.0)
    };
    let level = said.iter().map(|s| s.0).sum::<f64>() * share;
    let apart = range(&|s| s.1.v);
    if said.len() > 1 && apart < STEEP_SHARE * level.abs() {
        let mean = said.iter().fold(Dual::default(), |sum, s| sum + s.1 * share);
        let corner =
            |da: f64, db: f64| Dual::new(mean.v + mean.a * da + mean.b * db, mean.a, mean.b);
        let [p, q, r, s, _] = OFF_CENTRE.map(|[da, db]| corner(da, db));
        return (Patch::hermite(&[p, q, r, s], 1.0, 1.0), apart);
    }
    (Patch([level; 16]), range(&|s| s.0) + STEEP_SHARE * level.abs())
}

/// The corners and the centre of a unit cell, from its centre.
const OFF_CENTRE: [[f64; 2]; 5] = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.0, 0.0]];

/// Points of a coarse grid over a cell, and of one side of it.
const RASTER: usize = RASTER_SIDE * RASTER_SIDE;
const RASTER_SIDE: usize = 9;

/// The points of a coarse grid over a cell.
fn raster() -> impl Iterator<Item = (f64, f64)> {
    raster_side().flat_map(|a| raster_side().map(move |b| (a, b)))
}

fn raster_side() -> impl Iterator<Item = f64> {
    (0..RASTER_SIDE).map(|k| k as f64 / (RASTER_SIDE - 1) as f64)
}

/// What the k-th edge function of a cell tells when it is negative all over.
fn darkness(corners: &Corners<'_>, k: usize) -> Darkness {
    let borders = corners.iter().flatten().map(|c| c.borders).min().unwrap_or(0);
    if k < borders { Darkness::NoChain } else { Darkness::NoLight }
}

/// Whether an edge function that is known at one place stays negative within `reach` of it though its
/// slope may double on the way: towards the border where chains cease to exist it often does.
pub fn stays_negative(edge: &Dual, reach: f64) -> bool {
    edge.v + 2.0 * reach * (edge.a.abs() + edge.b.abs()) < 0.0
}

/// Whether one edge function stays negative within `reach` of all of some samples.
pub fn misses(samples: &[&FieldSample], reach: f64) -> bool {
    let count = samples.iter().map(|s| s.edges.len()).min().unwrap_or(0);
    (0..count).any(|k| samples.iter().all(|s| stays_negative(&s.edges[k], reach)))
}

/// Whether an edge function is negative all over a cell, with a margin for how much it bends, times
/// `caution`.
pub fn is_dark(edge: &Patch, caution: usize) -> bool {
    edge.bounds().1 < -DARK_MARGIN * caution as f64 * edge.plane().0
}

/// An upper estimate of the area that a constraint's zero sweeps when it is shifted, as a part of the
/// unit cell; one where the constraint bends too much to tell.
fn displacement(constraint: &Patch, shift: f64) -> f64 {
    let (off, [_, ga, gb]) = constraint.plane();
    let slope = (ga * ga + gb * gb).sqrt() - 3.0 * off;
    // A straight line through the cell is at most √2 long.
    if slope > 0.0 { (1.5 * shift / slope).min(1.0) } else { 1.0 }
}

/// Shares of the channels in luminance.
const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Differences of value and of gradient (as a sum) at the centre between the field and the patch.
fn residual(patch: &Patch, truth: &Dual, h: f64) -> (f64, f64) {
    let p = patch.centre();
    (truth.v - p.v, (truth.a * h - p.a).abs() + (truth.b * h - p.b).abs())
}

/// The patch through the corners; corners where the field does not exist are extrapolated from the
/// others.
fn hermite(corners: &Corners<'_>, h: f64, pick: impl Fn(&FieldSample) -> Dual) -> Patch {
    const AT: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let known: [Option<Dual>; 4] = std::array::from_fn(|k| corners[k].map(&pick));
    let data: [Dual; 4] = std::array::from_fn(|k| {
        known[k].unwrap_or_else(|| {
            let (mut sum, mut count) = (Dual::default(), 0.0);
            for (m, d) in known.iter().enumerate() {
                if let Some(d) = d {
                    let (da, db) = (AT[k][0] - AT[m][0], AT[k][1] - AT[m][1]);
                    sum = sum + Dual::new(d.v + h * (d.a * da + d.b * db), d.a, d.b);
                    count += 1.0;
                }
            }
            sum * (1.0 / count)
        })
    });
    Patch::hermite(&data, h, h)
}
