//! What every vertex of the reflected light's meshes sees, gathered once.

use serde::{Deserialize, Serialize};

use super::checkpoint::Known;
use super::growth::{Growth, Light, Rule, grow};
use super::transport::{Fate, StoredRow};
use super::{Job, Solution};
use crate::geometry::Rgb;
use crate::receiver::TriangleMesh;
use crate::trace::tree::{Leaf, Limits};
use crate::transfer::{HemisphereSettings, Shining, gather};

/// Part of the tolerance that is for the cubature of reflected light.
const GATHERING: f64 = 0.45;

/// Part of all flux that interpolation may be wrong by, in units of the accuracy.
const INTERPOLATION: f64 = 0.25;

/// Part of the light at a place that linear interpolation may be wrong by.
const LOCAL: f64 = 1.0;

/// Edges down to which that counts, as a part of the first ones.
const FINE: f64 = 0.125;

/// Most samples of a row.
const MAX_SAMPLES: usize = 20_000;

/// What a vertex sees.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Seen {
    /// Irradiance by the lamps' light that was reflected once, and by the rest as if it were even: roughly what
    /// all of it will come to [W/m²].
    irradiance: Rgb,
    /// What lamps bring, its luminance [W/m²].
    lamps: f64,
    /// Estimated error of the luminance of the irradiance [W/m²].
    pub error: f64,
    pub row: StoredRow,
    pub fate: Fate,
    pub rays: u64,
}

impl Seen {
    /// Whether all are finite numbers.
    pub fn is_finite(&self) -> bool {
        self.irradiance.is_finite()
            && self.lamps.is_finite()
            && self.error.is_finite()
            && self.row.is_finite()
            && self.fate.is_finite()
    }
}

impl Light for Seen {
    fn luminance(&self) -> f64 {
        self.irradiance.luminance()
    }

    fn in_all(&self) -> f64 {
        self.luminance() + self.lamps
    }

    fn between(a: &Self, b: &Self, fraction: f64) -> Self {
        Self {
            irradiance: a.irradiance * (1.0 - fraction) + b.irradiance * fraction,
            lamps: a.lamps.max(b.lamps),
            error: a.error.max(b.error),
            fate: if fraction < 0.5 { a.fate } else { b.fate },
            ..Self::default()
        }
    }
}

/// Mean irradiance of diffuse surfaces that reflected light comes to, roughly, if lamps send so much flux to
/// surfaces of such areas and reflectances [W, m², W/m²].
pub(super) fn ambient(flux: Rgb, surfaces: impl Iterator<Item = (f64, Rgb)>) -> Rgb {
    let (mut area, mut reflected) = (0.0, Rgb::BLACK);
    for (a, reflectance) in surfaces {
        area += a;
        reflected += reflectance * a;
    }
    if area <= 0.0 {
        return Rgb::BLACK;
    }
    Rgb(std::array::from_fn(|i| {
        let reflectance = (reflected[i] / area).min(0.99);
        flux[i] / area * reflectance / (1.0 - reflectance)
    }))
}

/// Gathers rows, finely enough for the light that lamps throw on all surfaces and what it comes to; whether there was
/// time for it. What is `known` is not gathered again.
pub(super) fn gather_rows<'s>(
    job: &Job<'_, 's>,
    solution: &Solution<'_>,
    limits: &Limits,
    known: &mut Known<Seen>,
) -> (Vec<Growth<'s, Seen>>, bool) {
    let Job { scene, sheets, tracer, edge, settings, .. } = *job;
    let [direct, specular, _] = &solution.layers;
    let received = direct.flux().0 + specular.flux().0;
    let surfaces = direct.area.iter().copied().zip(direct.reflectance.iter().copied());
    let ambient = ambient(received, surfaces);
    let mut growths = Growth::all(job);
    let transfer = &settings.transfer;
    let rule = Rule {
        stage: "reflected light",
        allowed: &|own| INTERPOLATION * transfer.relative * (own + received.luminance()),
        shortest: super::SHORTEST * edge,
        allowed_here: &|light| LOCAL * transfer.relative * light,
        fine: FINE * edge,
        max_vertices: settings.max_vertices,
    };
    let radiosity = |leaf: &Leaf| {
        // Indirect light is not there yet.
        let light = solution.of_lamps(scene, leaf).unwrap_or_default();
        (light + ambient) * leaf.reflectance
    };
    let whole = grow(job, &mut growths, &rule, known, &|sheet, mesh: &TriangleMesh<'_>, v| {
        let (receiver, start) = sheets[sheet].receiver(tracer, mesh, v);
        let site = &mesh.vertices()[v as usize].site;
        let light = direct.at(sheet, site) + specular.at(sheet, site);
        let expected = (light + ambient).luminance();
        let tolerance = (GATHERING * transfer.relative * expected).max(transfer.absolute);
        let settings = HemisphereSettings { limits: *limits, tolerance, max_samples: MAX_SAMPLES };
        let shining = Shining { radiosity: &radiosity, bright: solution.bright() };
        let gathered = gather(tracer, &receiver, &start, &shining, &settings);
        Some(Seen {
            irradiance: gathered.irradiance,
            lamps: light.luminance(),
            error: gathered.error,
            row: StoredRow::new(&gathered.row, &|link| solution.sheet_of(link.shape, link.front)),
            fate: Fate::new(&gathered.row),
            rays: gathered.rays,
        })
    });
    (growths, whole)
}
