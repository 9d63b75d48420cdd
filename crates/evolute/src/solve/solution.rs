//! What the first pass leaves: meshes and the light on them.

use std::collections::HashMap;

use super::{Layer, Sheet};
use crate::geometry::Rgb;
use crate::scene::{Scene, ShapeId};
use crate::surface::ChartPoint;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{Gathered, HemisphereSettings, Receiver, ReceiverLight, gather};

/// Irradiance in its parts [W/m²].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LightParts {
    /// From lamps directly.
    pub direct: Rgb,
    /// From lamps by specular chains.
    pub specular: Rgb,
    /// By way of other diffuse surfaces.
    pub indirect: Rgb,
}

/// Meshes over all diffuse surfaces, and the light on their vertices.
#[derive(Clone, Debug)]
pub struct Solution<'s> {
    pub(super) sheets: Vec<Sheet>,
    /// By shape and side.
    sheet_of: HashMap<(ShapeId, bool), usize>,
    pub(super) lamps: Layer<'s>,
    /// By vertex of that layer: its parts.
    lamp_parts: Vec<ReceiverLight>,
    pub(super) reflected: Layer<'s>,
}

impl<'s> Solution<'s> {
    /// Light of lamps, and no other yet, on meshes of their own.
    pub(super) fn new(
        sheets: Vec<Sheet>,
        lamps: Layer<'s>,
        lamp_parts: Vec<ReceiverLight>,
    ) -> Self {
        let sheet_of = sheets.iter().enumerate().map(|(i, s)| ((s.shape, s.front), i)).collect();
        let reflected = Layer::new(&[], Vec::new(), Vec::new(), Vec::new());
        Self { sheets, sheet_of, lamps, lamp_parts, reflected }
    }

    /// The sheets.
    pub fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// The sheet of a side of a shape, if that is diffuse.
    pub fn sheet_of(&self, shape: ShapeId, front: bool) -> Option<usize> {
        self.sheet_of.get(&(shape, front)).copied()
    }

    /// The lamps' own light: direct and specular.
    pub fn lamps(&self) -> &Layer<'s> {
        &self.lamps
    }

    /// By vertex of the lamps' layer, through all sheets: its parts.
    pub fn lamp_parts(&self) -> &[ReceiverLight] {
        &self.lamp_parts
    }

    /// Light that was reflected diffusely: indirect.
    pub fn reflected(&self) -> &Layer<'s> {
        &self.reflected
    }

    /// Where a ray tree ends: the sheet and the place on it; `None` if that side is not diffuse.
    fn place(&self, scene: &Scene, leaf: &Leaf) -> Option<(usize, ChartPoint)> {
        let sheet = self.sheet_of(leaf.anchor.shape, leaf.front)?;
        let site = scene.shape(leaf.anchor.shape).surface.chart_point(&leaf.anchor.point);
        Some((sheet, site))
    }

    /// The lamps' own light where a ray tree ends [W/m²]; `None` if that side is not diffuse.
    pub(super) fn lamps_at(&self, scene: &Scene, leaf: &Leaf) -> Option<Rgb> {
        let (sheet, site) = self.place(scene, leaf)?;
        Some(self.lamps.at(sheet, &site))
    }

    /// Indirect light where a ray tree ends [W/m²]; `None` if that side is not diffuse.
    pub fn indirect_at(&self, scene: &Scene, leaf: &Leaf) -> Option<Rgb> {
        let (sheet, site) = self.place(scene, leaf)?;
        Some(self.reflected.at(sheet, &site))
    }

    /// All light where a ray tree ends; `None` if that side is not diffuse.
    pub fn parts_at(&self, scene: &Scene, leaf: &Leaf) -> Option<LightParts> {
        let (sheet, site) = self.place(scene, leaf)?;
        let (patch, weights) = self.lamps.locate(sheet, &site);
        let mut parts =
            LightParts { indirect: self.reflected.at(sheet, &site), ..LightParts::default() };
        for (v, w) in self.lamps.patches[patch as usize].vertices.iter().zip(weights) {
            let light = &self.lamp_parts[*v as usize];
            parts.direct += light.direct * w;
            parts.specular += light.specular * w;
        }
        Some(parts)
    }

    /// Radiosity reflected where a ray tree ends [W/m²]; `None` if that side is not diffuse.
    pub fn radiosity(&self, scene: &Scene, leaf: &Leaf) -> Option<Rgb> {
        let (sheet, site) = self.place(scene, leaf)?;
        let light = self.lamps.at(sheet, &site) + self.reflected.at(sheet, &site);
        Some(light * self.sheets[sheet].reflectance)
    }

    /// Diffusely reflected light at any receiver, on a surface or not, by the meshes' radiosities.
    pub fn gather(
        &self,
        tracer: &Tracer<'_>,
        receiver: &Receiver,
        settings: &HemisphereSettings,
    ) -> Gathered {
        let radiosity = |leaf: &Leaf| self.radiosity(tracer.scene(), leaf).unwrap_or_default();
        let start = tracer.contacts(&receiver.position);
        gather(tracer, receiver, &start, &radiosity, settings)
    }
}
