//! Surfaces given by formulas x, y, z of (s, t) over [0, 1]².
//!
//! Guarantees: bounds are proved by interval arithmetic; a ray hit lies on the surface itself (not on
//! a tessellation), and none is missed: see [`hit`]. Limits: a surface whose derivatives are unbounded
//! somewhere (√s at s = 0) or has kinks (`abs`, `min`, `max`) is traced rightly, but slowly for rays
//! that pass close to those places.

mod chords;
mod cones;
mod evaluate;
mod hit;
mod leaves;
mod measure;
mod newton;
mod patch;
mod singular;

use std::sync::Arc;

use self::chords::Chords;
use self::cones::Cones;
use self::evaluate::Evaluator;
use self::leaves::Leaves;
pub use self::patch::Cell;
use self::patch::Patch;
use super::{Jet, SurfaceError, SurfacePoint};
use crate::formula::{Formula, Tape};
use crate::geometry::{Aabb, Point3, Transform, Vector3};

/// A surface `x(s, t)`, prepared in world space. Texture coordinates are (s, t). Its front is the side
/// to which x_s × x_t points in the object's frame, also under a transform that mirrors (as for
/// Mitsuba 3's shapes), and the other side with `flip_normals`.
///
/// Beyond [0, 1]² the formulas go on: [`Parametric::jet`], [`Parametric::position`] and
/// [`Parametric::extended_hit`] work there too, as far as the formulas are defined.
#[derive(Clone, Debug)]
pub struct Parametric {
    evaluator: Evaluator,
    leaves: Leaves,
    chords: Box<Chords>,
    cones: Arc<Cones>,
    bounds: Aabb,
    /// Length of the diagonal of the bounds [m].
    size: f64,
    /// Largest |x_s × x_t| at the leaves' centres [m²]: what it is compared with to be called singular.
    area_scale: f64,
    /// +1: the front is where x_s × x_t of world space points; −1: the other side.
    normal_sign: f64,
    world_from_object: Transform,
}

impl Parametric {
    /// The surface with coordinates `x`, `y`, `z` [m, object frame], formulas of (s, t) in this order,
    /// under `world_from_object`; `flip_normals` turns its front round.
    ///
    /// # Errors
    /// When a position is infinite or not a number somewhere in [0, 1]² (found by intervals, and by
    /// samples where these cannot decide), when the formulas are too long, or when the surface has no
    /// area.
    pub fn new(
        x: Formula,
        y: Formula,
        z: Formula,
        world_from_object: Transform,
        flip_normals: bool,
    ) -> Result<Self, SurfaceError> {
        let tape =
            Tape::compile(&[x, y, z]).map_err(|e| SurfaceError::Formula { message: e.message })?;
        Self::from_tape(tape, world_from_object, flip_normals)
    }

    /// The same from a tape with the outputs x, y, z of the variables (s, t).
    ///
    /// # Errors
    /// As [`Parametric::new`].
    pub fn from_tape(
        tape: Tape,
        world_from_object: Transform,
        flip_normals: bool,
    ) -> Result<Self, SurfaceError> {
        let chords = Box::new(Chords::new(&tape, &world_from_object));
        let evaluator = Evaluator::new(tape, &world_from_object);
        let leaves = Leaves::new(&evaluator)?;
        let bounds = leaves.bounds();
        let area_scale = leaves.patches.iter().map(|p| p.normal.norm()).fold(0.0, f64::max);
        let mirrored = world_from_object.determinant() < 0.0;
        let surface = Self {
            evaluator,
            leaves,
            chords,
            cones: Arc::default(),
            bounds,
            size: bounds.diagonal(),
            area_scale,
            normal_sign: if mirrored != flip_normals { -1.0 } else { 1.0 },
            world_from_object,
        };
        // The rounding of positions of this size blurs anything smaller.
        let reach = bounds.min.coords.amax().max(bounds.max.coords.amax());
        let blur = 16.0 * f64::EPSILON * reach;
        let width = surface.size;
        if !(width > blur && surface.area(1e-2) > blur * width) {
            return Err(SurfaceError::NoArea { shape: "parametric surface" });
        }
        Ok(surface)
    }

    /// Position and derivatives by (s, t), world frame; NaN where the formulas are not defined.
    pub fn jet(&self, s: f64, t: f64) -> Jet {
        self.evaluator.jet(s, t)
    }

    /// Position [m], world frame; NaN where the formulas are not defined.
    pub fn position(&self, s: f64, t: f64) -> Point3 {
        self.evaluator.position(s, t)
    }

    /// +1 or −1 if no line in the direction `d` passes two points of the surface, and none in any direction
    /// between two of the same sign: proved. 0 if that is not known.
    pub fn single_crossing(&self, d: &Vector3) -> i32 {
        self.chords.side(d)
    }

    /// The surface point of parameters (s, t).
    pub fn point(&self, s: f64, t: f64) -> SurfacePoint {
        SurfacePoint { primitive: 0, p: s, q: t, x: self.position(s, t) }
    }

    /// A box that contains the whole surface [m]: proved, rounding included.
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// A box that contains the surface over a cell of parameters [m]: proved, rounding included.
    /// Infinite where the formulas may be, empty where they are not defined at all.
    pub fn bounds_of(&self, cell: Cell) -> Aabb {
        Patch::new(&self.evaluator, cell).bounds
    }

    /// Length of the diagonal of the bounds [m].
    pub fn size(&self) -> f64 {
        self.size
    }

    /// +1 if the front is where x_s × x_t of [`Parametric::jet`] points, −1 if it is the other side.
    pub fn normal_sign(&self) -> f64 {
        self.normal_sign
    }

    /// The transform it was made with.
    pub fn world_from_object(&self) -> &Transform {
        &self.world_from_object
    }
}
