//! Meshes that grow where light is not linear over their triangles.

use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::checkpoint::Known;
use super::contact::Contacts;
use super::layer::VertexError;
use super::{Job, Sheet};
use crate::receiver::TriangleMesh;
use crate::surface::ChartPoint;
use crate::transfer::{Control, Order};

/// What is computed at a vertex.
pub(super) trait Light: Clone + Send + Sync {
    /// Luminance of the irradiance [W/m²].
    fn luminance(&self) -> f64;
    /// The same and all other light there, as far as it is known [W/m²].
    fn in_all(&self) -> f64;
    /// Something for a vertex between two others for which there was no time.
    fn between(a: &Self, b: &Self, fraction: f64) -> Self;
}

/// A mesh and what was computed at its vertices.
pub(super) struct Growth<'s, L> {
    pub mesh: TriangleMesh<'s>,
    pub light: Vec<L>,
    /// By vertex: whether that was computed, and not put together of others for want of time.
    pub is_computed: Vec<bool>,
    /// Light that lands on it, as rays from the lamps say: where, and its luminance [W].
    pub landed: Vec<(ChartPoint, f64)>,
}

/// When to stop.
pub(super) struct Rule<'r> {
    /// What is computed, for people who wait for it.
    pub stage: &'static str,
    /// Flux that interpolation may be wrong by, summed without regard to sign, given the flux that the meshes receive,
    /// luminances [W].
    pub allowed: &'r dyn Fn(f64) -> f64,
    /// No edge becomes shorter than this [m].
    pub shortest: f64,
    /// Irradiance that interpolation may be wrong by where there is so much light, luminances [W/m²]. Where it is
    /// not, triangles are cut too, down to edges of `fine` [m]: beside an edge of light there would be no end.
    pub allowed_here: &'r dyn Fn(f64) -> f64,
    pub fine: f64,
    /// Vertices at which it ends.
    pub max_vertices: usize,
}

/// What rays from the lamps say counts beyond so many standard deviations of what lands by chance, and this part of the
/// light: from near a large lamp they are few.
const CHANCE: f64 = 3.0;
const COARSE: f64 = 0.5;

/// Each round cuts the worst triangles that have this part of the error.
const EACH_ROUND: f64 = 0.5;

/// What is too much may be so in triangles that are as small as they may be. Then it is enough if others have this part of
/// what is allowed: to refine them for what they have not would have no end.
const MENDED: f64 = 0.5;

/// What interpolation over a triangle is wrong by, in the mean [W/m²].
struct InterpolationError {
    triangle: u32,
    /// Of what is read off.
    quadratic: f64,
    /// If nothing were known of second derivatives: what they say may be chance where triangles are large.
    linear: f64,
}

impl<'s, L: Send> Growth<'s, L> {
    /// The first meshes of all sheets, not lit yet, with seams where things stand on them.
    pub fn all(job: &Job<'_, 's>) -> Vec<Self> {
        let growth = |sheet: &Sheet| {
            let mut mesh = TriangleMesh::new(&job.scene.shape(sheet.shape).surface, job.edge);
            Contacts::new(job.tracer, sheet, job.edge).mend(&mut mesh, 0);
            Self { mesh, light: Vec::new(), is_computed: Vec::new(), landed: Vec::new() }
        };
        job.sheets.par_iter().map(growth).collect()
    }
}

impl<L: Light + Default> Growth<'_, L> {
    fn luminance(&self, vertex: u32) -> f64 {
        self.light.get(vertex as usize).map_or(0.0, Light::luminance)
    }

    /// Flux, its luminance [W].
    fn received(&self) -> f64 {
        let of = |t: u32| {
            let (corners, weights) = (self.mesh.corners(t), self.mesh.weights(t));
            (0..3).map(|c| self.luminance(corners[c]) * weights[c]).sum::<f64>()
        };
        self.mesh.triangles().map(of).sum()
    }

    /// By triangle that light landed in: irradiance of that, in the mean, beyond what the corners let expect, either
    /// way, and what the number of rays lets be chance [W/m²].
    pub fn surprises(&self) -> HashMap<u32, f64> {
        let mut sums: HashMap<u32, (f64, f64)> = HashMap::new();
        for (site, flux) in &self.landed {
            let (sum, squares) = sums.entry(self.mesh.locate(site).triangle).or_default();
            *sum += flux;
            *squares += flux * flux;
        }
        let surprise = |(t, (sum, squares)): (u32, (f64, f64))| {
            let area: f64 = self.mesh.weights(t).iter().sum();
            let known = self.mesh.corners(t).map(|v| self.luminance(v)).iter().sum::<f64>() / 3.0;
            let (landed, chance) = (sum / area, CHANCE * squares.sqrt() / area);
            let sure = (landed - known).abs() - chance - COARSE * landed.max(known);
            (t, sure.max(0.0))
        };
        sums.into_iter().map(surprise).collect()
    }

    /// Irradiance that interpolation over triangles is wrong by, roughly and without sign [W/m²], or more where rays
    /// from the lamps say so.
    fn errors(&self) -> Vec<InterpolationError> {
        let surprises = self.surprises();
        let value = |v| self.luminance(v);
        let of = |(triangle, quadratic): (u32, f64)| {
            let linear = self.mesh.linear_errors(triangle, &value).into_iter().flatten();
            let surprise = surprises.get(&triangle).copied().unwrap_or(0.0);
            InterpolationError {
                triangle,
                quadratic: quadratic.max(surprise),
                linear: linear.fold(surprise, f64::max),
            }
        };
        self.mesh.quadratic_errors(&value).into_iter().map(of).collect()
    }

    /// By vertex: the error of its own light.
    pub fn vertex_errors(&self, own: impl Fn(&L) -> f64) -> impl Iterator<Item = VertexError> {
        self.light.iter().map(move |light| VertexError { own: own(light), passed_on: 0.0 })
    }
}

