//! Cutting edges: of the triangles on both sides at once, so that there is never a T-vertex.

use super::{Change, Cut, Side, Triangle, TriangleMesh, Vertex};
use crate::geometry::math;
use crate::surface::Surface;

/// A triangle of which the two smaller edges together are longer than the largest by less than this factor
/// is in bad shape: its longest edge is cut before any other (Yu & Wu, 3.5). An isosceles triangle with an
/// angle of 120° has 1.155, a right one 1.414.
const BAD_SHAPE: f64 = 1.15;

impl TriangleMesh<'_> {
    /// All changes since the mesh was made, in order: repeated on a new mesh with the same edges they make this one, bit
    /// by bit.
    pub fn history(&self) -> &[Change] {
        &self.history
    }

    /// Makes a change, also one of another mesh's history; whether that is possible.
    pub fn change(&mut self, change: &Change) -> bool {
        let Change { triangle, edge, fraction } = *change;
        let side = Side { triangle, edge };
        let exists = (triangle as usize) < self.triangles.len()
            && edge < 3
            && self.is_whole(triangle)
            && self.length(triangle, edge.into()) > 0.0;
        let possible = exists
            && match fraction {
                None => self.across(side).is_some(),
                Some(f) => f > 0.0 && f < 1.0,
            };
        if possible {
            match fraction {
                None => self.sever(side),
                Some(fraction) => self.bisect(side, fraction),
            }
        }
        possible
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

    pub(super) fn across(&self, side: Side) -> Option<Side> {
        self.triangles[side.triangle as usize].neighbours[usize::from(side.edge)]
    }

    /// Cuts an edge and the one or two triangles that have it.
    fn bisect(&mut self, side: Side, fraction: f64) {
        let Side { triangle, edge } = side;
        self.history.push(Change { triangle, edge, fraction: Some(fraction) });
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
            Surface::Disk(_) if t.is_rim(e) => {
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
        let part = |corners: [(u32, [f64; 2]); 3], neighbours, is_severed| Triangle {
            chart: whole.chart,
            vertices: corners.map(|c| c.0),
            corners: corners.map(|c| c.1),
            neighbours,
            is_severed,
            weights: [0.0; 3],
        };
        let severed = |n: usize| whole.is_severed[n];
        let corner = |n: usize| (whole.vertices[n], whole.corners[n]);
        let middle = (vertex, at);
        let inner = |part: u32, edge| Some(Side { triangle: first + part, edge });
        // Edge 0 of either is the half of the edge that was cut.
        self.triangles.push(part(
            [corner(i), middle, corner(k)],
            [None, inner(1, 2), whole.neighbours[k]],
            [severed(i), false, severed(k)],
        ));
        self.triangles.push(part(
            [middle, corner(j), corner(k)],
            [None, whole.neighbours[j], inner(0, 1)],
            [severed(i), severed(j), false],
        ));
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
}
