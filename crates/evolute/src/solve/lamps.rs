//! The lamps' own light on all meshes, which are refined until it is linear over their triangles.

use rayon::prelude::*;

use super::{Sheet, SolverSettings};
use crate::geometry::Rgb;
use crate::receiver::TriangleMesh;
use crate::scene::Scene;
use crate::trace::tree::{Limits, Losses};
use crate::trace::{Anchor, Tracer};
use crate::transfer::{HemisphereSettings, Receiver, Transfer, gather};

/// Part of the flux received that linear interpolation may be wrong by, in units of the accuracy.
const INTERPOLATION: f64 = 0.5;

/// Each round cuts the worst triangles that have this part of the error.
const EACH_ROUND: f64 = 0.5;

/// Lights all vertices, and cuts triangles, the worst first, until the flux that linear interpolation is
/// wrong by, summed without regard to sign, is a part of the accuracy; no edge becomes shorter than a
/// fixed part of the first ones.
pub(super) fn illuminate(
    sheets: &mut [Sheet<'_>],
    transfer: &Transfer<'_>,
    tracer: &Tracer<'_>,
    shortest: f64,
    settings: &SolverSettings,
) {
    loop {
        light_new(sheets, transfer, tracer);
        let received: f64 = sheets.iter().map(Sheet::received).sum();
        let mut errors: Vec<(f64, usize, u32)> = Vec::new();
        for (i, sheet) in sheets.iter().enumerate() {
            errors.extend(sheet.mesh.triangles().map(|t| (sheet.interpolation_error(t), i, t)));
        }
        let sum: f64 = errors.iter().map(|e| e.0).sum();
        let vertices: usize = sheets.iter().map(|s| s.mesh.vertices().len()).sum();
        if sum <= INTERPOLATION * settings.transfer.relative * received
            || vertices >= settings.max_vertices
        {
            return;
        }
        errors.retain(|&(_, i, t)| sheets[i].mesh.longest_edge(t).1 >= 2.0 * shortest);
        errors.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut left = EACH_ROUND * sum;
        for &(error, i, t) in &errors {
            if left <= 0.0 || error <= 0.0 {
                break;
            }
            let longest = sheets[i].mesh.longest_edge(t).0;
            sheets[i].mesh.cut(t, longest, 0.5);
            left -= error;
        }
        if sheets.iter().map(|s| s.mesh.vertices().len()).sum::<usize>() == vertices {
            return;
        }
    }
}

/// Lights the vertices that are not lit yet.
fn light_new(sheets: &mut [Sheet<'_>], transfer: &Transfer<'_>, tracer: &Tracer<'_>) {
    let missing: Vec<(usize, u32)> = sheets
        .iter()
        .enumerate()
        .flat_map(|(i, s)| {
            (s.lamps.len() as u32..s.mesh.vertices().len() as u32).map(move |v| (i, v))
        })
        .collect();
    let lights: Vec<_> =
        missing.par_iter().map(|&(i, v)| sheets[i].light(transfer, tracer, v)).collect();
    for ((i, _), light) in missing.into_iter().zip(lights) {
        sheets[i].lamps.push(light);
    }
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
