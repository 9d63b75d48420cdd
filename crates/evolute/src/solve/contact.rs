//! Lines on which other surfaces stand on a sheet: light is not continuous across them, and no value of a mesh may
//! reach through a wall.
//!
//! A line is found by rays along the edges of triangles, close above the sheet. Edges are cut where something steep is
//! met, so that the line runs along edges, and these become seams (`receiver/mesh/seam.rs`). What stands between
//! edges, a table's leg in the middle of a triangle, is found when triangles there are cut for other reasons.

use std::collections::HashSet;

use super::Sheet;
use crate::geometry::{Point3, Ray, Vector3};
use crate::receiver::{Change, TriangleMesh};
use crate::surface::ChartPoint;
use crate::trace::Tracer;

/// Rays run at this height, as a part of the first edges: what ends lower stands on the sheet.
const HEIGHT: f64 = 1e-3;

/// Of the ends of an edge no more than this part is left out: contacts there are those of the corner.
const END: f64 = 1e-4;

/// A corner no further from a line than this part of an edge lies on it.
const ALONG: f64 = 1e-6;

/// Cosine of the angle to the sheet's normal above which a surface does not stand on the sheet, but touches it, as a
/// ball does: light goes to zero there, or passes, and is continuous.
const STEEP: f64 = 0.95;

/// Triangles through which a line does not run straight are cut down to edges of this part of the first ones.
const SHORTEST: f64 = 0.125;

/// Halfway along an edge a line may be off it by this part of the way to the opposite corners.
const STRAIGHT: f64 = 0.05;

/// Whether a line ends on an edge along it is asked at this part of it, and at as much before its end; where it ends is
/// found by so many halvings.
const NEAR_END: f64 = 0.02;
const HALVINGS: u32 = 30;

/// Most steps of a ray along one edge: pieces of it, and what it passes on the way.
const MOST_PIECES: f64 = 32.0;
const MOST_PASSED: usize = 8;

/// Rounds, in each of which every triangle is cut once.
const MOST_ROUNDS: usize = 64;

/// What stands on one sheet.
pub(super) struct Contacts<'c> {
    tracer: &'c Tracer<'c>,
    sheet: &'c Sheet,
    /// [m]
    edge: f64,
    /// Edges, by their vertices, that cross nothing.
    clear: HashSet<[u32; 2]>,
    /// Vertices that cuts have put on a line.
    on_line: HashSet<u32>,
}

impl<'c> Contacts<'c> {
    /// Of a sheet whose first edges have about that length [m].
    pub fn new(tracer: &'c Tracer<'c>, sheet: &'c Sheet, edge: f64) -> Self {
        Self { tracer, sheet, edge, clear: HashSet::new(), on_line: HashSet::new() }
    }

    /// Makes seams in triangles from a number on.
    pub fn mend(mut self, mesh: &mut TriangleMesh<'_>, first: u32) {
        self.straighten(mesh, first);
        for _ in 0..MOST_ROUNDS {
            let count = mesh.triangle_count();
            for t in (first..count).filter(|&t| mesh.is_whole(t)).collect::<Vec<_>>() {
                // A neighbour may have been cut.
                if !mesh.is_whole(t) {
                    continue;
                }
                // The longest first: short ones would be cut into ever flatter triangles beside it.
                let crossed = (0..3u8)
                    .filter_map(|e| self.crossing(mesh, t, e.into()).map(|f| (e, f)))
                    .max_by(|a, b| {
                        mesh.length(t, a.0.into()).total_cmp(&mesh.length(t, b.0.into()))
                    });
                if let Some((edge, fraction)) = crossed {
                    self.on_line.insert(mesh.vertices().len() as u32);
                    mesh.change(&Change { triangle: t, edge, fraction: Some(fraction) });
                }
            }
            if mesh.triangle_count() == count {
                break;
            }
        }
        for t in (first..mesh.triangle_count()).filter(|&t| mesh.is_whole(t)).collect::<Vec<_>>() {
            let ended = (0..3).find_map(|e| self.end(mesh, t, e).map(|f| (e as u8, f)));
            if let Some((edge, fraction)) = ended.filter(|_| mesh.is_whole(t)) {
                self.on_line.insert(mesh.vertices().len() as u32);
                mesh.change(&Change { triangle: t, edge, fraction: Some(fraction) });
            }
        }
        for t in (first..mesh.triangle_count()).filter(|&t| mesh.is_whole(t)).collect::<Vec<_>>() {
            for edge in 0..3u8 {
                if self.is_between(mesh, t, edge.into()) {
                    mesh.change(&Change { triangle: t, edge, fraction: None });
                }
            }
        }
    }

