//! Lamps as seen by a family of rays: edge functions that are positive where a ray hits.
//!
//! For polygons the functions are Plücker side products of the ray with the edges, written in the
//! lamp's own frame: smooth where the hit point runs to infinity, and linear in an unnormalised
//! direction. They ask for the lamp in front as well, since two opposite sides can only both be
//! positive for a ray that runs against the lamp's normal.

use arrayvec::ArrayVec;

use super::extension::facet_of;
use super::landing::Target;
use crate::geometry::{Matrix3, Point3, Rgb, Transform, Vector3};
use crate::optics::{Dual, DualRay, DualVector};
use crate::scene::{Scene, ShapeId};
use crate::surface::{Mesh, Surface};
use crate::trace::Anchor;

/// Most edge functions of a lamp.
pub const MAX_LAMP_EDGES: usize = 6;
/// Most triangles of a mesh that are lamps of their own; beyond a few dozen, terms by triangle
/// outnumber the cells of one.
const MAX_OUTLINED: usize = 64;

/// One lamp, or one flat part of a lamp.
#[derive(Clone, Debug)]
pub struct Lamp {
    /// The shape that emits.
    pub shape: ShapeId,
    /// The first triangle of the part, for a small mesh.
    pub primitive: Option<u32>,
    /// Radiance on the front [W/(m² sr)].
    pub radiance: Rgb,
    outline: Outline,
}

#[derive(Clone, Debug)]
enum Outline {
    /// |x|, |y| ≤ 1 in the frame, emitting towards +z.
    Square(Frame),
    /// x² + y² ≤ 1.
    Disc(Frame),
    /// x, y ≥ 0, x + y ≤ 1.
    Triangle(Frame),
    /// Centre and radius; emits outward.
    Ball(Vector3, f64),
    /// Known only by asking the tracer.
    Sampled,
}

/// Lamp coordinates from world coordinates.
#[derive(Clone, Debug)]
struct Frame {
    linear: Matrix3,
    origin: Vector3,
}

impl Frame {
    /// From two edge vectors spanning the plane and the emitting side's normal.
    fn new(origin: Vector3, e1: Vector3, e2: Vector3, normal: Vector3) -> Option<Self> {
        Some(Self { linear: Matrix3::from_columns(&[e1, e2, normal]).try_inverse()?, origin })
    }

    fn local(&self, ray: &DualRay) -> (DualVector, DualVector) {
        let o = ray.o - DualVector::constant(self.origin);
        (o.mapped(&self.linear), ray.d.mapped(&self.linear))
    }
}

/// Functions that are all positive where the ray hits the lamp's emitting side.
pub type LampEdges = ArrayVec<Dual, MAX_LAMP_EDGES>;

impl Lamp {
    /// All lamps of a scene, small meshes by flat parts.
    pub fn of(scene: &Scene) -> Vec<Self> {
        scene.lamps().flat_map(|id| Self::of_shape(scene, id)).collect()
    }

    fn of_shape(scene: &Scene, shape: ShapeId) -> Vec<Self> {
        let emitter = scene.shape(shape);
        let radiance = emitter.radiance;
        let lamp = |primitive, outline| Self { shape, primitive, radiance, outline };
        let planar = |t: &Transform, normal: Vector3| {
            let axis = |v| t.vector(&v);
            Frame::new(
                t.point(&Point3::origin()).coords,
                axis(Vector3::x()),
                axis(Vector3::y()),
                normal,
            )
        };
        match &emitter.surface {
            Surface::Rectangle(r) => match planar(r.world_from_object(), r.normal().into_inner()) {
                Some(frame) => vec![lamp(None, Outline::Square(frame))],
                None => Vec::new(),
            },
            Surface::Disk(d) => match planar(d.world_from_object(), d.normal().into_inner()) {
                Some(frame) => vec![lamp(None, Outline::Disc(frame))],
                None => Vec::new(),
            },
            Surface::Sphere(s) if s.faces_outward() => {
                vec![lamp(None, Outline::Ball(s.centre().coords, s.radius()))]
            }
            // Vertex normals say nothing about what a lamp covers.
            Surface::Mesh(m) if outlined(&emitter.surface) => (0..m.triangles().len() as u32)
                .filter(|&t| part_of(m, t) == t)
                .filter_map(|t| Some(lamp(Some(t), part_outline(m, t)?)))
                .collect(),
            _ => vec![lamp(None, Outline::Sampled)],
        }
    }

