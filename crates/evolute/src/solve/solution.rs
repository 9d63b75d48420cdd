//! What the first pass leaves: meshes and the light on them.

use std::collections::HashMap;

use super::bright::bright_places;
use super::{Layer, Sheet};
use crate::geometry::Rgb;
use crate::scene::{Scene, ShapeId};
use crate::surface::ChartPoint;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{Bright, Gathered, HemisphereSettings, Receiver, Row, Shining, gather};

/// The parts of the irradiance, each on meshes of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Component {
    /// From lamps directly.
    Direct,
    /// From lamps by specular chains.
    Specular,
    /// By way of other diffuse surfaces.
    Indirect,
}

impl Component {
    /// All, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Direct, Self::Specular, Self::Indirect];
}

/// How well the light on surfaces is known, by estimated errors of what was computed, of interpolation, and of what others
/// pass on.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accuracy {
    /// Mean error, as a part of the mean light.
    pub mean: f64,
    /// Part of the area on which errors are within the tolerance.
    pub met: f64,
}

/// Meshes over all diffuse surfaces, and the light on their vertices.
#[derive(Clone, Debug)]
pub struct Solution<'s> {
    sheets: Vec<Sheet>,
    /// By shape and side.
    sheet_of: HashMap<(ShapeId, bool), usize>,
    /// By [`Component`].
    pub(super) layers: [Layer<'s>; 3],
    /// Where more light comes from than from around, or less.
    bright: Vec<Bright>,
}

impl<'s> Solution<'s> {
    /// Light on meshes over the same sheets, by [`Component`].
    pub(super) fn new(scene: &Scene, sheets: Vec<Sheet>, layers: [Layer<'s>; 3]) -> Self {
        let sheet_of = sheets.iter().enumerate().map(|(i, s)| ((s.shape, s.front), i)).collect();
        let bright = bright_places(scene, &sheets, &layers);
        Self { sheets, sheet_of, layers, bright }
    }

    /// Places that shine much more than others, or less.
    pub(super) fn bright(&self) -> &[Bright] {
        &self.bright
    }

    /// The sheets.
    pub fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// The sheet of a side of a shape, if that is diffuse.
    pub fn sheet_of(&self, shape: ShapeId, front: bool) -> Option<usize> {
        self.sheet_of.get(&(shape, front)).copied()
    }

    /// The light of one component.
    pub fn layer(&self, component: Component) -> &Layer<'s> {
        &self.layers[component as usize]
    }

    pub(super) fn indirect_mut(&mut self) -> &mut Layer<'s> {
        &mut self.layers[Component::Indirect as usize]
    }

    /// Where a ray tree ends: the sheet and the place on it; `None` if that side is not diffuse.
    fn place(&self, scene: &Scene, leaf: &Leaf) -> Option<(usize, ChartPoint)> {
        let sheet = self.sheet_of(leaf.anchor.shape, leaf.front)?;
        let site = scene.shape(leaf.anchor.shape).surface.chart_point(&leaf.anchor.point);
        Some((sheet, site))
    }

    /// Irradiance where a ray tree ends, by [`Component`] [W/m²]; `None` if that side is not diffuse.
    pub fn at(&self, scene: &Scene, leaf: &Leaf) -> Option<[Rgb; 3]> {
        let (sheet, site) = self.place(scene, leaf)?;
        let root = self.layers[0].meshes()[sheet].root_at(&site);
        Some(self.layers.each_ref().map(|layer| layer.at_from(sheet, root, &site)))
    }

    /// What lamps send there, directly and by specular chains [W/m²].
    pub(super) fn of_lamps(&self, scene: &Scene, leaf: &Leaf) -> Option<Rgb> {
        let (sheet, site) = self.place(scene, leaf)?;
        let [direct, specular, _] = &self.layers;
        let root = direct.meshes()[sheet].root_at(&site);
        Some(direct.at_from(sheet, root, &site) + specular.at_from(sheet, root, &site))
    }

    /// The light of one component alone; with the error that interpolation makes there, estimated, of its luminance
    /// [W/m²].
    pub fn component_at(
        &self,
        scene: &Scene,
        leaf: &Leaf,
        component: Component,
    ) -> Option<(Rgb, f64)> {
        let (sheet, site) = self.place(scene, leaf)?;
        let layer = self.layer(component);
        Some((layer.at(sheet, &site), layer.interpolation_error_at(sheet, &site)))
    }

    /// Radiosity reflected where a ray tree ends [W/m²]; none if that side is not diffuse.
    pub fn radiosity(&self, scene: &Scene, leaf: &Leaf) -> Rgb {
        let [direct, specular, indirect] = self.at(scene, leaf).unwrap_or_default();
        (direct + specular + indirect) * leaf.reflectance
    }

    /// Estimated error of the luminance of all irradiance at a point of a sheet [W/m²]: the sum of the components', since
    /// where one of them ends another often begins.
    pub fn error_at(&self, sheet: usize, site: &ChartPoint) -> f64 {
        self.layers.iter().map(|l| l.error_at(sheet, site)).sum()
    }

    /// Luminance of the irradiance that gathered light is uncertain by because the light on the meshes is [W/m²]: the
    /// estimated errors of all components where links come from, reflected as the light is; added up without regard to
    /// sign over each sheet, and by their squares over sheets (`propagation.rs`).
    pub fn uncertainty(&self, row: &Row) -> f64 {
        let mut sums = vec![0.0; self.sheets.len()];
        for link in &row.links {
            let Some(sheet) = self.sheet_of(link.shape, link.front) else { continue };
            let error = self.error_at(sheet, &link.site);
            // The colour of an error is not known: that which passes best.
            sums[sheet] += (link.weight * self.sheets[sheet].reflectance).max() * error;
        }
        sums.iter().map(|e| e * e).sum::<f64>().sqrt()
    }

    /// What is estimated of the accuracy of the light on all sheets, where `relative` of the light or `absolute` [W/m²] was
    /// asked for.
    pub fn accuracy(&self, relative: f64, absolute: f64) -> Accuracy {
        let (mut light, mut error, mut area, mut met) = (0.0, 0.0, 0.0, 0.0);
        for (sheet, mesh) in self.layers[0].meshes().iter().enumerate() {
            for t in mesh.triangles() {
                let site = mesh.at(t, [1.0 / 3.0; 3]);
                let here: f64 = self.layers.iter().map(|l| l.at(sheet, &site).luminance()).sum();
                let off = self.error_at(sheet, &site);
                let a: f64 = mesh.weights(t).iter().sum();
                light += here * a;
                error += off * a;
                area += a;
                if off <= (relative * here).max(absolute) {
                    met += a;
                }
            }
        }
        let part = |x: f64, of: f64| if of > 0.0 { x / of } else { 0.0 };
        Accuracy { mean: part(error, light), met: part(met, area) }
    }

    /// Diffusely reflected light at any receiver, on a surface or not, by the meshes' radiosities.
    pub fn gather(
        &self,
        tracer: &Tracer<'_>,
        receiver: &Receiver,
        settings: &HemisphereSettings,
    ) -> Gathered {
        let radiosity = |leaf: &Leaf| self.radiosity(tracer.scene(), leaf);
        let start = tracer.contacts(&receiver.position);
        let shining = Shining { radiosity: &radiosity, bright: &self.bright };
        gather(tracer, receiver, &start, &shining, settings)
    }
}
