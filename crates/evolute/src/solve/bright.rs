//! Where lamps throw much more light than elsewhere: first triangles that reflect more than others.

use std::collections::BTreeMap;

use super::{Layer, Sheet};
use crate::geometry::{Point3, UnitVector3, Vector3};
use crate::transfer::Bright;

/// How much brighter than the mean a first triangle is that counts.
const BRIGHT: f64 = 2.0;

/// Flux in a first triangle, and its moments.
#[derive(Clone, Copy, Default)]
struct Sum {
    flux: f64,
    area: f64,
    /// Flux × place, and × its square [W m, W m²].
    first: Vector3,
    second: f64,
    /// Normal of the front, by flux.
    normal: Vector3,
}

/// Bright places by the light of lamps on all sheets.
pub(super) fn bright_places(sheets: &[Sheet], layers: &[Layer<'_>; 3]) -> Vec<Bright> {
    let mut sums: BTreeMap<(usize, u32), Sum> = BTreeMap::new();
    for (component, layer) in layers.iter().take(2).enumerate() {
        for (s, mesh) in layer.meshes().iter().enumerate() {
            let (irradiance, reflectance) =
                (layer.irradiance(s), sheets[s].reflectance.luminance());
            for t in mesh.triangles() {
                let middle = mesh.at(t, [1.0 / 3.0; 3]);
                let sum = sums.entry((s, mesh.root_at(&middle))).or_default();
                let (corners, weights) = (mesh.corners(t), mesh.weights(t));
                let local = mesh.surface().local(&mesh.surface().at_chart(&middle));
                for (v, w) in corners.into_iter().zip(weights) {
                    let flux = irradiance[v as usize].luminance().max(0.0) * w * reflectance;
                    let x = mesh.vertices()[v as usize].position.coords;
                    sum.flux += flux;
                    // Both layers cover the same area.
                    sum.area += if component == 0 { w } else { 0.0 };
                    sum.first += x * flux;
                    sum.second += x.norm_squared() * flux;
                    sum.normal += local.map_or(Vector3::zeros(), |l| *l.n) * flux;
                }
            }
        }
    }
    let (flux, area) = sums.values().fold((0.0, 0.0), |(f, a), s| (f + s.flux, a + s.area));
    let mean = if area > 0.0 { flux / area } else { 0.0 };
    let bright = |((sheet, _), sum): (&(usize, u32), &Sum)| {
        let normal = UnitVector3::try_new(sum.normal, 0.0)?;
        let middle = sum.first / sum.flux;
        let variance = (sum.second / sum.flux - middle.norm_squared()).max(0.0);
        (sum.flux > BRIGHT * mean * sum.area).then(|| Bright {
            position: Point3::from(middle),
            normal: if sheets[*sheet].front { normal } else { -normal },
            radius: variance.sqrt(),
            flux: sum.flux - mean * sum.area,
        })
    };
    sums.iter().filter_map(bright).collect()
}
