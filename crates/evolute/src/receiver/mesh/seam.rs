//! Seams: edges whose two sides have vertices of their own, for light that is not continuous there.

use super::{Change, INSET, Side, TriangleMesh, Vertex};
use crate::geometry::Vector3;
use crate::surface::ChartPoint;

/// A place that has no more than this of a triangle's corner opposite an edge lies on that edge.
const ON_EDGE: f64 = 1e-3 * INSET;

impl TriangleMesh<'_> {
    /// Whether an edge is a seam.
    pub fn is_seam(&self, triangle: u32, edge: usize) -> bool {
        self.triangles[triangle as usize].is_severed[edge]
    }

    /// Makes an edge between two triangles a seam. A vertex at the end of it that other triangles still hold together
    /// stays one; else either side has one, the new one with the number of the former count. Both lie a little inside.
    pub(super) fn sever(&mut self, side: Side) {
        let Some(other) = self.across(side) else { return };
        let Side { triangle, edge } = side;
        self.history.push(Change { triangle, edge, fraction: None });
        for s in [side, other] {
            let t = &mut self.triangles[s.triangle as usize];
            t.neighbours[usize::from(s.edge)] = None;
            t.is_severed[usize::from(s.edge)] = true;
        }
        for vertex in self.triangles[triangle as usize].ends(edge.into()) {
            let own = self.fan(triangle, vertex);
            if own.contains(&other.triangle) {
                continue;
            }
            let others = self.fan(other.triangle, vertex);
            let [in_own, in_others] = [&own, &others].map(|fan| self.is_inside(fan, vertex));
            // Where the vertex was already put inside of one side it stays.
            let (stays, moves) = if in_others && !in_own { (others, own) } else { (own, others) };
            if in_own == in_others {
                self.vertices[vertex as usize].site = self.inset(&stays, vertex);
            }
            let copy =
                Vertex { site: self.inset(&moves, vertex), ..self.vertices[vertex as usize] };
            let number = self.vertices.len() as u32;
            self.vertices.push(copy);
            for t in moves {
                for v in &mut self.triangles[t as usize].vertices {
                    if *v == vertex {
                        *v = number;
                    }
                }
            }
        }
    }

    /// The triangles around a vertex that are held together by their edges there, from one of them on.
    fn fan(&self, triangle: u32, vertex: u32) -> Vec<u32> {
        let mut fan = vec![triangle];
        let mut next = 0;
        while let Some(&t) = fan.get(next) {
            next += 1;
            let t = &self.triangles[t as usize];
            for e in (0..3).filter(|&e| t.ends(e).contains(&vertex)) {
                if let Some(n) = t.neighbours[e].map(|s| s.triangle)
                    && !fan.contains(&n)
                {
                    fan.push(n);
                }
            }
        }
        fan
    }

    /// A point at a vertex, a little inside of a triangle around it: of that which points away most from the seams, for
    /// between a seam and the line that it stands for there may be a little of the other side.
    fn inset(&self, fan: &[u32], vertex: u32) -> ChartPoint {
        let position = self.vertices[vertex as usize].position;
        let mut seams: Vec<Vector3> = Vec::new();
        for &t in fan {
            let t = &self.triangles[t as usize];
            for e in (0..3).filter(|&e| t.is_severed[e] && t.ends(e).contains(&vertex)) {
                let [a, b] = t.ends(e).map(|v| self.vertices[v as usize].position);
                seams.push((if t.ends(e)[0] == vertex { b - a } else { a - b }).normalize());
            }
        }
        let towards_seam = |t: u32| {
            let middle =
                self.positions(t).iter().fold(Vector3::zeros(), |sum, p| sum + (p - position));
            seams.iter().map(|s| s.dot(&middle.normalize())).fold(-1.0, f64::max)
        };
        let best = fan.iter().copied().min_by(|&a, &b| towards_seam(a).total_cmp(&towards_seam(b)));
        let t = &self.triangles[best.unwrap_or(fan[0]) as usize];
        let corner = (0..3).find(|&i| t.vertices[i] == vertex).unwrap_or(0);
        let (at, middle) = (t.corners[corner], t.middle());
        ChartPoint { chart: t.chart, at: [0, 1].map(|i| at[i] + INSET * (middle[i] - at[i])) }
    }

    /// Whether the place where a vertex's light is computed lies inside of triangles around it, and not on the edges
    /// where they end.
    fn is_inside(&self, fan: &[u32], vertex: u32) -> bool {
        let site = self.vertices[vertex as usize].site;
        fan.iter().any(|&t| {
            let t = &self.triangles[t as usize];
            if t.chart != site.chart || t.corners.contains(&site.at) {
                return false;
            }
            let whole = t.chart_area();
            (0..3).all(|e| {
                let share = super::area(t.corners[e], t.corners[(e + 1) % 3], site.at) / whole;
                share > if t.neighbours[e].is_some() { -ON_EDGE } else { ON_EDGE }
            })
        })
    }
}
