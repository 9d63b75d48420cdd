//! Nearest hit and occlusion over all surfaces of a scene.

use crate::scene::ShapeId;
use crate::surface::SurfacePoint;

/// A point of a shape: where a ray starts or ends. A ray does not meet the surface again at the
/// point it starts from; other intersections with the same surface count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// The shape.
    pub shape: ShapeId,
    /// The point on it.
    pub point: SurfacePoint,
}

/// Where a ray meets a surface first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in units of the direction's length.
    pub t: f64,
    /// Where.
    pub anchor: Anchor,
}

/// Finds nearest hits and occlusion in a scene.
pub struct Tracer<'s> {
    scene: &'s crate::scene::Scene,
}

impl<'s> Tracer<'s> {
    /// Builds the hierarchy.
    pub fn new(scene: &'s crate::scene::Scene) -> Self {
        Self { scene }
    }

    /// The scene traced.
    pub fn scene(&self) -> &'s crate::scene::Scene {
        self.scene
    }
}
