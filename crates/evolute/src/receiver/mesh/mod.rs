//! Triangles over the charts of a surface, refined by cutting edges; conforming at all times.
//!
//! Edges are cut in both triangles that share them, so there is no T-vertex, as in Yu & Wu, 3.5. A
//! triangle that is cut keeps its place as the root of its parts: a point is found by descending. Along the lines on which
//! other surfaces stand, neighbours are severed: each side has vertices of its own.

mod integrals;
mod locator;
mod refinement;
mod seam;

use serde::{Deserialize, Serialize};

use super::roots::{Root, Roots};
use crate::geometry::Point3;
use crate::surface::{ChartPoint, Surface};
use integrals::INTEGRAL_ACCURACY;
pub use locator::Locator;

/// A corner of triangles, where light is computed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Where it is [m].
    pub position: Point3,
    /// Where light is computed for it: the same, but a little inside one of its triangles if it lies on
    /// the border of the mesh. What touches the surface there (a wall at the end of a floor) is then
    /// seen from the right side.
    pub site: ChartPoint,
    /// The ends of the edge on which it was put, and how far from the first to the second.
    pub parents: Option<([u32; 2], f64)>,
}

/// An edge of a triangle, by the corner at which it begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Side {
    triangle: u32,
    edge: u8,
}

/// A triangle, cut or not.
#[derive(Clone, Debug, PartialEq)]
struct Triangle {
    chart: u32,
    /// Corners, counter-clockwise in the chart.
    vertices: [u32; 3],
    corners: [[f64; 2]; 3],
    /// What is on the other side of the edge from corner i to corner i + 1.
    neighbours: [Option<Side>; 3],
    /// Whether nothing is because it was severed.
    is_severed: [bool; 3],
    /// ∫ φ dA of the linear functions that are 1 at one corner and 0 at the others [m²].
    weights: [f64; 3],
}

/// How a triangle was cut: by a line from a point of an edge to the opposite corner. Points are looked for in these, by
/// the million: in single precision twice as many stay close at hand, and a point so near to a line may as well
/// lie on its other side.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Cut {
    /// The part with the begin of the edge; the one with its end comes after it. None is 0: not cut.
    first: u32,
    from: [f32; 2],
    along: [f32; 2],
}

impl Cut {
    fn is_made(&self) -> bool {
        self.first != 0
    }

    /// The part that a point of the chart lies in: 0 or 1.
    fn side(&self, at: [f64; 2]) -> usize {
        let [x, y] = [at[0] as f32 - self.from[0], at[1] as f32 - self.from[1]];
        usize::from(self.along[0] * y < self.along[1] * x)
    }
}

/// A change of a mesh, which [`TriangleMesh::change`] makes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// A triangle, and an edge of it by the corner at which that begins, 0 to 2.
    pub triangle: u32,
    /// See there.
    pub edge: u8,
    /// That is cut: how far from its begin to its end, between 0 and 1. `None`: the triangles on its sides are severed.
    pub fraction: Option<f64>,
}

/// Where a point lies in a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The triangle.
    pub triangle: u32,
    /// Its corners.
    pub vertices: [u32; 3],
    /// Weights of the corners in linear interpolation; they add up to 1.
    pub weights: [f64; 3],
}

/// A conforming mesh of triangles over one surface.
#[derive(Clone, Debug)]
pub struct TriangleMesh<'s> {
    surface: &'s Surface,
    vertices: Vec<Vertex>,
    triangles: Vec<Triangle>,
    /// Where each triangle was cut, if it was.
    cuts: Vec<Cut>,
    roots: Roots,
    /// Changes since the mesh was made, in order.
    history: Vec<Change>,
}

/// How far into a triangle a border's vertex is put, as a part of the way to its middle: far more than
/// rounding, and less than anything that matters to its light.
const INSET: f64 = 1e-4;

impl<'s> TriangleMesh<'s> {
    /// Triangles with edges of about `edge` [m] and at most half as long again.
    pub fn new(surface: &'s Surface, edge: f64) -> Self {
        let roots = Roots::new(surface, edge);
        let mut mesh = Self {
            surface,
            vertices: Vec::new(),
            triangles: Vec::new(),
            cuts: Vec::new(),
            roots,
            history: Vec::new(),
        };
        mesh.plant();
        mesh.refine_to(1.5 * edge);
        mesh.history.clear();
        mesh
    }

