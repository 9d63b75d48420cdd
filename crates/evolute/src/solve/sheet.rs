//! One side of a diffuse surface: a mesh of receivers and what they receive.

use crate::geometry::{Rgb, UnitVector3, Vector3};
use crate::receiver::TriangleMesh;
use crate::scene::{Scene, ShapeId};
use crate::trace::{Anchor, Tracer};
use crate::transfer::{Components, Receiver, ReceiverLight, Transfer};

/// A side of a shape that reflects diffusely.
#[derive(Clone, Debug)]
pub struct Sheet<'s> {
    /// The shape.
    pub shape: ShapeId,
    /// Whether it is the front.
    pub front: bool,
    /// Diffuse reflectance.
    pub reflectance: Rgb,
    /// Its receivers.
    pub mesh: TriangleMesh<'s>,
    /// What each vertex receives from lamps.
    pub lamps: Vec<ReceiverLight>,
}

impl<'s> Sheet<'s> {
    /// All of a scene, with triangles of about `edge` [m].
    pub fn all(scene: &'s Scene, edge: f64) -> Vec<Self> {
        let mut sheets = Vec::new();
        for (shape, s) in (0u32..).map(ShapeId).zip(&scene.shapes) {
            for (front, side) in [(true, &s.material.front), (false, &s.material.back)] {
                if !side.diffuse.is_black() {
                    sheets.push(Self {
                        shape,
                        front,
                        reflectance: side.diffuse,
                        mesh: TriangleMesh::new(&s.surface, edge),
                        lamps: Vec::new(),
                    });
                }
            }
        }
        sheets
    }

    /// The receiver of a vertex, and the surfaces that it lies on. Where the surface has no normal it faces
    /// up: there it receives something, for no area.
    pub fn receiver(&self, tracer: &Tracer<'_>, vertex: u32) -> (Receiver, Vec<Anchor>) {
        let surface = self.mesh.surface();
        let point = surface.at_chart(&self.mesh.vertices()[vertex as usize].site);
        let n = surface.local(&point).map_or(Vector3::z_axis(), |l| l.n);
        let normal = UnitVector3::new_unchecked(if self.front { *n } else { -*n });
        let own = Anchor { shape: self.shape, point };
        let others = tracer.contacts(&point.x);
        let start = others.into_iter().filter(|a| a.shape != self.shape);
        (Receiver { position: point.x, normal }, std::iter::once(own).chain(start).collect())
    }

    /// What a vertex receives from lamps.
    pub fn light(
        &self,
        transfer: &Transfer<'_>,
        tracer: &Tracer<'_>,
        vertex: u32,
    ) -> ReceiverLight {
        let both = Components { direct: true, specular: true };
        transfer.light(&self.receiver(tracer, vertex).0, both)
    }

    /// Luminance of what a vertex receives from lamps [W/m²].
    fn luminance(&self, vertex: u32) -> f64 {
        self.lamps.get(vertex as usize).map_or(0.0, |l| (l.direct + l.specular).luminance())
    }

    /// Flux from lamps, its luminance [W].
    pub fn received(&self) -> f64 {
        let of = |t: u32| {
            let (corners, weights) = (self.mesh.corners(t), self.mesh.weights(t));
            (0..3).map(|c| self.luminance(corners[c]) * weights[c]).sum::<f64>()
        };
        self.mesh.triangles().map(of).sum()
    }

    /// Flux from lamps that linear interpolation over a triangle is wrong by, roughly and without sign [W]: an
    /// eighth of what the vertices beyond its edges differ by from the plane through its own. (For
    /// second derivatives that is the error of the interpolation to within a factor of two; where light
    /// ends at an edge in the triangle, less than it.)
    pub fn interpolation_error(&self, triangle: u32) -> f64 {
        let values = self.mesh.corners(triangle).map(|v| self.luminance(v));
        let [a, b, c] = self.mesh.positions(triangle);
        let (p, q) = (b - a, c - a);
        let (pp, pq, qq) = (p.norm_squared(), p.dot(&q), q.norm_squared());
        let determinant = pp * qq - pq * pq;
        let mut most: f64 = 0.0;
        for edge in 0..3 {
            let Some(beyond) = self.mesh.beyond(triangle, edge) else { continue };
            let x = self.mesh.vertices()[beyond as usize].position - a;
            let (xp, xq) = (x.dot(&p), x.dot(&q));
            let (s, t) = ((xp * qq - xq * pq) / determinant, (xq * pp - xp * pq) / determinant);
            let plane = values[0] + s * (values[1] - values[0]) + t * (values[2] - values[0]);
            let difference = (plane - self.luminance(beyond)).abs();
            if difference.is_finite() {
                most = most.max(difference);
            }
        }
        0.125 * most * self.mesh.weights(triangle).iter().sum::<f64>()
    }
}
