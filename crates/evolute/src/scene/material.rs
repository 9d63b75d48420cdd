//! bsdf plugins → [`Material`].

use std::collections::BTreeMap;

use crate::geometry::Rgb;

use super::description::{Child, Kind, Object, SceneDescription};
use super::message::{Checked, Complaint};
use super::model::{Dielectric, Material, Mirror, SideMaterial};
use super::source::Span;
use super::spectrum::Quantity;

/// Mitsuba 3's `diffuse` without a reflectance.
const DEFAULT_REFLECTANCE: f64 = 0.5;

/// Materials of a description; each is made once, however often it is referred to.
pub(super) struct Materials<'d> {
    description: &'d SceneDescription,
    made: BTreeMap<usize, Material>,
}

impl<'d> Materials<'d> {
    pub(super) fn new(description: &'d SceneDescription) -> Self {
        Self { description, made: BTreeMap::new() }
    }

    /// The material of a shape: its bsdf, else Mitsuba 3's default, which on a lamp is black.
    pub(super) fn of_shape(&mut self, shape: &Object, is_lamp: bool) -> Checked<Material> {
        match self.bsdfs(shape).as_slice() {
            [] => Ok(diffuse(Rgb::grey(if is_lamp { 0.0 } else { DEFAULT_REFLECTANCE }))),
            [bsdf] => self.of(bsdf.object),
            [first, second, ..] => Err(Complaint::at(second.span, "a second bsdf in a shape")
                .related(first.span, "the first")
                .help("mix two with a <bsdf type=\"blendbsdf\">, or give each side its own with \"twosided\"")),
        }
    }

    fn bsdfs(&self, object: &Object) -> Vec<Child> {
        self.description.children_of(object, Kind::Bsdf).collect()
    }

    /// The material of a bsdf. Nesting is bounded by the description.
    pub(super) fn of(&mut self, index: usize) -> Checked<Material> {
        if let Some(material) = self.made.get(&index) {
            return Ok(*material);
        }
        let description = self.description;
        let bsdf = &description.objects[index];
        let material = match bsdf.plugin.value.as_str() {
            "diffuse" => {
                diffuse(bsdf.reflectance("reflectance")?.unwrap_or(Rgb::grey(DEFAULT_REFLECTANCE)))
            }
            "conductor" => conductor(bsdf)?,
            "dielectric" => dielectric(bsdf)?,
            "twosided" => self.twosided(bsdf)?,
            _ => self.blend(bsdf)?,
        };
        self.made.insert(index, material);
        Ok(material)
    }

    fn twosided(&mut self, bsdf: &Object) -> Checked<Material> {
        let inside = self.bsdfs(bsdf);
        let mut sides = Vec::new();
        for child in &inside {
            let material = self.of(child.object)?;
            if material.dielectric.is_some() {
                return Err(Complaint::at(child.span, "a dielectric inside \"twosided\"")
                    .related(bsdf.span, "inside this")
                    .help("a dielectric has two sides of its own: use it without \"twosided\""));
            }
            sides.push(material.front);
        }
        let (front, back) = match sides.as_slice() {
            [both] => (*both, *both),
            [front, back] => (*front, *back),
            _ => {
                return Err(Complaint::at(
                    bsdf.span,
                    format!("\"twosided\" with {} bsdfs inside", sides.len()),
                )
                .help("put one inside, for both sides, or two, for the front and the back"));
            }
        };
        Ok(Material { front, back, dielectric: None })
    }

    fn blend(&mut self, bsdf: &Object) -> Checked<Material> {
        let weight = bsdf.colour("weight", Quantity::Factor)?.ok_or_else(|| {
            Complaint::at(bsdf.span, "\"blendbsdf\" needs a weight").help(
                "write <float name=\"weight\" value=\"0.3\"/>: the share of the second bsdf inside",
            )
        })?;
        let weight = match weight.0 {
            [r, g, b] if r == g && g == b && r <= 1.0 => r,
            [r, g, b] if r == g && g == b => {
                return Err(Complaint::at(
                    bsdf.place("weight"),
                    format!("a weight must be between 0 and 1, but it is {r}"),
                ));
            }
            _ => {
                return Err(Complaint::at(bsdf.place("weight"), "a weight that is a colour")
                    .help("give one number; for coloured parts give them coloured reflectances"));
            }
        };
        let [first, second] = self.bsdfs(bsdf)[..] else {
            return Err(Complaint::at(bsdf.span, "\"blendbsdf\" needs two bsdfs inside")
                .help("the first counts 1 − weight, the second weight"));
        };
        let a = scaled(&self.of(first.object)?, 1.0 - weight);
        let b = scaled(&self.of(second.object)?, weight);
        sum(&a, &b, second.span)
    }
}

