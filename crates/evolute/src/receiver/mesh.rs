//! Triangles over the charts of a surface, refined by cutting edges; conforming at all times.
//!
//! Edges are cut in both triangles that share them, so there is no T-vertex, as in Yu & Wu, 3.5. A
//! triangle that is cut keeps its place as the root of its parts: a point is found by descending.

use serde::{Deserialize, Serialize};

use super::roots::{Root, Roots};
use crate::geometry::{Point3, math};
use crate::surface::{ChartPoint, Surface};

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

    /// The part that a point of the chart lies in.
    fn side(&self, at: [f64; 2]) -> u32 {
        let [x, y] = [at[0] as f32 - self.from[0], at[1] as f32 - self.from[1]];
        self.first + u32::from(self.along[0] * y < self.along[1] * x)
    }
}

/// A cut that was made: what [`TriangleMesh::repeat`] needs to make it again.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EdgeCut {
    /// The triangle, and its edge by the corner at which that begins.
    pub triangle: u32,
    /// 0 to 2.
    pub edge: u8,
    /// How far from the begin of the edge to its end, between 0 and 1.
    pub fraction: f64,
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
    /// Cuts since the mesh was made, in order.
    history: Vec<EdgeCut>,
}

/// How far into a triangle a border's vertex is put, as a part of the way to its middle: far more than
/// rounding, and less than anything that matters to its light.
const INSET: f64 = 1e-4;

/// Accuracy of integrals over a triangle, as a part of its area: what they make of a flux is far below any
/// accuracy that is asked for.
const INTEGRAL_ACCURACY: f64 = 1e-7;

