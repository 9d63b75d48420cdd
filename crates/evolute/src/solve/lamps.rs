//! The lamps' own light on all meshes, which are refined until it is linear over their triangles.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::checkpoint::Known;
use super::growth::{Growth, Light, Rule, grow};
use super::landing::{Landing, specular_landings, straight_landings};
use super::rows::ambient;
use super::{Job, Layer};
use crate::geometry::Rgb;
use crate::receiver::TriangleMesh;
use crate::scene::Scene;
use crate::surface::ChartPoint;
use crate::trace::tree::{Limits, Losses};
use crate::trace::{Anchor, Tracer};
use crate::transfer::{
    Components, HemisphereSettings, Order, Receiver, Shining, Transfer, TransferSettings, gather,
};

/// How finely one part of the lamps' light is followed. All errors together are to be within the accuracy in the mean, at
/// the least cost: direct light costs little, reflected light most.
struct Fineness {
    stage: &'static str,
    components: Components,
    /// What is computed may be wrong by that much, in units of the accuracy.
    own: f64,
    /// Part of all flux that interpolation may be wrong by, in units of the accuracy: the sum without regard to sign,
    flux: f64,
    /// and edges down to which that counts, as a part of the first ones.
    shortest: f64,
    /// Part of the light at a place that linear interpolation may be wrong by, in units of the accuracy,
    local: f64,
    /// and edges down to which that counts: light of lamps may end anywhere.
    fine: f64,
    /// Vertices at which it ends, in units of those of reflected light, of which each takes a hundred times as much.
    most: usize,
}

const DIRECT: Fineness = Fineness {
    stage: "direct light",
    components: Components { direct: true, specular: false },
    own: 0.25,
    flux: 0.12,
    shortest: 1.0 / 64.0,
    local: 0.5,
    fine: 0.125,
    most: 5,
};

const SPECULAR: Fineness = Fineness {
    stage: "specular light",
    components: Components { direct: false, specular: true },
    own: 0.35,
    flux: 0.15,
    shortest: super::SHORTEST,
    local: 2.0,
    fine: 0.25,
    most: 1,
};

/// One part of the lamps' light at a vertex.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct LampLight {
    pub irradiance: Rgb,
    /// Estimated error of its luminance [W/m²].
    pub error: f64,
    /// Luminance of what is known to come there otherwise [W/m²].
    beside: f64,
}

impl LampLight {
    /// Whether all are finite numbers.
    pub fn is_finite(&self) -> bool {
        self.irradiance.is_finite() && self.error.is_finite() && self.beside.is_finite()
    }
}

impl Light for LampLight {
    fn luminance(&self) -> f64 {
        self.irradiance.luminance()
    }

    fn in_all(&self) -> f64 {
        self.luminance() + self.beside
    }

    fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        Self {
            irradiance: a.irradiance * (1.0 - fraction) + b.irradiance * fraction,
            error: a.error.max(b.error),
            beside: a.beside.max(b.beside),
        }
    }
}

/// Where the light of lamps lands, by rays: a rough picture of what is to be computed.
pub(super) struct Landings {
    straight: Vec<Landing>,
    specular: Vec<Landing>,
    /// All together [W].
    flux: Rgb,
}

impl Landings {
    pub fn new(job: &Job<'_, '_>) -> Self {
        let (straight, specular) = (straight_landings(job), specular_landings(job));
        let landed: f64 = straight.iter().chain(&specular).map(|l| l.flux).sum();
        let emitted = job.scene.emitted_flux();
        let all = emitted.luminance();
        let flux = if all > 0.0 { emitted * (landed / all) } else { Rgb::BLACK };
        Self { straight, specular, flux }
    }

    /// First meshes, which know what lands on them.
    fn on_meshes<'s>(job: &Job<'_, 's>, landings: &[Landing]) -> Vec<Growth<'s, LampLight>> {
        let mut growths = Growth::all(job);
        for landing in landings {
            growths[landing.sheet].landed.push((landing.site, landing.flux));
        }
        growths
    }
}

/// What lamps send straight; whether there was time for it.
pub(super) fn direct<'s>(
    job: &Job<'_, 's>,
    known: &mut Known<LampLight>,
    landings: &Landings,
) -> (Layer<'s>, bool) {
    let growths = Landings::on_meshes(job, &landings.straight);
    illuminate(job, &DIRECT, growths, known, landings.flux, 0.0, &|_, _| 0.0)
}

/// What lamps send by specular chains, in addition to direct light.
pub(super) fn specular<'s>(
    job: &Job<'_, 's>,
    known: &mut Known<LampLight>,
    landings: &Landings,
    direct: &Layer<'_>,
) -> (Layer<'s>, bool) {
    if !job.scene.shapes.iter().any(|s| s.material.is_specular()) {
        return (Layer::dark(job.scene, job.sheets, job.edge), true);
    }
    let beside = |sheet: usize, site: &ChartPoint| direct.at(sheet, site).luminance();
    let growths = Landings::on_meshes(job, &landings.specular);
    let known_flux = direct.flux().0.luminance();
    illuminate(job, &SPECULAR, growths, known, landings.flux, known_flux, &beside)
}