    /// Cuts triangles that a line does not simply run through, from one edge to another.
    fn straighten(&mut self, mesh: &mut TriangleMesh<'_>, first: u32) {
        for _ in 0..MOST_ROUNDS {
            let count = mesh.triangle_count();
            for t in (first..count).filter(|&t| mesh.is_whole(t)).collect::<Vec<_>>() {
                if mesh.is_whole(t) && !self.is_simple(mesh, t) {
                    let (edge, length) = mesh.longest_edge(t);
                    if length >= 2.0 * SHORTEST * self.edge {
                        mesh.cut(t, edge, 0.5);
                    }
                }
            }
            if mesh.triangle_count() == count {
                break;
            }
        }
    }

    /// Whether nothing, or one straight line, runs through a triangle.
    fn is_simple(&mut self, mesh: &TriangleMesh<'_>, t: u32) -> bool {
        let crossings = [0, 1, 2].map(|e| self.crossing(mesh, t, e));
        let crossed: Vec<(usize, f64)> =
            (0..3).filter_map(|e| crossings[e].map(|f| (e, f))).collect();
        match crossed[..] {
            [] => true,
            [(d, f), (e, g)] => {
                // Across the middle of the chord.
                let on = |e: usize, f: f64| {
                    let mut weights = [0.0; 3];
                    weights[e] = 1.0 - f;
                    weights[(e + 1) % 3] = f;
                    weights
                };
                let (p, q) = (on(d, f), on(e, g));
                let middle = [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
                let towards = |corner: [f64; 3], by: f64| {
                    mesh.at(t, [0, 1, 2].map(|i| middle[i] + by * (corner[i] - middle[i])))
                };
                // The corner between both edges is on one side, the others are on the other.
                let apex = if (d + 1) % 3 == e { e } else { d };
                let mut corner = [0.5; 3];
                corner[apex] = 0.0;
                let mut alone = [0.0; 3];
                alone[apex] = 1.0;
                self.meets(mesh, &towards(alone, STRAIGHT), &towards(corner, STRAIGHT)).is_some()
            }
            _ => false,
        }
    }

    /// Where an edge of a triangle first meets what stands on the sheet, as a part of its length, if not at its ends.
    fn crossing(&mut self, mesh: &TriangleMesh<'_>, t: u32, edge: usize) -> Option<f64> {
        let corners = mesh.corners(t);
        let mut ends = [corners[edge], corners[(edge + 1) % 3]];
        ends.sort_unstable();
        if ends[0] == ends[1] || mesh.is_seam(t, edge) || self.clear.contains(&ends) {
            return None;
        }
        // Along a border, where walls stand, a little inside.
        let inside = if mesh.next(t, edge).is_none() { END } else { 0.0 };
        let at = |f: f64| {
            let mut weights = [inside / 3.0; 3];
            weights[edge] += (1.0 - inside) * (1.0 - f);
            weights[(edge + 1) % 3] += (1.0 - inside) * f;
            mesh.at(t, weights)
        };
        let (from, to) = (at(END), at(1.0 - END));
        let met = self.meets(mesh, &from, &to).and_then(|(x, n)| {
            // On the edge itself, by the plane that touches there.
            let [a, b] = [0.0, 1.0].map(|f| {
                let mut weights = [0.0; 3];
                weights[edge] = 1.0 - f;
                weights[(edge + 1) % 3] = f;
                mesh.surface().at_chart(&mesh.at(t, weights)).x
            });
            let (before, behind) = ((x - a).dot(&n), (b - x).dot(&n));
            let f = before / (before + behind);
            // An edge along the line may seem to cross it anywhere.
            let off = ALONG * (b - a).norm();
            let crosses = before.abs() > off && behind.abs() > off;
            (crosses && f > END && f < 1.0 - END).then_some(f)
        });
        if met.is_none() {
            self.clear.insert(ends);
        }
        met
    }

    /// Whether something stands between the two triangles of an edge on a line: between their middles, as far along the
    /// edge as they lie apart.
    fn is_between(&self, mesh: &TriangleMesh<'_>, t: u32, edge: usize) -> bool {
        let Some(next) = mesh.next(t, edge) else { return false };
        let own = mesh.corners(t);
        let ends = [own[edge], own[(edge + 1) % 3]];
        let middle = |t: u32| mesh.at(t, [1.0 / 3.0; 3]);
        ends.iter().all(|&v| self.is_on_line(mesh, v))
            && self.meets(mesh, &middle(t), &middle(next)).is_some()
    }

    /// Where along an edge that begins or ends on a straight line along it the line ends, as a part of its length.
    fn end(&self, mesh: &TriangleMesh<'_>, t: u32, edge: usize) -> Option<f64> {
        let next = mesh.next(t, edge)?;
        let (own, other) = (mesh.corners(t), mesh.corners(next));
        let ends = [own[edge], own[(edge + 1) % 3]];
        if !ends.iter().any(|&v| self.is_on_line(mesh, v)) {
            return None;
        }
        let [a, b] = ends.map(|v| mesh.vertices()[v as usize].position);
        let is_along = |(x, n): (Point3, Vector3)| {
            let along = 10.0 * ALONG * (b - a).norm();
            (x - a).dot(&n).abs() < along && (x - b).dot(&n).abs() < along
        };
        // Straight across the edge.
        let is_met = |f: f64| {
            let beside = |t: u32, corners: [u32; 3]| {
                let weight = |v: &u32| match ends.iter().position(|e| e == v) {
                    Some(0) => (1.0 - STRAIGHT) * (1.0 - f),
                    Some(_) => (1.0 - STRAIGHT) * f,
                    None => STRAIGHT,
                };
                mesh.at(t, [0, 1, 2].map(|i| weight(&corners[i])))
            };
            self.meets(mesh, &beside(t, own), &beside(next, other)).is_some_and(is_along)
        };
        let (mut low, mut high) = (NEAR_END, 1.0 - NEAR_END);
        let at_begin = is_met(low);
        if is_met(high) == at_begin {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if is_met(middle) == at_begin {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }

    /// Whether a vertex may lie on a line.
    fn is_on_line(&self, mesh: &TriangleMesh<'_>, vertex: u32) -> bool {
        let position = mesh.vertices()[vertex as usize].position;
        self.on_line.contains(&vertex)
            || self.tracer.contacts(&position).iter().any(|a| a.shape != self.sheet.shape)
    }

    /// A point above the sheet.
    fn above(&self, mesh: &TriangleMesh<'_>, at: &ChartPoint) -> (Point3, Vector3) {
        let surface = mesh.surface();
        let point = surface.at_chart(at);
        let n = surface.local(&point).map_or(Vector3::zeros(), |l| *l.n);
        let n = if self.sheet.front { n } else { -n };
        (point.x + n * (HEIGHT * self.edge), n)
    }

    /// What is met first on the way from one point of the sheet to another, if it is steep: where, and its normal. If both
    /// are in one chart the way is along the sheet, otherwise straight.
    fn meets(
        &self,
        mesh: &TriangleMesh<'_>,
        from: &ChartPoint,
        to: &ChartPoint,
    ) -> Option<(Point3, Vector3)> {
        let between = |f: f64| {
            let at = [0, 1].map(|i| from.at[i] + f * (to.at[i] - from.at[i]));
            self.above(mesh, &ChartPoint { at, ..*from })
        };
        let ((start, n), (end, _)) = (self.above(mesh, from), self.above(mesh, to));
        let pieces = if from.chart == to.chart {
            // The height of the arc over its chord goes with the square of its length.
            let bend = (between(0.5).0 - (start + (end - start) * 0.5)).norm();
            let allowed = 0.25 * HEIGHT * self.edge;
            (bend / allowed).sqrt().ceil().clamp(1.0, MOST_PIECES)
        } else {
            1.0
        };
        let mut begin = (start, n);
        for i in 1..=pieces as usize {
            let next = if i == pieces as usize { (end, n) } else { between(i as f64 / pieces) };
            if let Some(met) = self.meets_straight(begin, next.0) {
                return Some(met);
            }
            begin = next;
        }
        None
    }

    /// The same on a straight way, past the sheet's own surface and what is not steep.
    fn meets_straight(
        &self,
        (from, normal): (Point3, Vector3),
        to: Point3,
    ) -> Option<(Point3, Vector3)> {
        let way = to - from;
        let mut passed = 0.0;
        for _ in 0..MOST_PASSED {
            let ray = Ray::new(from + way * passed, way);
            let hit = self.tracer.nearest(&ray, 1.0 - passed, &[])?;
            let local =
                self.tracer.scene().shape(hit.anchor.shape).surface.local(&hit.anchor.point);
            let n = local.map_or(Vector3::zeros(), |l| *l.n);
            let stands = n.dot(&normal).abs() < STEEP && n.dot(&way).abs() > 0.0;
            if hit.anchor.shape != self.sheet.shape && stands {
                return Some((hit.anchor.point.x, n));
            }
            passed += hit.t + 1e-6;
        }
        None
    }
}
