//! Charts: plane coordinates over parts of a surface, in which its triangles are straight.
//!
//! A chart is smooth and one-to-one, so that linear interpolation over it is of second order everywhere:
//! a sphere has no pole here, a disk no centre, a cylinder's seam is an edge like any other.
//!
//! | surface | charts | coordinates |
//! |---|---|---|
//! | rectangle, disk | one | x, y of the object: [−1, 1]², the unit disk |
//! | cylinder | one | turn, height: [0, 1]² |
//! | parametric | one | s, t: [0, 1]² |
//! | sphere | the 20 faces of an icosahedron | weights of the face's second and third corner, seen from the centre |
//! | mesh | its triangles | weights of the second and third corner |

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use super::{Surface, SurfacePoint};
use crate::geometry::{Matrix3, Vector3};

/// A point of a surface, by the coordinates of one of its charts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChartPoint {
    /// Which chart; 0 where there is one only.
    pub chart: u32,
    /// Coordinates in it.
    pub at: [f64; 2],
}

impl Surface {
    /// How many charts it has, numbered from 0.
    pub fn charts(&self) -> usize {
        match self {
            Self::Mesh(m) => m.triangles().len(),
            Self::Sphere(_) => sphere_charts().len(),
            _ => 1,
        }
    }

    /// The chart that a point of the surface lies in, and where.
    pub fn chart_point(&self, point: &SurfacePoint) -> ChartPoint {
        match self {
            Self::Rectangle(_) | Self::Disk(_) | Self::Parametric(_) => {
                ChartPoint { chart: 0, at: [point.p, point.q] }
            }
            Self::Cylinder(s) => ChartPoint { chart: 0, at: s.uv(point) },
            Self::Mesh(_) => ChartPoint { chart: point.primitive, at: [point.p, point.q] },
            Self::Sphere(s) => {
                let [x, y, z] = s.axes();
                let d = point.x - s.centre();
                ICOSAHEDRON.locate(&Vector3::new(d.dot(&x), d.dot(&y), d.dot(&z)))
            }
        }
    }

    /// The surface point of chart coordinates, which are moved into the surface's domain if rounding has
    /// put them outside.
    pub fn at_chart(&self, point: &ChartPoint) -> SurfacePoint {
        let [p, q] = point.at;
        match self {
            Self::Rectangle(s) => s.at(p.clamp(-1.0, 1.0), q.clamp(-1.0, 1.0)),
            Self::Disk(s) => {
                let r = (p * p + q * q).sqrt().max(1.0);
                s.at(p / r, q / r)
            }
            Self::Parametric(s) => s.point(p.clamp(0.0, 1.0), q.clamp(0.0, 1.0)),
            Self::Cylinder(s) => s.at_turn(p, q.clamp(0.0, 1.0)),
            Self::Mesh(s) => s.at(point.chart, p, q),
            Self::Sphere(s) => {
                let [x, y, z] = s.axes();
                let d = ICOSAHEDRON.direction(point);
                s.towards(&(x * d.x + y * d.y + z * d.z).normalize())
            }
        }
    }

    /// Area of the surface for an area of the chart there [m²].
    pub fn area_element(&self, point: &ChartPoint) -> f64 {
        let [p, q] = point.at;
        match self {
            Self::Rectangle(s) => 0.25 * s.area(),
            Self::Disk(s) => s.area() / std::f64::consts::PI,
            Self::Parametric(s) => s.jet(p.clamp(0.0, 1.0), q.clamp(0.0, 1.0)).area_vector().norm(),
            Self::Cylinder(s) => s.area(),
            Self::Mesh(s) => {
                let [a, b] = s.tangents(&s.at(point.chart, p, q));
                a.cross(&b).norm()
            }
            Self::Sphere(s) => {
                let d = ICOSAHEDRON.direction(point).norm();
                s.radius() * s.radius() * ICOSAHEDRON.volume / (d * d * d)
            }
        }
    }
}

/// The three corners of each chart of a sphere, by number, counter-clockwise from outside.
pub(crate) fn sphere_charts() -> &'static [[u32; 3]] {
    &ICOSAHEDRON.faces
}

/// The icosahedron whose faces are a sphere's charts.
struct Icosahedron {
    corners: Vec<Vector3>,
    faces: Vec<[u32; 3]>,
    /// Weights of the three corners from a direction, up to a factor.
    weights: Vec<Matrix3>,
    /// Six times the volume between a face and the centre.
    volume: f64,
}

static ICOSAHEDRON: LazyLock<Icosahedron> = LazyLock::new(Icosahedron::new);

impl Icosahedron {
    fn new() -> Self {
        let golden = 0.5 * (1.0 + 5f64.sqrt());
        let mut corners = Vec::new();
        for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
            for turned in [[0.0, a, b], [a, b, 0.0], [b, 0.0, a]] {
                corners.push(Vector3::from(turned).normalize());
            }
        }
        let edge = 2.0 / (1.0 + golden * golden).sqrt();
        let close = |i: usize, j: usize| (corners[i] - corners[j]).norm() < 1.1 * edge;
        let (mut faces, mut weights, mut volume) = (Vec::new(), Vec::new(), 0.0);
        for i in 0..12 {
            for j in i + 1..12 {
                for k in j + 1..12 {
                    if close(i, j) && close(j, k) && close(k, i) {
                        let m = Matrix3::from_columns(&[corners[i], corners[j], corners[k]]);
                        let face = if m.determinant() > 0.0 { [i, j, k] } else { [i, k, j] };
                        let m = Matrix3::from_columns(&face.map(|c| corners[c]));
                        volume = m.determinant();
                        weights.extend(m.try_inverse());
                        faces.push(face.map(|c| c as u32));
                    }
                }
            }
        }
        Self { corners, faces, weights, volume }
    }

    /// The face that a direction points at: the one that it points at most.
    fn locate(&self, d: &Vector3) -> ChartPoint {
        let least = |face: usize| {
            let w = self.weights[face] * d;
            (w / w.sum().max(f64::MIN_POSITIVE)).min()
        };
        let (mut chart, mut best) = (0, f64::NEG_INFINITY);
        for face in 0..self.faces.len() {
            if (self.weights[face] * d).sum() > 0.0 && least(face) > best {
                (chart, best) = (face, least(face));
            }
        }
        let w = self.weights[chart] * d;
        ChartPoint { chart: chart as u32, at: [w[1] / w.sum(), w[2] / w.sum()] }
    }

    /// Direction of chart coordinates, not of length one.
    fn direction(&self, point: &ChartPoint) -> Vector3 {
        let [a, b, c] = self.faces[point.chart as usize].map(|c| self.corners[c as usize]);
        a + (b - a) * point.at[0] + (c - a) * point.at[1]
    }
}