/// Computes light at all vertices, and cuts triangles: all where the light itself is not known well enough, and
/// the worst first until the flux that the interpolation which is read off is wrong by is what the rule allows: by the
/// same estimate as the solution's. `compute` (sheet, mesh, vertex) is `None` once there is no time left; whether there
/// was. What is `known` is taken, and not computed.
pub(super) fn grow<'s, L: Light + Default + Sync>(
    job: &Job<'_, 's>,
    growths: &mut [Growth<'s, L>],
    rule: &Rule<'_>,
    known: &mut Known<L>,
    compute: &(dyn Fn(usize, &TriangleMesh<'s>, u32) -> Option<L> + Sync),
) -> bool {
    let control = job.control;
    let count = |growths: &[Growth<'s, L>]| -> usize {
        growths.iter().map(|g| g.mesh.vertices().len()).sum()
    };
    loop {
        if !compute_new(growths, rule.stage, control, known, compute) {
            return false;
        }
        let received: f64 = growths.iter().map(Growth::received).sum();
        let mut errors: Vec<(f64, usize, u32)> = Vec::new();
        let mut coarse: Vec<(usize, u32)> = Vec::new();
        let estimates: Vec<_> = growths.par_iter().map(Growth::errors).collect();
        for (i, (g, estimates)) in growths.iter().zip(estimates).enumerate() {
            for InterpolationError { triangle: t, quadratic, linear } in estimates {
                errors.push((quadratic * g.mesh.weights(t).iter().sum::<f64>(), i, t));
                let in_all = |v: &u32| g.light.get(*v as usize).map_or(0.0, Light::in_all);
                let light = g.mesh.corners(t).iter().map(in_all).sum::<f64>() / 3.0;
                if linear > (rule.allowed_here)(light)
                    && g.mesh.longest_edge(t).1 >= 2.0 * rule.fine
                {
                    coarse.push((i, t));
                }
            }
        }
        let sum: f64 = errors.iter().map(|e| e.0).sum();
        errors.retain(|&(_, i, t)| growths[i].mesh.longest_edge(t).1 >= 2.0 * rule.shortest);
        errors.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mendable: f64 = errors.iter().map(|e| e.0).sum();
        let allowed = (rule.allowed)(received);
        let vertices = count(growths);
        let enough = sum <= allowed || mendable <= MENDED * allowed;
        if (enough && coarse.is_empty()) || vertices >= rule.max_vertices {
            return true;
        }
        let mut left = if enough { 0.0 } else { EACH_ROUND * mendable };
        for &(error, i, t) in &errors {
            if left <= 0.0 || error <= 0.0 {
                break;
            }
            coarse.push((i, t));
            left -= error;
        }
        coarse.sort_unstable();
        coarse.dedup();
        for of_sheet in coarse.chunk_by(|a, b| a.0 == b.0) {
            let sheet = of_sheet[0].0;
            let mesh = &mut growths[sheet].mesh;
            let first = mesh.triangle_count();
            for &(_, t) in of_sheet {
                // Unless a neighbour's cut went through it.
                if mesh.is_whole(t) {
                    mesh.cut(t, mesh.longest_edge(t).0, 0.5);
                }
            }
            Contacts::new(job.tracer, &job.sheets[sheet], job.edge).mend(mesh, first);
        }
        if count(growths) == vertices {
            return true;
        }
    }
}

/// Computes light at the vertices that have none yet; whether there was time.
fn compute_new<'s, L: Light + Default>(
    growths: &mut [Growth<'s, L>],
    stage: &'static str,
    control: &Control<'_>,
    known: &mut Known<L>,
    compute: &(dyn Fn(usize, &TriangleMesh<'s>, u32) -> Option<L> + Sync),
) -> bool {
    let mut new: Vec<(usize, u32, Option<L>)> = growths
        .iter()
        .enumerate()
        .flat_map(|(i, g)| {
            (g.light.len() as u32..g.mesh.vertices().len() as u32).map(move |v| (i, v, None))
        })
        .collect();
    for (i, v, light) in &mut new {
        *light = known.take(*i, *v, &growths[*i].mesh.vertices()[*v as usize].site);
    }
    let (done, all) = (AtomicU64::new(0), new.len() as u64);
    new.par_iter_mut().for_each(|(i, v, light)| {
        (control.progress)(stage, done.fetch_add(1, Ordering::Relaxed), all);
        if light.is_none() && (control.order)() == Order::Go {
            *light = compute(*i, &growths[*i].mesh, *v);
        }
    });
    let mut whole = true;
    for (i, v, light) in new {
        let g = &mut growths[i];
        g.is_computed.push(light.is_some());
        let light = light.unwrap_or_else(|| {
            whole = false;
            g.mesh.vertices()[v as usize].parents.map_or_else(L::default, |([a, b], fraction)| {
                L::between(&g.light[a as usize], &g.light[b as usize], fraction)
            })
        });
        g.light.push(light);
    }
    whole
}
