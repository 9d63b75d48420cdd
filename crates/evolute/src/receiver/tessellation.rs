//! Surfaces as triangles with normals, for programs that know no formulas.

use std::collections::BTreeMap;

use super::mesh::TriangleMesh;
use crate::geometry::{Point3, Vector3};
use crate::surface::{ChartPoint, Surface};

/// A surface of one chart as triangles in the world frame.
///
/// Guarantees: vertices lie on the surface; triangles are counter-clockwise seen from the front; no
/// edge ends in the middle of another (no T-vertex), and across a seam or at a pole vertices are doubled
/// for their coordinates' sake, but have the same position to the last bit. Edges are of one length to
/// about a factor of two where the parameters run at an even pace, and nowhere much longer than there.
/// Limits: a normal on a crease is that of one of its sides; where two surfaces meet, each has edges of
/// its own, so that gaps as wide as the triangles' sagitta may be between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Tessellation {
    /// Vertices [m].
    pub positions: Vec<Point3>,
    /// Unit normal of the surface at each vertex, on the front.
    pub normals: Vec<Vector3>,
    /// Chart coordinates of each vertex: (s, t) of a `parametric`.
    pub coordinates: Vec<[f64; 2]>,
    /// Vertices of each triangle.
    pub triangles: Vec<[u32; 3]>,
}

/// Where a normal is looked for if there is none at a vertex (a cone's tip): this part of the way to the
/// middle of the triangle.
const INWARDS: f64 = 1e-3;

/// Coordinates that agree to this are the same: neighbours know the middle of an edge to rounding.
const SAME: f64 = 1e-12;

impl Tessellation {
    /// At least `count` triangles over a surface with an area, roughly equal in space.
    pub fn new(surface: &Surface, count: usize) -> Self {
        let count = count.max(1);
        // The first lattice has two triangles for a square of this side.
        let mut edge = (2.0 * surface.area() / count as f64).sqrt();
        loop {
            let mesh = TriangleMesh::new(surface, edge);
            let tessellation = Self::of(&mesh);
            let made = tessellation.triangles.len();
            if made >= count {
                return tessellation;
            }
            // By the law of areas, and a little more: no way to come near for ever.
            edge *= 0.95 * (made.max(1) as f64 / count as f64).sqrt();
        }
    }

    /// The triangles of a mesh that are not cut.
    fn of(mesh: &TriangleMesh<'_>) -> Self {
        let surface = mesh.surface();
        let inverted = is_inverted(surface);
        let mut made = Self {
            positions: Vec::new(),
            normals: Vec::new(),
            coordinates: Vec::new(),
            triangles: Vec::new(),
        };
        let mut numbers: BTreeMap<(u32, [i64; 2]), u32> = BTreeMap::new();
        for triangle in mesh.triangles() {
            let corners = mesh.corners(triangle);
            let [a, b, c] = corners;
            // At a pole one edge of the chart is a point.
            if a == b || b == c || c == a {
                continue;
            }
            let mut vertices = [0, 1, 2].map(|i| {
                let mut weights = [0.0; 3];
                weights[i] = 1.0;
                let place = mesh.at(triangle, weights);
                let key = (corners[i], place.at.map(|x| (x / SAME).round() as i64));
                *numbers.entry(key).or_insert_with(|| {
                    made.positions.push(mesh.vertices()[corners[i] as usize].position);
                    let inside =
                        mesh.at(triangle, weights.map(|w| (1.0 - INWARDS) * w + INWARDS / 3.0));
                    made.normals.push(
                        normal(surface, &place)
                            .or_else(|| normal(surface, &inside))
                            .unwrap_or_else(|| facet_normal(mesh, triangle, inverted)),
                    );
                    made.coordinates.push(place.at);
                    made.positions.len() as u32 - 1
                })
            });
            if inverted {
                vertices.swap(1, 2);
            }
            made.triangles.push(vertices);
        }
        made
    }
}

/// Whether the front is the side from which triangles of the chart are clockwise.
fn is_inverted(surface: &Surface) -> bool {
    matches!(surface, Surface::Parametric(p) if p.normal_sign() < 0.0)
}

/// The front normal at a point of a chart, where there is one.
fn normal(surface: &Surface, place: &ChartPoint) -> Option<Vector3> {
    surface.local(&surface.at_chart(place)).map(|l| l.n.into_inner())
}

/// The normal of a triangle itself, towards the front.
fn facet_normal(mesh: &TriangleMesh<'_>, triangle: u32, inverted: bool) -> Vector3 {
    let [a, b, c] = mesh.positions(triangle);
    let across = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::z);
    if inverted { -across } else { across }
}
