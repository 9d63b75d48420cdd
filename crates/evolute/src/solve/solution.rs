//! What the first pass leaves: meshes and the light on them.

use std::collections::HashMap;

use super::{Layer, Sheet};
use crate::geometry::Rgb;
use crate::scene::{Scene, ShapeId};
use crate::surface::ChartPoint;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{Gathered, HemisphereSettings, Link, Receiver, Row, gather};

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

/// Meshes over all diffuse surfaces, and the light on their vertices.
#[derive(Clone, Debug)]
pub struct Solution<'s> {
    sheets: Vec<Sheet>,
    /// By shape and side.
    sheet_of: HashMap<(ShapeId, bool), usize>,
    /// By [`Component`].
    pub(super) layers: [Layer<'s>; 3],
}

impl<'s> Solution<'s> {
    /// Light on meshes over the same sheets, by [`Component`].
    pub(super) fn new(sheets: Vec<Sheet>, layers: [Layer<'s>; 3]) -> Self {
        let sheet_of = sheets.iter().enumerate().map(|(i, s)| ((s.shape, s.front), i)).collect();
        Self { sheets, sheet_of, layers }
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

    /// Luminance of the irradiance that gathered light is uncertain by because the light on the meshes is [W/m²]: the
    /// estimated errors of all components where links come from, reflected as the light is and added up without regard
    /// to sign. As errors are of either sign it is more than the true error in most places.
    pub fn uncertainty(&self, row: &Row) -> f64 {
        let of = |link: &Link| {
            let Some(sheet) = self.sheet_of(link.shape, link.front) else { return 0.0 };
            let error: f64 = self.layers.iter().map(|l| l.error_at(sheet, &link.site)).sum();
            // The colour of an error is not known: that which passes best.
            (link.weight * self.sheets[sheet].reflectance).max() * error
        };
        row.links.iter().map(of).sum()
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
        gather(tracer, receiver, &start, &radiosity, settings)
    }
}