/// A triangle of which the two smaller edges together are longer than the largest by less than this factor
/// is in bad shape: its longest edge is cut before any other (Yu & Wu, 3.5). An isosceles triangle with an
/// angle of 120° has 1.155, a right one 1.414.
const BAD_SHAPE: f64 = 1.15;

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

    /// All cuts since the mesh was made, in order: repeated on a new mesh with the same edges they make this one, bit
    /// by bit.
    pub fn history(&self) -> &[EdgeCut] {
        &self.history
    }

    /// Makes a cut of another mesh's history; whether that is possible.
    pub fn repeat(&mut self, cut: &EdgeCut) -> bool {
        let side = Side { triangle: cut.triangle, edge: cut.edge };
        let possible = (cut.triangle as usize) < self.triangles.len()
            && cut.edge < 3
            && cut.fraction > 0.0
            && cut.fraction < 1.0
            && self.is_whole(cut.triangle)
            && self.length(cut.triangle, cut.edge.into()) > 0.0;
        if possible {
            self.bisect(side, cut.fraction);
        }
        possible
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

    /// ∫ φ dA of each corner's function [m²], to [`INTEGRAL_ACCURACY`] of the triangle's area.
    fn integrals(&self, triangle: &Triangle) -> [f64; 3] {
        let whole = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let area = triangle.chart_area();
        let rough = self.cubature(triangle, whole);
        let tolerance = INTEGRAL_ACCURACY * rough.iter().sum::<f64>();
        let mut sums = self.refined(triangle, whole, rough, tolerance, 0).map(|s| s * area);
        if let Surface::Disk(_) = self.surface {
            // What lies between an edge on the rim and the rim belongs to the edge's ends.
            for edge in (0..3).filter(|&e| triangle.neighbours[e].is_none()) {
                let [p, q] = [triangle.corners[edge], triangle.corners[(edge + 1) % 3]];
                let half = 0.5 * math::hypot(p[0] - q[0], p[1] - q[1]);
                let angle = 2.0 * math::asin(half.min(1.0));
                let segment = 0.5 * (angle - math::sin(angle));
                let element = self.surface.area_element(&ChartPoint { chart: 0, at: p });
                sums[edge] += 0.5 * segment * element;
                sums[(edge + 1) % 3] += 0.5 * segment * element;
            }
        }
        sums
    }

    /// The same over a part of a triangle by the weights of its corners, as a fraction of the chart's area;
    /// `rough` is the cubature over it.
    fn refined(
        &self,
        triangle: &Triangle,
        [a, b, c]: [[f64; 3]; 3],
        rough: [f64; 3],
        tolerance: f64,
        depth: u32,
    ) -> [f64; 3] {
        // Halfway between two corners.
        let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
        let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
        let quarters = [[a, d, f], [d, b, e], [f, e, c], [d, e, f]];
        let parts = quarters.map(|q| self.cubature(triangle, q).map(|x| 0.25 * x));
        let sum =
            |parts: &[[f64; 3]; 4]| [0, 1, 2].map(|i| parts.iter().map(|p| p[i]).sum::<f64>());
        let fine = sum(&parts);
        let change = (0..3).map(|i| (fine[i] - rough[i]).abs()).fold(0.0, f64::max);
        // Kinks and corners of formulas end at the sixth division: 4096 parts.
        if change <= tolerance || depth == 6 {
            return fine;
        }
        let refined = [0, 1, 2, 3].map(|k| {
            let rough = parts[k].map(|x| 4.0 * x);
            let part = self.refined(triangle, quarters[k], rough, tolerance, depth + 1);
            part.map(|x| 0.25 * x)
        });
        sum(&refined)
    }

    /// Mean of φ dA over a part of a triangle's chart, given by the weights of its corners.
    fn cubature(&self, triangle: &Triangle, part: [[f64; 3]; 3]) -> [f64; 3] {
        // Radon's seven points, exact to the fifth degree.
        let root = 15f64.sqrt();
        let (wa, wb) = ((155.0 - root) / 1200.0, (155.0 + root) / 1200.0);
        let mut sums = [0.0; 3];
        let mut add = |weight: f64, at: [f64; 3]| {
            let at = [0, 1, 2].map(|i| (0..3).map(|k| at[k] * part[k][i]).sum::<f64>());
            let point = ChartPoint { chart: triangle.chart, at: triangle.point(at) };
            let area = weight * self.surface.area_element(&point);
            for i in 0..3 {
                sums[i] += area * at[i];
            }
        };
        add(0.225, [1.0 / 3.0; 3]);
        for (w, x) in [(wa, (6.0 - root) / 21.0), (wb, (6.0 + root) / 21.0)] {
            for i in 0..3 {
                let mut at = [x; 3];
                at[i] = 1.0 - 2.0 * x;
                add(w, at);
            }
        }
        sums
    }

    /// The surface.
    pub fn surface(&self) -> &'s Surface {
        self.surface
    }

    /// All vertices; their numbers do not change when the mesh is refined.
    pub fn vertices(&self) -> &[Vertex] {
        &self.vertices
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
    pub fn locate_from(&self, root: u32, point: &ChartPoint) -> Place {
        let mut triangle = root;
        let mut cut = self.cuts[triangle as usize];
        while cut.is_made() {
            triangle = cut.side(point.at);
            cut = self.cuts[triangle as usize];
        }
        let t = &self.triangles[triangle as usize];
        let whole = t.chart_area();
        let [a, b, c] = t.corners;
        // Beyond a rim, or by rounding, a weight may be negative.
        let p = (area(c, a, point.at) / whole).clamp(0.0, 1.0);
        let q = (area(a, b, point.at) / whole).clamp(0.0, 1.0 - p);
        Place { triangle, vertices: t.vertices, weights: [1.0 - p - q, p, q] }
    }

    /// Length of an edge of a triangle, straight through space [m].
    fn length(&self, triangle: u32, edge: usize) -> f64 {
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

    /// Halves edges until none is longer than `length` [m].
    pub fn refine_to(&mut self, length: f64) {
        let mut triangle = 0;
        while triangle < self.triangles.len() {
            while !self.cuts[triangle].is_made() {
                let (edge, longest) = self.longest_edge(triangle as u32);
                if longest <= length {
                    break;
                }
                self.cut(triangle as u32, edge, 0.5);
            }
            triangle += 1;
        }
    }

    /// Cuts an edge of a triangle at a fraction of the way from its begin to its end, in the triangle and
    /// in its neighbour, after the longest edge of either if it is in bad shape; the numbers of new vertices
    /// are those from the former count on. An edge without length, at a pole, is not cut.
    pub fn cut(&mut self, triangle: u32, edge: usize, fraction: f64) {
        if self.length(triangle, edge) <= 0.0 {
            return;
        }
        let ends = self.triangles[triangle as usize].ends(edge);
        // Each round cuts a longer edge than the last, so there is an end.
        while let Some(side) = self.find(triangle, ends) {
            let (own, next) = (side, self.across(side));
            let bad = [Some(own), next].into_iter().flatten().find(|s| {
                let (longest, length) = self.longest_edge(s.triangle);
                let others = (0..3).map(|e| self.length(s.triangle, e)).sum::<f64>() - length;
                longest != usize::from(s.edge)
                    && length > 1.001 * self.length(s.triangle, s.edge.into())
                    && others < BAD_SHAPE * length
            });
            match bad {
                Some(s) => {
                    let longest = self.longest_edge(s.triangle).0;
                    self.cut(s.triangle, longest, 0.5);
                }
                None => return self.bisect(own, fraction),
            }
        }
    }

    /// The part of a triangle, itself if it is not cut, that has the whole edge between two vertices.
    fn find(&self, triangle: u32, ends: [u32; 2]) -> Option<Side> {
        let t = &self.triangles[triangle as usize];
        let cut = self.cuts[triangle as usize];
        if cut.is_made() {
            return (cut.first..cut.first + 2).find_map(|part| self.find(part, ends));
        }
        (0..3u8).find(|&e| t.ends(e.into()) == ends).map(|edge| Side { triangle, edge })
    }

    fn across(&self, side: Side) -> Option<Side> {
        self.triangles[side.triangle as usize].neighbours[usize::from(side.edge)]
    }

    /// Cuts an edge and the one or two triangles that have it.
    fn bisect(&mut self, side: Side, fraction: f64) {
        self.history.push(EdgeCut { triangle: side.triangle, edge: side.edge, fraction });
        let other = self.across(side);
        let at = self.on_edge(side, fraction);
        let t = &self.triangles[side.triangle as usize];
        let parents = Some((t.ends(side.edge.into()), fraction));
        let vertex = Vertex { parents, ..self.vertex(t, at, other.is_none()) };
        let m = self.vertices.len() as u32;
        self.vertices.push(vertex);
        let [a, b] = self.halve(side, m, at);
        if let Some(other) = other {
            let at = self.on_edge(other, 1.0 - fraction);
            let [c, d] = self.halve(other, m, at);
            // Across the edge they run the other way round.
            for (p, q) in [(a, d), (b, c)] {
                self.triangles[p.triangle as usize].neighbours[usize::from(p.edge)] = Some(q);
                self.triangles[q.triangle as usize].neighbours[usize::from(q.edge)] = Some(p);
            }
            for s in [c, d] {
                self.triangles[s.triangle as usize].weights =
                    self.integrals(&self.triangles[s.triangle as usize]);
            }
        }
        for s in [a, b] {
            self.triangles[s.triangle as usize].weights =
                self.integrals(&self.triangles[s.triangle as usize]);
        }
    }

    /// The point of an edge, in its triangle's chart; on the rim if the edge cuts off a piece of a disk.
    fn on_edge(&self, side: Side, fraction: f64) -> [f64; 2] {
        let t = &self.triangles[side.triangle as usize];
        let e = usize::from(side.edge);
        let (p, q) = (t.corners[e], t.corners[(e + 1) % 3]);
        let at = [0, 1].map(|i| p[i] + fraction * (q[i] - p[i]));
        match self.surface {
            Surface::Disk(_) if t.neighbours[e].is_none() => {
                let r = math::hypot(at[0], at[1]);
                [at[0] / r, at[1] / r]
            }
            _ => at,
        }
    }

    /// Puts two parts in the place of a triangle; their sides on the edge that was cut, which have no
    /// neighbour yet.
    fn halve(&mut self, side: Side, vertex: u32, at: [f64; 2]) -> [Side; 2] {
        let whole = self.triangles[side.triangle as usize].clone();
        let [i, j, k] = [0, 1, 2].map(|n| (usize::from(side.edge) + n) % 3);
        let first = self.triangles.len() as u32;
        let part = |corners: [(u32, [f64; 2]); 3], neighbours| Triangle {
            chart: whole.chart,
            vertices: corners.map(|c| c.0),
            corners: corners.map(|c| c.1),
            neighbours,
            weights: [0.0; 3],
        };
        let corner = |n: usize| (whole.vertices[n], whole.corners[n]);
        let middle = (vertex, at);
        let inner = |part: u32, edge| Some(Side { triangle: first + part, edge });
        // Edge 0 of either is the half of the edge that was cut.
        self.triangles
            .push(part([corner(i), middle, corner(k)], [None, inner(1, 2), whole.neighbours[k]]));
        self.triangles
            .push(part([middle, corner(j), corner(k)], [None, whole.neighbours[j], inner(0, 1)]));
        for (part, edge) in [(first, 2), (first + 1, 1)] {
            if let Some(n) = self.triangles[part as usize].neighbours[edge] {
                self.triangles[n.triangle as usize].neighbours[usize::from(n.edge)] =
                    Some(Side { triangle: part, edge: edge as u8 });
            }
        }
        self.cuts.extend([Cut::default(); 2]);
        self.cuts[side.triangle as usize] = Cut {
            first,
            from: at.map(|x| x as f32),
            along: [0, 1].map(|i| (whole.corners[k][i] - at[i]) as f32),
        };
        [first, first + 1].map(|triangle| Side { triangle, edge: 0 })
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
            weights: [0.0; 3],
        }
    }

    /// The vertices of an edge.
    fn ends(&self, edge: usize) -> [u32; 2] {
        [self.vertices[edge], self.vertices[(edge + 1) % 3]]
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
