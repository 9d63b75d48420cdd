//! The lamps' own light on all meshes, which are refined until it is linear over their triangles.

use rayon::prelude::*;

use super::growth::{Growth, Light, Rule, grow};
use super::rows::ambient;
use super::{Sheet, SolverSettings};
use crate::geometry::Rgb;
use crate::receiver::TriangleMesh;
use crate::scene::Scene;
use crate::trace::tree::{Limits, Losses};
use crate::trace::{Anchor, Tracer};
use crate::transfer::{
    Components, Control, HemisphereSettings, Order, Receiver, ReceiverLight, Transfer, gather,
};

/// Part of the flux received that linear interpolation may be wrong by, in units of the accuracy.
const INTERPOLATION: f64 = 0.25;

/// The same of the light at a place.
const LOCAL: f64 = 0.5;

impl Light for ReceiverLight {
    fn luminance(&self) -> f64 {
        (self.direct + self.specular).luminance()
    }

    fn in_all(&self) -> f64 {
        self.luminance()
    }

    fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        let of = |a: Rgb, b: Rgb| a * (1.0 - fraction) + b * fraction;
        Self {
            direct: of(a.direct, b.direct),
            specular: of(a.specular, b.specular),
            error: a.error.max(b.error),
            met: false,
            stopped: true,
            ..Self::default()
        }
    }
}

/// Meshes lit by lamps, with first triangles of about `edge` [m]; whether there was time for it.
pub(super) fn illuminate<'s>(
    scene: &'s Scene,
    sheets: &[Sheet],
    transfer: &Transfer<'_>,
    tracer: &Tracer<'_>,
    edge: f64,
    settings: &SolverSettings,
    control: &Control<'_>,
) -> (Vec<Growth<'s, ReceiverLight>>, bool) {
    let of = |sheet: &Sheet| Growth {
        mesh: TriangleMesh::new(&scene.shape(sheet.shape).surface, edge),
        light: Vec::new(),
    };
    let mut growths: Vec<_> = sheets.iter().map(of).collect();
    let relative = settings.transfer.relative;
    let surfaces = sheets.iter().map(|s| (scene.shape(s.shape).surface.area(), s.reflectance));
    let ambient = ambient(scene.emitted_flux(), surfaces).luminance();
    let rule = Rule {
        stage: "light of lamps",
        allowed: &|received| INTERPOLATION * relative * received,
        shortest: super::SHORTEST * edge,
        allowed_here: &|light| LOCAL * relative * (light + ambient),
        fine: super::FINE * edge,
        max_vertices: settings.max_vertices,
    };
    let stop = || (control.order)() != Order::Go;
    let both = Components { direct: true, specular: true };
    let whole = grow(&mut growths, &rule, control, &|sheet, mesh, vertex| {
        let (receiver, _) = sheets[sheet].receiver(tracer, mesh, vertex);
        let light = transfer.light_until(&receiver, both, 0.0, &stop);
        (!light.stopped).then_some(light)
    });
    (growths, whole)
}

/// What of the lamps' flux does not come to diffuse surfaces [W]: by directions from points of their own.
pub(super) fn losses(scene: &Scene, tracer: &Tracer<'_>, limits: &Limits) -> Losses {
    let mut sum = Losses::default();
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
                let row = gather(tracer, &receiver, &start, &|_| Rgb::WHITE, &settings).row;
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