fn diffuse(reflectance: Rgb) -> Material {
    Material {
        front: SideMaterial { diffuse: reflectance, mirror: None },
        back: SideMaterial::default(),
        dielectric: None,
    }
}

/// A mirror on the front.
fn conductor(bsdf: &Object) -> Checked<Material> {
    let weight = bsdf.reflectance("specular_reflectance")?.unwrap_or(Rgb::WHITE);
    let name = bsdf.string("material")?.filter(|name| name.value.trim() != "none");
    let (eta, k) = (bsdf.colour("eta", Quantity::Factor)?, bsdf.colour("k", Quantity::Factor)?);
    let conductor = match name {
        Some(name) => {
            if let Some(index) = ["eta", "k"].into_iter().find_map(|n| bsdf.property(n)) {
                return Err(Complaint::at(index.name.span, "both a material and its index")
                    .related(name.span, "the material")
                    .help("give either \"material\" or \"eta\" and \"k\""));
            }
            Some(super::index::conductor(name)?)
        }
        // η = 0, k = 1 reflects everything: a perfect mirror, and Mitsuba's default.
        None if eta.is_none() && k.is_none() => None,
        None => Some((eta.unwrap_or(Rgb::BLACK), k.unwrap_or(Rgb::WHITE))),
    };
    let mirror = Some(Mirror { weight, conductor }).filter(|m| !m.weight.is_black());
    Ok(Material {
        front: SideMaterial { diffuse: Rgb::BLACK, mirror },
        back: SideMaterial::default(),
        dielectric: None,
    })
}

fn dielectric(bsdf: &Object) -> Checked<Material> {
    let index = |name, default: f64| Ok(bsdf.index(name)?.unwrap_or(default));
    Ok(Material {
        front: SideMaterial::default(),
        back: SideMaterial::default(),
        dielectric: Some(Dielectric {
            // bk7 in air, Mitsuba 3's defaults.
            interior_ior: index("int_ior", 1.5046)?,
            exterior_ior: index("ext_ior", 1.000277)?,
            reflectance: bsdf.reflectance("specular_reflectance")?.unwrap_or(Rgb::WHITE),
            transmittance: bsdf.reflectance("specular_transmittance")?.unwrap_or(Rgb::WHITE),
        }),
    })
}

/// A material that does a part of what it did; parts that nothing is left of vanish.
fn scaled(material: &Material, factor: f64) -> Material {
    let side = |side: &SideMaterial| SideMaterial {
        diffuse: side.diffuse * factor,
        mirror: side
            .mirror
            .map(|m| Mirror { weight: m.weight * factor, ..m })
            .filter(|m| !m.weight.is_black()),
    };
    Material {
        front: side(&material.front),
        back: side(&material.back),
        dielectric: material
            .dielectric
            .map(|d| Dielectric {
                reflectance: d.reflectance * factor,
                transmittance: d.transmittance * factor,
                ..d
            })
            .filter(|_| factor > 0.0),
    }
}

/// Both at once.
fn sum(a: &Material, b: &Material, span: Span) -> Checked<Material> {
    let mirrors = |a: Option<Mirror>, b: Option<Mirror>| match (a, b) {
        (Some(a), Some(b)) if a.conductor == b.conductor => {
            Ok(Some(Mirror { weight: a.weight + b.weight, ..a }))
        }
        (Some(_), Some(_)) => Err(Complaint::at(span, "a blend of two different conductors")
            .help("a surface has one mirror component a side; blend it with diffuse parts only")),
        (a, b) => Ok(a.or(b)),
    };
    let side = |a: &SideMaterial, b: &SideMaterial| {
        Ok(SideMaterial { diffuse: a.diffuse + b.diffuse, mirror: mirrors(a.mirror, b.mirror)? })
    };
    let dielectric = match (a.dielectric, b.dielectric) {
        (Some(a), Some(b)) => {
            if (a.interior_ior, a.exterior_ior) != (b.interior_ior, b.exterior_ior) {
                return Err(Complaint::at(span, "a blend of two different dielectrics").help(
                    "a surface is the boundary of one medium: blend it with diffuse parts only",
                ));
            }
            Some(Dielectric {
                reflectance: a.reflectance + b.reflectance,
                transmittance: a.transmittance + b.transmittance,
                ..a
            })
        }
        (a, b) => a.or(b),
    };
    Ok(Material { front: side(&a.front, &b.front)?, back: side(&a.back, &b.back)?, dielectric })
}
