//! What the first pass leaves: meshes and the light on them.

use std::collections::HashMap;

use super::Sheet;
use super::transport::Patch;
use crate::geometry::Rgb;
use crate::scene::{Scene, ShapeId};
use crate::surface::ChartPoint;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{Gathered, HemisphereSettings, Receiver, gather};

/// A triangle of one of the sheets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PatchCorners {
    /// Numbered through all sheets.
    pub vertices: [u32; 3],
    /// ∫ φ dA [m²].
    pub weights: [f64; 3],
}

/// Meshes over all diffuse surfaces, and the light on their vertices.
#[derive(Clone, Debug)]
pub struct Solution<'s> {
    sheets: Vec<Sheet<'s>>,
    /// By shape and side.
    sheet_of: HashMap<(ShapeId, bool), u32>,
    first_vertex: Vec<u32>,
    /// By sheet and triangle of its mesh.
    patch_of: Vec<Vec<Patch>>,
    pub(super) patches: Vec<PatchCorners>,
    /// By vertex, through all sheets: reflectance, area [m²].
    pub(super) reflectance: Vec<Rgb>,
    pub(super) area: Vec<f64>,
    /// By vertex: irradiance by light that was reflected diffusely [W/m²].
    pub(super) indirect: Vec<Rgb>,
    /// By vertex: reflected radiosity [W/m²] (`rad`).
    pub(super) radiosity: Vec<Rgb>,
}

impl<'s> Solution<'s> {
    /// Sheets that lamps shine on, and no other light yet.
    pub(super) fn new(sheets: Vec<Sheet<'s>>) -> Self {
        let mut solution = Self {
            sheet_of: HashMap::new(),
            first_vertex: Vec::new(),
            patch_of: Vec::new(),
            patches: Vec::new(),
            reflectance: Vec::new(),
            area: Vec::new(),
            indirect: Vec::new(),
            radiosity: Vec::new(),
            sheets,
        };
        for (i, sheet) in (0u32..).zip(&solution.sheets) {
            let mesh = &sheet.mesh;
            let first = solution.reflectance.len() as u32;
            solution.sheet_of.insert((sheet.shape, sheet.front), i);
            solution.first_vertex.push(first);
            let count = mesh.vertices().len();
            solution.reflectance.extend(std::iter::repeat_n(sheet.reflectance, count));
            solution.area.extend(std::iter::repeat_n(0.0, count));
            let triangles = mesh.triangles().last().map_or(0, |t| t as usize + 1);
            let mut numbers = vec![Patch::MAX; triangles];
            for t in mesh.triangles() {
                let vertices = mesh.corners(t).map(|v| first + v);
                let weights = mesh.weights(t);
                for (v, w) in vertices.iter().zip(weights) {
                    solution.area[*v as usize] += w;
                }
                numbers[t as usize] = solution.patches.len() as Patch;
                solution.patches.push(PatchCorners { vertices, weights });
            }
            solution.patch_of.push(numbers);
        }
        solution.indirect = vec![Rgb::BLACK; solution.reflectance.len()];
        let lit = solution.lamp_light().zip(&solution.reflectance);
        solution.radiosity = lit.map(|(light, reflectance)| light * *reflectance).collect();
        solution
    }

    /// Irradiance of all vertices from lamps [W/m²].
    pub(super) fn lamp_light(&self) -> impl Iterator<Item = Rgb> + '_ {
        self.sheets.iter().flat_map(|s| s.lamps.iter().map(|l| l.direct + l.specular))
    }

    /// The patch at a surface point and the weights of its corners; `None` if that side is not diffuse.
    pub(super) fn locate(
        &self,
        shape: ShapeId,
        front: bool,
        site: &ChartPoint,
    ) -> Option<(Patch, [f64; 3])> {
        let sheet = *self.sheet_of.get(&(shape, front))? as usize;
        let place = self.sheets[sheet].mesh.locate(site);
        Some((self.patch_of[sheet][place.triangle as usize], place.weights))
    }

    /// Radiosity reflected so far where a ray tree ends [W/m²]; `None` if that side is not diffuse.
    pub(super) fn radiosity_seen(&self, scene: &Scene, leaf: &Leaf) -> Option<Rgb> {
        let site = scene.shape(leaf.anchor.shape).surface.chart_point(&leaf.anchor.point);
        let (patch, weights) = self.locate(leaf.anchor.shape, leaf.front, &site)?;
        let mut sum = Rgb::BLACK;
        for (v, w) in self.patches[patch as usize].vertices.iter().zip(weights) {
            sum += self.radiosity[*v as usize] * w;
        }
        Some(sum)
    }

    /// The sheets.
    pub fn sheets(&self) -> &[Sheet<'s>] {
        &self.sheets
    }

    /// By sheet and vertex: irradiance by light that was reflected diffusely [W/m²].
    pub fn indirect(&self, sheet: usize) -> &[Rgb] {
        let first = self.first_vertex[sheet] as usize;
        &self.indirect[first..first + self.sheets[sheet].mesh.vertices().len()]
    }

    /// All vertices: sheet, number in its mesh, number through all sheets.
    pub(super) fn vertices(&self) -> impl Iterator<Item = (usize, u32, u32)> + '_ {
        self.sheets.iter().zip(&self.first_vertex).enumerate().flat_map(|(i, (sheet, &first))| {
            (0..sheet.mesh.vertices().len() as u32).map(move |v| (i, v, first + v))
        })
    }

    /// A vertex receives more diffusely reflected light [W/m²]; what it receives of flux, and keeps [W].
    pub(super) fn receive(&mut self, vertex: usize, light: Rgb) -> (Rgb, Rgb) {
        self.indirect[vertex] += light;
        self.radiosity[vertex] += light * self.reflectance[vertex];
        let flux = light * self.area[vertex];
        (flux, flux - flux * self.reflectance[vertex])
    }

    /// Diffusely reflected light at any receiver, on a surface or not, by the meshes' radiosities.
    pub fn gather(
        &self,
        tracer: &Tracer<'_>,
        receiver: &Receiver,
        settings: &HemisphereSettings,
    ) -> Gathered {
        let radiosity = |leaf: &Leaf| self.radiosity_seen(tracer.scene(), leaf).unwrap_or_default();
        let start = tracer.contacts(&receiver.position);
        gather(tracer, receiver, &start, &radiosity, settings)
    }
}
