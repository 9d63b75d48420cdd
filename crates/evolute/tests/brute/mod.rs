//! A slow search for the surfaces that a ray meets, to hold the tracer against. It uses neither the
//! tracer's bounds nor its root finding:
//! - rectangle, disk, sphere, cylinder: their equations sampled along the ray, sign changes bisected and
//!   extrema found by golden section (`implicit`);
//! - triangles: one by one, by Plücker coordinates (`meshes`);
//! - patches of smooth meshes and formulas: positions alone, and quartering of the parameters as long as
//!   the samples surround the ray (`quartering`, `formulas`).
#![allow(clippy::unwrap_used, dead_code, unused_imports)] // each suite uses a part

mod comparison;
mod formulas;
mod implicit;
mod meshes;
mod quartering;
mod random;
mod scenes;
mod tangency;

pub use comparison::compare;
pub use formulas::*;
pub use meshes::{bumpy_ball, smooth_ball};
pub use random::{Random, motion};
pub use scenes::{scene_of, scenes};

use evolute::geometry::{Aabb, Ray};
use evolute::surface::{Mesh, Surface, SurfacePoint};

/// A root of a ray and a surface, t > 0.
#[derive(Clone, Copy, Debug)]
pub struct Root {
    pub t: f64,
    /// How far it may be off along the ray [m].
    pub doubt: f64,
    /// Whether double precision decides that it is one: not where the ray is tangent, or runs through
    /// the surface's border, to within rounding of the coordinates.
    pub certain: bool,
}

/// A surface prepared for the slow search.
pub enum Search<'s> {
    Implicit(&'s Surface),
    Triangles(&'s Mesh),
    Patches(meshes::Patches),
    Formulas(FormulaGrid<'s>),
}

impl<'s> Search<'s> {
    pub fn new(surface: &'s Surface) -> Self {
        match surface {
            Surface::Mesh(m) if m.is_smooth() => Self::Patches(meshes::Patches::new(m)),
            Surface::Mesh(m) => Self::Triangles(m),
            Surface::Parametric(p) => Self::Formulas(FormulaGrid::new(p)),
            s => Self::Implicit(s),
        }
    }

    /// All roots at 0 < t ≤ `t_max`, in no order, some twice; `start` is the point of this surface at
    /// which the ray starts, which is no root.
    pub fn roots(&self, ray: &Ray, t_max: f64, start: Option<&Start>) -> Vec<Root> {
        match self {
            Self::Implicit(s) => implicit::roots(s, ray, t_max, start.is_some()),
            Self::Triangles(m) => meshes::roots(m, ray, t_max, start.map(|s| s.point.primitive)),
            Self::Patches(p) => leaving(p.roots(ray), ray, t_max, start),
            Self::Formulas(f) => leaving(f.roots(ray), ray, t_max, start),
        }
    }
}

/// Where a ray leaves a surface.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub point: SurfacePoint,
    /// Sine of the angle between ray and surface; 1 where the surface has no normal.
    pub slope: f64,
    /// Size of the scene's coordinates [m].
    pub reach: f64,
}

/// Without what lies within the search's own error of the start.
fn leaving(mut roots: Vec<Root>, ray: &Ray, t_max: f64, start: Option<&Start>) -> Vec<Root> {
    let own = start.map_or(0.0, |s| 16.0 * f64::EPSILON * s.reach / s.slope.max(1e-7));
    roots.retain(|r| {
        let at_start = start.is_some() && r.t * ray.direction.norm() <= own + r.doubt;
        r.t > 0.0 && r.t <= t_max && !at_start
    });
    roots
}

/// A box around surfaces, to draw rays in.
pub fn bounds_of<'s>(surfaces: impl Iterator<Item = &'s Surface>) -> Aabb {
    surfaces.fold(Aabb::EMPTY, |b, s| b.union(&s.bounds()))
}
