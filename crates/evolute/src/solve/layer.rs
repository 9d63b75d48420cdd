//! Light of one kind on all sheets: linear over the triangles of meshes of its own.
//!
//! The light of lamps has edges, that of other surfaces hardly any, and a vertex of the one costs a hundred
//! times one of the other: so each has its own meshes.

use serde::{Deserialize, Serialize};

use super::Sheet;
use super::transport::Patch;
use crate::geometry::Rgb;
use crate::receiver::{Stencil, TriangleMesh, merged};
use crate::scene::Scene;
use crate::surface::ChartPoint;

/// A triangle of a layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PatchCorners {
    /// Numbered through all sheets.
    pub vertices: [u32; 3],
    /// ∫ φ dA [m²].
    pub weights: [f64; 3],
}

/// Estimated errors of the luminance of the irradiance at a vertex [W/m²].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VertexError {
    /// Of what was computed there.
    pub own: f64,
    /// Of interpolation around it.
    pub interpolation: f64,
}

impl VertexError {
    /// All of it.
    pub fn sum(&self) -> f64 {
        self.own + self.interpolation
    }

    /// Whether it is a number.
    pub(super) fn is_finite(&self) -> bool {
        self.sum().is_finite()
    }
}

/// A mesh on each sheet, and values at all their vertices.
#[derive(Clone, Debug)]
pub struct Layer<'s> {
    meshes: Vec<TriangleMesh<'s>>,
    first_vertex: Vec<u32>,
    /// By sheet and triangle of its mesh.
    patch_of: Vec<Vec<Patch>>,
    pub(super) patches: Vec<PatchCorners>,
    /// By vertex: ∫ dA of its part in quadratic interpolation [m²], reflectance, irradiance [W/m²], estimated error of its luminance [W/m²].
    pub(super) area: Vec<f64>,
    pub(super) reflectance: Vec<Rgb>,
    pub(super) irradiance: Vec<Rgb>,
    pub(super) error: Vec<VertexError>,
    /// By sheet and triangle: quadratic interpolation.
    middles: Vec<Vec<[Stencil; 3]>>,
    /// By patch: what the quadratic part adds in the mean, as weights of vertices numbered through all sheets.
    offsets: Vec<Stencil>,
    /// By patch and edge: irradiance at the edge's middle, less the mean of its ends [W/m²]; empty until known.
    bends: Vec<[Rgb; 3]>,
}

impl<'s> Layer<'s> {
    /// Numbers vertices and triangles through all sheets.
    pub(super) fn new(
        sheets: &[Sheet],
        meshes: Vec<TriangleMesh<'s>>,
        irradiance: Vec<Rgb>,
        error: Vec<VertexError>,
    ) -> Self {
        let mut layer = Self {
            first_vertex: Vec::new(),
            patch_of: Vec::new(),
            patches: Vec::new(),
            area: Vec::new(),
            reflectance: Vec::new(),
            irradiance,
            error,
            middles: Vec::new(),
            offsets: Vec::new(),
            bends: Vec::new(),
            meshes,
        };
        for (sheet, mesh) in sheets.iter().zip(&layer.meshes) {
            let first = layer.area.len() as u32;
            layer.first_vertex.push(first);
            let count = mesh.vertices().len();
            layer.reflectance.extend(std::iter::repeat_n(sheet.reflectance, count));
            layer.area.extend(std::iter::repeat_n(0.0, count));
            let triangles = mesh.triangles().last().map_or(0, |t| t as usize + 1);
            let mut numbers = vec![Patch::MAX; triangles];
            for t in mesh.triangles() {
                let vertices = mesh.corners(t).map(|v| first + v);
                let weights = mesh.weights(t);
                for (v, w) in vertices.iter().zip(weights) {
                    layer.area[*v as usize] += w;
                }
                numbers[t as usize] = layer.patches.len() as Patch;
                layer.patches.push(PatchCorners { vertices, weights });
            }
            layer.patch_of.push(numbers);
        }
        layer.weigh();
        layer
    }

