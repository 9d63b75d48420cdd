//! Light of one kind on all sheets: linear over the triangles of meshes of its own.
//!
//! The light of lamps has edges, that of other surfaces hardly any, and a vertex of the one costs a hundred
//! times one of the other: so each has its own meshes.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use super::Sheet;
use super::transport::Patch;
use crate::geometry::Rgb;
use crate::receiver::{Locator, Stencil, TriangleMesh, merged};
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

/// Estimated errors of the luminance of the irradiance at a vertex [W/m²]; those of interpolation between vertices are
/// triangles'.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct VertexError {
    /// Of what was computed there.
    pub own: f64,
    /// Of the light of other places that it is lit by, which have errors of their own.
    pub passed_on: f64,
}

impl VertexError {
    /// Whether both are numbers.
    pub(super) fn is_finite(&self) -> bool {
        self.own.is_finite() && self.passed_on.is_finite()
    }
}

/// A mesh on each sheet, and values at all their vertices.
#[derive(Clone, Debug)]
pub struct Layer<'s> {
    meshes: Vec<TriangleMesh<'s>>,
    first_vertex: Vec<u32>,
    /// By sheet: patches are numbered as its locator has triangles.
    first_patch: Vec<Patch>,
    locators: Vec<Locator>,
    pub(super) patches: Vec<PatchCorners>,
    /// By vertex: ∫ dA of its part in quadratic interpolation [m²], reflectance, irradiance [W/m²], estimated error of its luminance [W/m²].
    pub(super) area: Vec<f64>,
    pub(super) reflectance: Vec<Rgb>,
    pub(super) irradiance: Vec<Rgb>,
    pub(super) error: Vec<VertexError>,
    /// By patch: what interpolation is wrong by, estimated, of the luminance [W/m²].
    interpolation: Vec<f64>,
    /// By vertex: the largest of those around.
    roughness: Vec<f64>,
    /// By patch: quadratic interpolation.
    middles: Vec<[Stencil; 3]>,
    /// By patch: what the quadratic part adds in the mean, as weights of vertices numbered through all sheets.
    offsets: Vec<Stencil>,
    /// By patch: what is read off, and what the quadratic part comes to in the mean [W/m²]; empty until known.
    pieces: Vec<Piece>,
    known_offsets: Vec<Rgb>,
}

/// The irradiance on a patch as it is read off, in single precision: much of a run is spent with that, and memory is
/// what it waits for.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// The first corner in the chart.
    origin: [f32; 2],
    /// How the weights of the second and the third corner grow from there.
    slopes: [[f32; 2]; 2],
    /// At the corners, and by edge what its middle has beyond the mean of its ends [W/m²].
    corners: [[f32; 3]; 3],
    bends: [[f32; 3]; 3],
}

impl Piece {
    fn new([a, b, c]: [[f64; 2]; 3], corners: [Rgb; 3], bends: [Rgb; 3]) -> Self {
        let (p, q) = ([0, 1].map(|i| b[i] - a[i]), [0, 1].map(|i| c[i] - a[i]));
        let area = p[0] * q[1] - p[1] * q[0];
        let slopes = [[q[1] / area, -q[0] / area], [-p[1] / area, p[0] / area]];
        let single = |light: Rgb| light.0.map(|x| x as f32);
        Self {
            origin: a.map(|x| x as f32),
            slopes: slopes.map(|s| s.map(|x| x as f32)),
            corners: corners.map(single),
            bends: bends.map(single),
        }
    }