/// One part, if all that lamps send to surfaces comes to `landed` [W], beside a flux that is known otherwise [W] and what
/// it brings to a place, luminances [W/m²]. What is `known`
/// of it is not computed again; in the end all that was computed is.
fn illuminate<'s>(
    job: &Job<'_, 's>,
    fineness: &Fineness,
    mut growths: Vec<Growth<'s, LampLight>>,
    known: &mut Known<LampLight>,
    landed: Rgb,
    flux: f64,
    beside: &(dyn Fn(usize, &ChartPoint) -> f64 + Sync),
) -> (Layer<'s>, bool) {
    let Job { scene, sheets, tracer, edge, settings, control } = *job;
    let relative = settings.transfer.relative;
    let own = fineness.own * relative;
    let transfer =
        Transfer::new(scene, tracer, TransferSettings { relative: own, ..settings.transfer });
    let surfaces = || sheets.iter().map(|s| (scene.shape(s.shape).surface.area(), s.reflectance));
    let ambient = ambient(landed, surfaces()).luminance();
    let others = flux + ambient * surfaces().map(|(area, _)| area).sum::<f64>();
    let rule = Rule {
        stage: fineness.stage,
        allowed: &|received| fineness.flux * relative * (received + others),
        shortest: fineness.shortest * edge,
        allowed_here: &|light| fineness.local * relative * light,
        fine: fineness.fine * edge,
        max_vertices: fineness.most.saturating_mul(settings.max_vertices),
    };
    let stop = || (control.order)() != Order::Go;
    let whole = grow(job, &mut growths, &rule, known, &|sheet, mesh, vertex| {
        let (receiver, _) = sheets[sheet].receiver(tracer, mesh, vertex);
        // Other light will be there, too, so that shadows need not be known as well as if they were all there is.
        let site = &mesh.vertices()[vertex as usize].site;
        let beside = ambient + beside(sheet, site);
        let light = transfer.light_until(&receiver, fineness.components, own * beside, &stop);
        (!light.stopped).then_some(LampLight {
            irradiance: light.direct + light.specular,
            error: light.error,
            beside,
        })
    });
    *known = Known::of(&growths);
    let error = growths.iter().flat_map(|g| g.vertex_errors(|l| l.error)).collect();
    let irradiance = growths.iter().flat_map(|g| g.light.iter().map(|l| l.irradiance)).collect();
    let surprises: Vec<_> = growths.iter().map(Growth::surprises).collect();
    let meshes = growths.into_iter().map(|g| g.mesh).collect();
    let mut layer = Layer::new(sheets, meshes, irradiance, error);
    layer.bend();
    layer.estimate_interpolation(&surprises);
    (layer, whole)
}

/// What of the lamps' flux does not come to diffuse surfaces [W]: by directions from points of their own.
pub(super) fn losses(scene: &Scene, tracer: &Tracer<'_>, limits: &Limits) -> Losses {
    let mut sum = Losses::default();
    let even = Shining { radiosity: &|_| Rgb::WHITE, bright: &[] };
    for id in scene.lamps() {
        let shape = scene.shape(id);
        let area = shape.surface.area();
        // A few points, as a lamp's surroundings look much the same from all of it.
        let mesh = TriangleMesh::new(&shape.surface, (area / 4.0).sqrt());
        let mut areas = vec![0.0; mesh.vertices().len()];
        for t in mesh.triangles() {
            for (v, w) in mesh.corners(t).iter().zip(mesh.weights(t)) {
                areas[*v as usize] += w;
            }
        }
        let fates: Vec<Losses> = mesh
            .vertices()
            .par_iter()
            .map(|vertex| {
                let point = shape.surface.at_chart(&vertex.site);
                let Some(local) = shape.surface.local(&point) else { return Losses::default() };
                let receiver = Receiver { position: point.x, normal: local.n };
                let own = Anchor { shape: id, point };
                let others = tracer.contacts(&point.x).into_iter().filter(|a| a.shape != id);
                let start: Vec<Anchor> = std::iter::once(own).chain(others).collect();
                let settings =
                    HemisphereSettings { limits: *limits, tolerance: 1e-3, max_samples: 10_000 };
                let row = gather(tracer, &receiver, &start, &even, &settings).row;
                let mut both = row.losses[0];
                both += row.losses[1];
                both
            })
            .collect();
        let flux = shape.emitted_flux();
        for (fate, a) in fates.iter().zip(areas) {
            sum += *fate * (flux * (a / area));
        }
    }
    sum
}