    /// Sets vertices and triangles to the roots'.
    fn plant(&mut self) {
        let triangles: Vec<Triangle> = self.roots.triangles().iter().map(Triangle::of).collect();
        self.triangles = triangles;
        self.cuts = vec![Cut::default(); self.triangles.len()];
        self.link();
        let count = self.triangles.iter().flat_map(|t| t.vertices).max().map_or(0, |v| v + 1);
        // The first triangle has a vertex, or the first that knows it to be on the border.
        let mut vertices: Vec<Option<(bool, Vertex)>> = vec![None; count as usize];
        for t in 0..self.triangles.len() {
            let triangle = &self.triangles[t];
            for i in 0..3 {
                let on_border = self.is_on_border(t as u32, i);
                let slot = &mut vertices[triangle.vertices[i] as usize];
                if slot.is_none_or(|(known, _)| on_border && !known) {
                    *slot =
                        Some((on_border, self.vertex(triangle, triangle.corners[i], on_border)));
                }
            }
        }
        self.vertices = vertices.into_iter().flatten().map(|v| v.1).collect();
        debug_assert_eq!(self.vertices.len(), count as usize);
        for t in 0..self.triangles.len() {
            self.triangles[t].weights = self.integrals(&self.triangles[t]);
        }
    }

    /// Finds the neighbours of all roots: pairs of edges between the same two vertices.
    fn link(&mut self) {
        let mut edges: Vec<([u32; 2], Side)> = Vec::new();
        for (t, triangle) in self.triangles.iter().enumerate() {
            for edge in 0..3u8 {
                let [a, b] = triangle.ends(edge.into());
                if a != b {
                    edges.push(([a.min(b), a.max(b)], Side { triangle: t as u32, edge }));
                }
            }
        }
        edges.sort_by_key(|(ends, side)| (*ends, side.triangle, side.edge));
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            // Where three sheets meet none of them goes on as the other.
            if let [(_, a), (_, b)] = group {
                self.triangles[a.triangle as usize].neighbours[usize::from(a.edge)] = Some(*b);
                self.triangles[b.triangle as usize].neighbours[usize::from(b.edge)] = Some(*a);
            }
        }
    }

    /// Whether a corner of a triangle is an end of one of its edges on the border. A corner at which only
    /// other triangles reach the border is found by those.
    fn is_on_border(&self, t: u32, corner: usize) -> bool {
        let t = &self.triangles[t as usize];
        [corner, (corner + 2) % 3]
            .iter()
            .any(|&e| t.neighbours[e].is_none() && t.ends(e)[0] != t.ends(e)[1])
            || t.is_collapsed(corner)
    }

    /// A vertex at a corner of a triangle.
    fn vertex(&self, triangle: &Triangle, at: [f64; 2], on_border: bool) -> Vertex {
        let here = ChartPoint { chart: triangle.chart, at };
        let position = self.surface.at_chart(&here).x;
        let site = if on_border {
            let middle = triangle.middle();
            ChartPoint { at: [0, 1].map(|i| at[i] + INSET * (middle[i] - at[i])), ..here }
        } else {
            here
        };
        Vertex { position, site, parents: None }
    }

    /// The surface.
    pub fn surface(&self) -> &'s Surface {
        self.surface
    }

    /// All vertices; their numbers do not change when the mesh is refined.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
    }

    /// Number of all triangles, cut or not.
    pub fn triangle_count(&self) -> u32 {
        self.triangles.len() as u32
    }

    /// Numbers of the triangles that are not cut, in increasing order.
    pub fn triangles(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.cuts).filter(|(_, cut)| !cut.is_made()).map(|(i, _)| i)
    }

    /// Whether a triangle is not cut.
    pub fn is_whole(&self, triangle: u32) -> bool {
        !self.cuts[triangle as usize].is_made()
    }

    /// Corners of a triangle.
    pub fn corners(&self, triangle: u32) -> [u32; 3] {
        self.triangles[triangle as usize].vertices
    }

    /// ∫ φ dA of the linear function of each corner of a triangle [m²]; their sum is its area.
    pub fn weights(&self, triangle: u32) -> [f64; 3] {
        self.triangles[triangle as usize].weights
    }

    /// The triangle on the other side of an edge.
    pub fn next(&self, triangle: u32, edge: usize) -> Option<u32> {
        self.triangles[triangle as usize].neighbours[edge].map(|side| side.triangle)
    }

    /// The vertex opposite an edge of a triangle, in the triangle on its other side.
    pub fn beyond(&self, triangle: u32, edge: usize) -> Option<u32> {
        let side = self.triangles[triangle as usize].neighbours[edge]?;
        let n = &self.triangles[side.triangle as usize];
        Some(n.vertices[(usize::from(side.edge) + 2) % 3])
    }

    /// The point of a triangle that has the given weights of its corners.
    pub fn at(&self, triangle: u32, weights: [f64; 3]) -> ChartPoint {
        let t = &self.triangles[triangle as usize];
        ChartPoint { chart: t.chart, at: t.point(weights) }
    }

    /// Positions of a triangle's corners [m].
    pub fn positions(&self, triangle: u32) -> [Point3; 3] {
        self.corners(triangle).map(|v| self.vertices[v as usize].position)
    }

    /// Where a point of a chart lies in the mesh.
    pub fn locate(&self, point: &ChartPoint) -> Place {
        self.locate_from(self.root_at(point), point)
    }

    /// The first triangle at a point of a chart: the same in all meshes over a surface with first edges of one length.
    pub fn root_at(&self, point: &ChartPoint) -> u32 {
        self.roots.locate(point)
    }

    /// Where a point lies that is in a first triangle.
    fn locate_from(&self, root: u32, point: &ChartPoint) -> Place {
        let mut triangle = root;
        let mut cut = self.cuts[triangle as usize];
        while cut.is_made() {
            triangle = cut.first + cut.side(point.at) as u32;
            cut = self.cuts[triangle as usize];
        }
        let vertices = self.corners(triangle);
        Place { triangle, vertices, weights: self.weights_at(triangle, point) }
    }

    /// Weights of a triangle's corners at a point of its chart that lies in it; they add up to 1.
    pub fn weights_at(&self, triangle: u32, point: &ChartPoint) -> [f64; 3] {
        let t = &self.triangles[triangle as usize];
        let whole = t.chart_area();
        let [a, b, c] = t.corners;
        // Beyond a rim, or by rounding, a weight may be negative.
        let p = (area(c, a, point.at) / whole).clamp(0.0, 1.0);
        let q = (area(a, b, point.at) / whole).clamp(0.0, 1.0 - p);
        [1.0 - p - q, p, q]
    }

    /// Corners of a triangle in its chart, counter-clockwise.
    pub fn chart_corners(&self, triangle: u32) -> [[f64; 2]; 3] {
        self.triangles[triangle as usize].corners
    }

    /// Length of an edge of a triangle, straight through space [m].
    pub fn length(&self, triangle: u32, edge: usize) -> f64 {
        let [a, b] = self.triangles[triangle as usize].ends(edge);
        (self.vertices[a as usize].position - self.vertices[b as usize].position).norm()
    }

    /// The longest edge of a triangle and its length [m].
    pub fn longest_edge(&self, triangle: u32) -> (usize, f64) {
        let mut longest = (0, self.length(triangle, 0));
        for edge in 1..3 {
            let length = self.length(triangle, edge);
            // Of edges that are as long but for rounding the first.
            if length > longest.1 * (1.0 + 1e-9) {
                longest = (edge, length);
            }
        }
        longest
    }

    /// Whether the mesh is what it should be; a sentence that says what is not.
    ///
    /// # Errors
    /// When neighbours do not agree (a T-vertex), a triangle is turned over, or the areas do not add up to
    /// the surface's.
    pub fn validate(&self) -> Result<(), String> {
        let mut sum = 0.0;
        for i in self.triangles() {
            let t = &self.triangles[i as usize];
            if t.chart_area() <= 0.0 {
                return Err(format!("triangle {i} is turned over: {:?}", t.corners));
            }
            sum += t.weights.iter().sum::<f64>();
            for (e, side) in t.neighbours.iter().enumerate() {
                let Some(side) = side else { continue };
                let n = &self.triangles[side.triangle as usize];
                let mut ends = n.ends(side.edge.into());
                ends.reverse();
                if self.cuts[side.triangle as usize].is_made()
                    || n.neighbours[usize::from(side.edge)]
                        != Some(Side { triangle: i, edge: e as u8 })
                    || ends != t.ends(e)
                {
                    return Err(format!("triangles {i} and {} do not agree", side.triangle));
                }
            }
        }
        let area = self.surface.area();
        if (sum - area).abs() > 10.0 * INTEGRAL_ACCURACY * area {
            return Err(format!("the triangles' areas add up to {sum} m², not to {area} m²"));
        }
        Ok(())
    }
}

