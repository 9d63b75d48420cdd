//! The checked scene: shapes in world space with what each of their sides does to light.

use crate::geometry::{Rgb, Transform};
use crate::surface::Surface;

/// Index of a shape in [`Scene::shapes`], in the order of the scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ShapeId(pub u32);

/// A checked scene. All geometry is in the world frame [m].
#[derive(Clone, Debug)]
pub struct Scene {
    /// The file's name without folder and extension.
    pub name: String,
    /// All shapes.
    pub shapes: Vec<Shape>,
    /// The sensors in the order of the file; pictures are of the first.
    pub sensors: Vec<Sensor>,
    /// An integrator's `max_depth` in Mitsuba's counting, if the scene limits it (≥ 0).
    pub max_depth: Option<u32>,
}

/// A surface, what its two sides do to light, and what it emits.
#[derive(Clone, Debug)]
pub struct Shape {
    /// `id` of the scene file, or a made-up one ("shape 3, sphere").
    pub id: String,
    /// The geometry.
    pub surface: Surface,
    /// What happens to light at it.
    pub material: Material,
    /// Emitted radiance on the front (the normal's side) [W/(m² sr)]; black if it is no lamp.
    pub radiance: Rgb,
}

/// What a surface does to light that meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// On the normal's side.
    pub front: SideMaterial,
    /// On the other side.
    pub back: SideMaterial,
    /// The boundary between two media; acts on both sides, beside what the sides do themselves.
    pub dielectric: Option<Dielectric>,
}

/// What one side of an opaque surface reflects; all black absorbs.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct SideMaterial {
    /// Diffuse reflectance (0 to 1 a channel), a blend's weight included.
    pub diffuse: Rgb,
    /// Ideal mirror component, if any.
    pub mirror: Option<Mirror>,
}

/// An ideal specular reflector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mirror {
    /// Factor on the reflectance (`specular_reflectance` times a blend's weight).
    pub weight: Rgb,
    /// Complex refractive index (η, k) a channel for Fresnel's equations; `None` reflects everything.
    pub conductor: Option<(Rgb, Rgb)>,
}

/// A smooth boundary between two media.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dielectric {
    /// Refractive index behind the surface (the side away from the normal).
    pub interior_ior: f64,
    /// Refractive index in front (the normal's side).
    pub exterior_ior: f64,
    /// Factor on Fresnel's reflectance (`specular_reflectance` times a blend's weight).
    pub reflectance: Rgb,
    /// Factor on Fresnel's transmittance (`specular_transmittance` times a blend's weight).
    pub transmittance: Rgb,
}

/// A pinhole camera and its film.
#[derive(Clone, Debug)]
pub struct Sensor {
    /// Camera frame → world: the camera looks along its +z, +y is up, +x is to the LEFT of the
    /// picture, as in Mitsuba 3.
    pub world_from_camera: Transform,
    /// Field of view across the width of the picture [rad].
    pub fov_x: f64,
    /// Distance from which on things are seen [m].
    pub near_clip: f64,
    /// Distance up to which things are seen [m].
    pub far_clip: f64,
    /// Shift of the principal point, as fractions of width and height.
    pub principal_point_offset: [f64; 2],
    /// The film.
    pub film: Film,
}

/// The picture's size and the filter that weighs its samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Reconstruction filter.
    pub filter: ReconstructionFilter,
}

/// Filters over the film, in units of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ReconstructionFilter {
    /// Mean over the pixel.
    Box,
    /// Triangle of the given radius [pixels].
    Tent {
        /// Half width [pixels].
        radius: f64,
    },
    /// Gaussian of the given standard deviation [pixels], cut at four of them.
    Gaussian {
        /// Standard deviation [pixels].
        stddev: f64,
    },
}

impl Material {
    /// Whether either side, or the boundary, sends light on in one direction.
    pub fn is_specular(&self) -> bool {
        self.dielectric.is_some() || self.front.mirror.is_some() || self.back.mirror.is_some()
    }
}

impl Scene {
    /// The shape of an index.
    pub fn shape(&self, id: ShapeId) -> &Shape {
        &self.shapes[id.0 as usize]
    }

    /// The shape named `id`.
    pub fn shape_named(&self, id: &str) -> Option<ShapeId> {
        self.shapes.iter().position(|s| s.id == id).map(|i| ShapeId(i as u32))
    }

    /// All lamps.
    pub fn lamps(&self) -> impl Iterator<Item = ShapeId> + '_ {
        (0..self.shapes.len() as u32).map(ShapeId).filter(|id| !self.shape(*id).radiance.is_black())
    }
}