    /// What a chain meets that lands on it.
    pub fn target(&self) -> Target {
        Target { shape: self.shape, primitive: self.primitive, front: true, lamp: true }
    }

    /// Whether a hit is on it.
    pub fn is_hit(&self, anchor: &Anchor, scene: &Scene) -> bool {
        anchor.shape == self.shape
            && self.primitive.is_none_or(|part| match &scene.shape(self.shape).surface {
                Surface::Mesh(m) => part_of(m, anchor.point.primitive) == part,
                _ => true,
            })
    }

    /// Whether [`Self::edges`] describes the lamp; else only the tracer knows what hits it.
    pub fn has_outline(&self) -> bool {
        !matches!(self.outline, Outline::Sampled)
    }

    /// The edge functions along a family of rays; empty for a lamp without outline.
    pub fn edges(&self, ray: &DualRay) -> LampEdges {
        let mut list = LampEdges::new();
        match &self.outline {
            Outline::Square(frame) => {
                let (o, m, p, q) = crossing(frame, ray);
                list.extend([m + p, m - p, m + q, m - q, o]);
            }
            Outline::Triangle(frame) => {
                let (o, m, p, q) = crossing(frame, ray);
                list.extend([p, q, m - p - q, o]);
            }
            Outline::Disc(frame) => {
                let (o, m, p, q) = crossing(frame, ray);
                // The square around the disc, whose sides bend little, finds it in large cells.
                list.extend([m + p, m - p, m + q, m - q, o]);
                list.push(m.squared() - p.squared() - q.squared());
            }
            Outline::Ball(centre, radius) => {
                let to = DualVector::constant(*centre) - ray.o;
                let moment = to.cross(&ray.d).norm_squared();
                list.push(ray.d.norm_squared() * (radius * radius) - moment);
                list.push(to.dot(&ray.d));
            }
            Outline::Sampled => {}
        }
        list
    }

    /// Distance along the central ray at which it passes the lamp [m]; `None` if it never does.
    pub fn passes_at(&self, ray: &DualRay) -> Option<f64> {
        let t = match &self.outline {
            Outline::Square(frame) | Outline::Disc(frame) | Outline::Triangle(frame) => {
                let (o, d) = frame.local(ray);
                -o.v.z / d.v.z
            }
            Outline::Ball(centre, radius) => {
                let to = centre - ray.o.v;
                let along = to.dot(&ray.d.v);
                let inside = radius * radius - (to.norm_squared() - along * along);
                along - inside.max(0.0).sqrt()
            }
            Outline::Sampled => return None,
        };
        (t > 0.0 && t.is_finite()).then_some(t)
    }
}

/// Whether the flat parts of a surface are lamps of their own.
pub fn outlined(surface: &Surface) -> bool {
    matches!(surface, Surface::Mesh(m) if m.triangles().len() <= MAX_OUTLINED)
}

/// The number of the lamp among a mesh's flat parts that a triangle belongs to. Two triangles that
/// make a parallelogram are one lamp: the diagonal between them is no edge of light.
pub fn part_of(mesh: &Mesh, triangle: u32) -> u32 {
    if mesh.is_smooth() { triangle } else { facet_of(mesh, triangle).id }
}

/// The outline of the flat part that a triangle is the first of.
fn part_outline(mesh: &Mesh, triangle: u32) -> Option<Outline> {
    // Vertex normals, where there are any, say which side is the front.
    let front = mesh.local(&mesh.at(triangle, 1.0 / 3.0, 1.0 / 3.0))?.ng.into_inner();
    let facet = facet_of(mesh, triangle);
    if facet.quad && !mesh.is_smooth() {
        let [e1, e2] = facet.edges.map(|e| e * 0.5);
        return Some(Outline::Square(Frame::new(facet.origin.coords + e1 + e2, e1, e2, front)?));
    }
    let [v0, v1, v2] = mesh.corners(triangle);
    Some(Outline::Triangle(Frame::new(v0.coords, v1 - v0, v2 - v0, front)?))
}

/// Height o above the lamp, descent m, and the crossing point times m.
fn crossing(frame: &Frame, ray: &DualRay) -> (Dual, Dual, Dual, Dual) {
    let (o, d) = frame.local(ray);
    let part = |v: &DualVector, k: usize| Dual::new(v.v[k], v.a[k], v.b[k]);
    let (oz, m) = (part(&o, 2), -part(&d, 2));
    (oz, m, part(&o, 0) * m + part(&d, 0) * oz, part(&o, 1) * m + part(&d, 1) * oz)
}