impl Triangle {
    fn of(root: &Root) -> Self {
        Self {
            chart: root.chart,
            vertices: root.vertices,
            corners: root.corners,
            neighbours: [None; 3],
            is_severed: [false; 3],
            weights: [0.0; 3],
        }
    }

    /// The vertices of an edge.
    fn ends(&self, edge: usize) -> [u32; 2] {
        [self.vertices[edge], self.vertices[(edge + 1) % 3]]
    }

    /// Whether an edge lies on the border of the surface.
    fn is_rim(&self, edge: usize) -> bool {
        self.neighbours[edge].is_none() && !self.is_severed[edge]
    }

    /// Whether an edge of the chart at a corner is one point in space.
    fn is_collapsed(&self, corner: usize) -> bool {
        [corner, (corner + 2) % 3].iter().any(|&e| self.ends(e)[0] == self.ends(e)[1])
    }

    /// The point of given weights of the corners.
    fn point(&self, weights: [f64; 3]) -> [f64; 2] {
        [0, 1].map(|i| (0..3).map(|k| weights[k] * self.corners[k][i]).sum())
    }

    fn middle(&self) -> [f64; 2] {
        self.point([1.0 / 3.0; 3])
    }

    /// In units of the chart.
    fn chart_area(&self) -> f64 {
        let [a, b, c] = self.corners;
        area(a, b, c)
    }
}

/// Area of a triangle of the plane, positive if counter-clockwise.
pub(super) fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
}