    /// No light, on meshes with triangles of about `edge` [m].
    pub(super) fn dark(scene: &'s Scene, sheets: &[Sheet], edge: f64) -> Self {
        let mesh = |s: &Sheet| TriangleMesh::new(&scene.shape(s.shape).surface, edge);
        let meshes: Vec<_> = sheets.iter().map(mesh).collect();
        let count = meshes.iter().map(|m| m.vertices().len()).sum();
        Self::new(sheets, meshes, vec![Rgb::BLACK; count], vec![VertexError::default(); count])
    }

    /// The meshes, by sheet.
    pub fn meshes(&self) -> &[TriangleMesh<'s>] {
        &self.meshes
    }

    /// Irradiance at the vertices of a sheet [W/m²].
    pub fn irradiance(&self, sheet: usize) -> &[Rgb] {
        &self.irradiance[self.range(sheet)]
    }

    /// Estimated error of its luminance at the vertices of a sheet [W/m²].
    pub fn error(&self, sheet: usize) -> &[VertexError] {
        &self.error[self.range(sheet)]
    }

    fn range(&self, sheet: usize) -> std::ops::Range<usize> {
        let first = self.first_vertex[sheet] as usize;
        first..first + self.meshes[sheet].vertices().len()
    }

    /// All vertices in the order of their numbers: sheet, number in its mesh.
    pub(super) fn vertices(&self) -> impl Iterator<Item = (usize, u32)> + '_ {
        self.meshes
            .iter()
            .enumerate()
            .flat_map(|(i, mesh)| (0..mesh.vertices().len() as u32).map(move |v| (i, v)))
    }

    /// The patch at a point of a sheet and the weights of its corners.
    pub(super) fn locate(&self, sheet: usize, site: &ChartPoint) -> (Patch, [f64; 3]) {
        self.locate_from(sheet, self.meshes[sheet].root_at(site), site)
    }

    fn locate_from(&self, sheet: usize, root: u32, site: &ChartPoint) -> (Patch, [f64; 3]) {
        let place = self.meshes[sheet].locate_from(root, site);
        (self.patch_of[sheet][place.triangle as usize], place.weights)
    }

    /// Irradiance at a point of a sheet [W/m²].
    pub fn at(&self, sheet: usize, site: &ChartPoint) -> Rgb {
        self.at_from(sheet, self.meshes[sheet].root_at(site), site)
    }

    /// The same in a first triangle, which is known from another layer.
    pub(super) fn at_from(&self, sheet: usize, root: u32, site: &ChartPoint) -> Rgb {
        let (patch, weights) = self.locate_from(sheet, root, site);
        let mut sum = Rgb::BLACK;
        for (v, w) in self.patches[patch as usize].vertices.iter().zip(weights) {
            sum += self.irradiance[*v as usize] * w;
        }
        if let Some(bends) = self.bends.get(patch as usize) {
            for (e, bend) in bends.iter().enumerate() {
                sum += *bend * (4.0 * weights[e] * weights[(e + 1) % 3]);
            }
        }
        sum
    }

    /// Estimated error of the irradiance's luminance at a point of a sheet [W/m²].
    pub fn error_at(&self, sheet: usize, site: &ChartPoint) -> f64 {
        let (patch, weights) = self.locate(sheet, site);
        let corners = self.patches[patch as usize].vertices;
        corners.iter().zip(weights).map(|(v, w)| self.error[*v as usize].sum() * w).sum()
    }

    /// Area of all sheets [m²], and their mean reflectance: the largest channel.
    pub fn area_and_reflectance(&self) -> (f64, f64) {
        let area: f64 = self.area.iter().sum();
        let each = self.reflectance.iter().zip(&self.area);
        (area, each.map(|(r, a)| r.max() * a / area).sum())
    }

    /// The largest error that interpolation makes in the triangle around a point of a sheet, estimated, of the luminance
    /// [W/m²].
    pub fn interpolation_error_at(&self, sheet: usize, site: &ChartPoint) -> f64 {
        let (patch, _) = self.locate(sheet, site);
        let corners = self.patches[patch as usize].vertices;
        corners.iter().map(|v| self.error[*v as usize].interpolation).fold(0.0, f64::max)
    }

    /// Makes flux that of quadratic interpolation: areas of vertices, and what patches send.
    fn weigh(&mut self) {
        for (sheet, mesh) in self.meshes.iter().enumerate() {
            let first = self.first_vertex[sheet];
            let middles = mesh.middles();
            for (t, edges) in mesh.triangles().zip(&middles) {
                let patch = self.patch_of[sheet][t as usize] as usize;
                // The mean over a triangle of the product of two corners' weights is 1/12; four of it.
                let all = edges.iter().flatten().map(|(v, w)| (first + v, w / 3.0)).collect();
                self.offsets.push(merged(all));
                let area: f64 = self.patches[patch].weights.iter().sum();
                for (v, w) in &self.offsets[patch] {
                    self.area[*v as usize] += area * w;
                }
            }
            self.middles.push(middles);
        }
    }

    /// What quadratic interpolation adds, by patch and edge, for the irradiance as it is now. Where light ends, the
    /// middle of an edge stays between what is around it.
    pub(super) fn bend(&mut self) {
        self.bends = vec![[Rgb::BLACK; 3]; self.patches.len()];
        for (sheet, mesh) in self.meshes.iter().enumerate() {
            let first = self.first_vertex[sheet];
            let value = |v: u32| self.irradiance[(first + v) as usize];
            for (t, edges) in mesh.triangles().zip(&self.middles[sheet]) {
                let corners = mesh.corners(t);
                let bends = &mut self.bends[self.patch_of[sheet][t as usize] as usize];
                for (e, stencil) in edges.iter().enumerate() {
                    let mean = (value(corners[e]) + value(corners[(e + 1) % 3])) * 0.5;
                    let bend = stencil.iter().fold(Rgb::BLACK, |sum, (v, w)| sum + value(*v) * *w);
                    let around = corners.into_iter().chain(mesh.beyond(t, e)).map(value);
                    let (low, high) = around.fold(
                        ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]),
                        |(low, high), x| {
                            let each = [0, 1, 2];
                            (each.map(|i| low[i].min(x[i])), each.map(|i| high[i].max(x[i])))
                        },
                    );
                    let middle = mean + bend;
                    let kept = [0, 1, 2].map(|i| middle[i].max(low[i]).min(high[i]) - mean[i]);
                    bends[e] = Rgb(kept);
                }
            }
        }
    }

    /// What the quadratic part of the interpolation adds to a patch's irradiance, in the mean [W/m²].
    fn offset(&self, patch: usize) -> Rgb {
        let each = self.offsets[patch].iter();
        each.fold(Rgb::BLACK, |sum, (v, w)| sum + self.irradiance[*v as usize] * *w)
    }

    /// Reflected radiosity of a patch's corners, such that the patch's flux is right [W/m²].
    pub(super) fn corners(&self, patch: usize) -> [Rgb; 3] {
        let offset = self.offset(patch);
        self.patches[patch]
            .vertices
            .map(|v| (self.irradiance[v as usize] + offset) * self.reflectance[v as usize])
    }

    /// A vertex receives more [W/m²]; what it receives of flux, and keeps [W].
    pub(super) fn receive(&mut self, vertex: usize, light: Rgb) -> (Rgb, Rgb) {
        self.irradiance[vertex] += light;
        let flux = light * self.area[vertex];
        (flux, flux - flux * self.reflectance[vertex])
    }

    /// Flux received, and what of it stays [W].
    pub fn flux(&self) -> (Rgb, Rgb) {
        let (mut received, mut kept) = (Rgb::BLACK, Rgb::BLACK);
        for ((light, area), reflectance) in
            self.irradiance.iter().zip(&self.area).zip(&self.reflectance)
        {
            let flux = *light * *area;
            received += flux;
            kept += flux - flux * *reflectance;
        }
        (received, kept)
    }
}
