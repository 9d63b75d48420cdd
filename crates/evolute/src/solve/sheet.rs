//! One side of a diffuse surface.

use crate::geometry::{Rgb, UnitVector3, Vector3};
use crate::receiver::TriangleMesh;
use crate::scene::{Scene, ShapeId};
use crate::trace::{Anchor, Tracer};
use crate::transfer::Receiver;

/// A side of a shape that reflects diffusely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sheet {
    /// The shape.
    pub shape: ShapeId,
    /// Whether it is the front.
    pub front: bool,
    /// Diffuse reflectance.
    pub reflectance: Rgb,
}

impl Sheet {
    /// All of a scene.
    pub fn all(scene: &Scene) -> Vec<Self> {
        let mut sheets = Vec::new();
        for (shape, s) in (0u32..).map(ShapeId).zip(&scene.shapes) {
            for (front, side) in [(true, &s.material.front), (false, &s.material.back)] {
                if !side.diffuse.is_black() {
                    sheets.push(Self { shape, front, reflectance: side.diffuse });
                }
            }
        }
        sheets
    }

    /// The receiver of a vertex of its mesh, and the surfaces that it lies on. Where the surface has no normal it
    /// faces up: there it receives something, for no area.
    pub fn receiver(
        &self,
        tracer: &Tracer<'_>,
        mesh: &TriangleMesh<'_>,
        vertex: u32,
    ) -> (Receiver, Vec<Anchor>) {
        let surface = mesh.surface();
        let point = surface.at_chart(&mesh.vertices()[vertex as usize].site);
        let n = surface.local(&point).map_or(Vector3::z_axis(), |l| l.n);
        let normal = UnitVector3::new_unchecked(if self.front { *n } else { -*n });
        let own = Anchor { shape: self.shape, point };
        let others = tracer.contacts(&point.x);
        let start = others.into_iter().filter(|a| a.shape != self.shape);
        (Receiver { position: point.x, normal }, std::iter::once(own).chain(start).collect())
    }
}