    /// At a point of the chart [W/m²].
    fn at(&self, at: [f64; 2]) -> Rgb {
        let [x, y] = [0, 1].map(|i| (at[i] - f64::from(self.origin[i])) as f32);
        let [p, q] = self.slopes.map(|s| s[0] * x + s[1] * y);
        // Beyond a rim, or by rounding, a weight may be negative.
        let p = p.clamp(0.0, 1.0);
        let q = q.clamp(0.0, 1.0 - p);
        let weights = [1.0 - p - q, p, q];
        Rgb([0, 1, 2].map(|i| {
            let linear: f32 = (0..3).map(|c| weights[c] * self.corners[c][i]).sum();
            let bend: f32 =
                (0..3).map(|e| weights[e] * weights[(e + 1) % 3] * self.bends[e][i]).sum();
            // A parabola through nothing at one end, and little in the middle, has less in between.
            f64::from((linear + 4.0 * bend).max(0.0))
        }))
    }
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
            first_patch: Vec::new(),
            locators: meshes.iter().map(Locator::new).collect(),
            patches: Vec::new(),
            area: Vec::new(),
            reflectance: Vec::new(),
            irradiance,
            error,
            interpolation: Vec::new(),
            roughness: Vec::new(),
            middles: Vec::new(),
            offsets: Vec::new(),
            pieces: Vec::new(),
            known_offsets: Vec::new(),
            meshes,
        };
        for ((sheet, mesh), locator) in sheets.iter().zip(&layer.meshes).zip(&layer.locators) {
            let first = layer.area.len() as u32;
            layer.first_vertex.push(first);
            layer.first_patch.push(layer.patches.len() as Patch);
            let count = mesh.vertices().len();
            layer.reflectance.extend(std::iter::repeat_n(sheet.reflectance, count));
            layer.area.extend(std::iter::repeat_n(0.0, count));
            for &t in locator.triangles() {
                let vertices = mesh.corners(t).map(|v| first + v);
                let weights = mesh.weights(t);
                for (v, w) in vertices.iter().zip(weights) {
                    layer.area[*v as usize] += w;
                }
                layer.patches.push(PatchCorners { vertices, weights });
            }
        }
        layer.set_interpolation(vec![0.0; layer.patches.len()]);
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

    /// Estimated error of its luminance at the vertices of a sheet, without that of interpolation between them [W/m²].
    pub fn error(&self, sheet: usize) -> &[VertexError] {
        &self.error[self.range(sheet)]
    }

    /// Numbers of the patches of a sheet.
    pub(super) fn patches_of(&self, sheet: usize) -> std::ops::Range<usize> {
        let first = self.first_patch[sheet] as usize;
        first..first + self.locators[sheet].triangles().len()
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
        let (mesh, locator) = (&self.meshes[sheet], &self.locators[sheet]);
        let place = locator.locate_from(mesh.root_at(site), site);
        let weights = mesh.weights_at(locator.triangles()[place], site);
        (self.first_patch[sheet] + place as Patch, weights)
    }

    /// Irradiance at a point of a sheet [W/m²].
    pub fn at(&self, sheet: usize, site: &ChartPoint) -> Rgb {
        self.at_from(sheet, self.meshes[sheet].root_at(site), site)
    }

    /// The same in a first triangle, which is known from another layer.
    pub(super) fn at_from(&self, sheet: usize, root: u32, site: &ChartPoint) -> Rgb {
        if self.pieces.is_empty() {
            let (patch, weights) = self.locate(sheet, site);
            let corners = self.patches[patch as usize].vertices.iter().zip(weights);
            return corners.fold(Rgb::BLACK, |sum, (v, w)| sum + self.irradiance[*v as usize] * w);
        }
        let place = self.locators[sheet].locate_from(root, site);
        self.pieces[self.first_patch[sheet] as usize + place].at(site.at)
    }

    /// Estimated error of the irradiance's luminance at a point of a sheet [W/m²].
    pub fn error_at(&self, sheet: usize, site: &ChartPoint) -> f64 {
        let (patch, weights) = self.locate(sheet, site);
        self.error_in(patch as usize, weights)
    }

    /// The same in a patch, given the weights of its corners: what was computed, interpolation, and what is passed on know
    /// nothing of each other, and so are added up by their squares.
    pub(super) fn error_in(&self, patch: usize, weights: [f64; 3]) -> f64 {
        let (mut own, mut passed_on) = (0.0, 0.0);
        for (v, w) in self.patches[patch].vertices.iter().zip(weights) {
            let error = self.error[*v as usize];
            own += error.own * w;
            passed_on += error.passed_on * w;
        }
        let interpolation = self.interpolation[patch];
        (own * own + interpolation * interpolation + passed_on * passed_on).sqrt()
    }

    /// Area of all sheets [m²], and their mean reflectance: the largest channel.
    pub fn area_and_reflectance(&self) -> (f64, f64) {
        let area: f64 = self.area.iter().sum();
        let each = self.reflectance.iter().zip(&self.area);
        (area, each.map(|(r, a)| r.max() * a / area).sum())
    }

    /// The error that interpolation makes around a point of a sheet, estimated, of the luminance [W/m²]: the largest of the
    /// triangle there and all that touch it.
    pub fn interpolation_error_at(&self, sheet: usize, site: &ChartPoint) -> f64 {
        let corners = self.patches[self.locate(sheet, site).0 as usize].vertices;
        corners.iter().map(|v| self.roughness[*v as usize]).fold(0.0, f64::max)
    }

    /// Makes flux that of quadratic interpolation: areas of vertices, and what patches send.
    fn weigh(&mut self) {
        for (sheet, mesh) in self.meshes.iter().enumerate() {
            let first = self.first_vertex[sheet];
            let middles = mesh.middles(self.locators[sheet].triangles());
            for edges in &middles {
                let patch = &self.patches[self.offsets.len()];
                // The mean over a triangle of the product of two corners' weights is 1/12; four of it.
                let all = edges.iter().flatten().map(|(v, w)| (first + v, w / 3.0)).collect();
                let offset = merged(all);
                let area: f64 = patch.weights.iter().sum();
                for (v, w) in &offset {
                    self.area[*v as usize] += area * w;
                }
                self.offsets.push(offset);
            }
            self.middles.extend(middles);
        }
    }

    /// Makes what is read off quadratic, for the irradiance as it is now. Where light ends, the middle of an edge stays
    /// between what is around it.
    pub(super) fn bend(&mut self) {
        let mut pieces = Vec::with_capacity(self.patches.len());
        for (sheet, mesh) in self.meshes.iter().enumerate() {
            let first = self.first_vertex[sheet];
            let value = |v: u32| self.irradiance[(first + v) as usize];
            for &t in self.locators[sheet].triangles() {
                let corners = mesh.corners(t);
                let mut bends = [Rgb::BLACK; 3];
                for (e, stencil) in self.middles[pieces.len()].iter().enumerate() {
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
                pieces.push(Piece::new(mesh.chart_corners(t), corners.map(value), bends));
            }
        }
        self.pieces = pieces;
        self.known_offsets = (0..self.patches.len()).map(|p| self.offset_now(p)).collect();
    }

    /// Estimates what quadratic interpolation is wrong by, for the irradiance as it is now: no less than `known` by sheet
    /// and triangle.
    pub(super) fn estimate_interpolation(&mut self, known: &[HashMap<u32, f64>]) {
        let mut by_patch = Vec::with_capacity(self.patches.len());
        for (sheet, mesh) in self.meshes.iter().enumerate() {
            let first = self.first_vertex[sheet];
            let value = |v: u32| self.irradiance[(first + v) as usize].luminance();
            let errors: HashMap<u32, f64> = mesh.quadratic_errors(&value).into_iter().collect();
            by_patch.extend(self.locators[sheet].triangles().iter().map(|t| {
                let least = known.get(sheet).and_then(|known| known.get(t)).copied().unwrap_or(0.0);
                errors.get(t).copied().unwrap_or(0.0).max(least)
            }));
        }
        self.set_interpolation(by_patch);
    }

    /// What interpolation is wrong by, by patch [W/m²].
    pub(super) fn interpolation(&self) -> &[f64] {
        &self.interpolation
    }

    /// Keeps what was estimated of that.
    pub(super) fn set_interpolation(&mut self, by_patch: Vec<f64>) {
        self.roughness = vec![0.0; self.irradiance.len()];
        for (patch, error) in self.patches.iter().zip(&by_patch) {
            for v in patch.vertices {
                let roughness = &mut self.roughness[v as usize];
                *roughness = roughness.max(*error);
            }
        }
        self.interpolation = by_patch;
    }

    /// What the quadratic part of the interpolation adds to a patch's irradiance, in the mean [W/m²].
    fn offset(&self, patch: usize) -> Rgb {
        self.known_offsets.get(patch).copied().unwrap_or_else(|| self.offset_now(patch))
    }

    fn offset_now(&self, patch: usize) -> Rgb {
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
        self.pieces.clear();
        self.known_offsets.clear();
        self.irradiance[vertex] += light;
        let flux = light * self.area[vertex];
        (flux, flux - flux * self.reflectance[vertex])
    }

    /// Where quadratic interpolation of what shines there has overshot, less than nothing was received: makes that nothing,
    /// and an error of as much.
    pub(super) fn clamp_to_positive(&mut self) {
        for (light, error) in self.irradiance.iter_mut().zip(&mut self.error) {
            let positive = light.map(|x| x.max(0.0));
            error.own = error.own.max((positive - *light).luminance());
            *light = positive;
        }
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
