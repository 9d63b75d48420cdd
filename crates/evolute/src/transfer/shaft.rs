//! Pyramids from a receiver to a convex polygon, and proofs that a body stays out of them.

use arrayvec::ArrayVec;

use crate::geometry::{Aabb, Point3, Vector3};
use crate::scene::{Scene, ShapeId};
use crate::surface::Surface;
use crate::trace::{Anchor, Tracer};

/// Most corners of the base.
pub const MAX_CORNERS: usize = 8;

/// The convex hull of a receiver and a convex polygon, or of two quadrilaterals.
pub struct Shaft {
    points: ArrayVec<Vector3, { MAX_CORNERS + 1 }>,
    /// Normals of the faces, and the shaft's extent along each.
    faces: ArrayVec<Extent, { MAX_CORNERS + 1 }>,
    edges: ArrayVec<Vector3, { 2 * MAX_CORNERS }>,
    slack: f64,
}

/// An axis and what lies along it, from and to.
pub type Extent = (Vector3, f64, f64);

/// Divisions for a body that is the primitive itself.
const ITSELF: u32 = u32::MAX;
/// Divisions for a square about a disk, a rod about a tube.
const CLOSE: u32 = 5;
/// Divisions for a box along the axes.
const BOX: u32 = 2;

/// Something convex that may stand in a shaft.
pub enum Body {
    /// The hull of points: a flat polygon (with its normal) or a box.
    Hull(ArrayVec<Vector3, 8>),
    /// Centre and radius.
    Ball(Vector3, f64),
    /// Centres of the ends and radius of a solid cylinder.
    Rod([Vector3; 2], f64),
}

impl Body {
    /// The body of a primitive, and down to how many divisions of a first grid it is to be held against
    /// cells. One that is larger than the primitive may reach into a cell for ever.
    pub fn of(scene: &Scene, shape: ShapeId, primitive: u32) -> (Self, u32) {
        let hull = |points: &[Point3]| Self::Hull(points.iter().map(|p| p.coords).collect());
        match &scene.shape(shape).surface {
            Surface::Mesh(m) => {
                (hull(&m.hull(primitive)), if m.is_smooth() { BOX } else { ITSELF })
            }
            Surface::Rectangle(r) => (hull(&r.corners()), ITSELF),
            Surface::Sphere(s) => (Self::Ball(s.centre().coords, s.radius()), ITSELF),
            Surface::Disk(d) => {
                let (c, [p, q]) = (d.centre(), d.radii());
                (hull(&[c - p - q, c + p - q, c + p + q, c - p + q]), CLOSE)
            }
            Surface::Cylinder(c) => (Self::Rod(c.ends().map(|o| o.coords), c.radius()), CLOSE),
            Surface::Parametric(p) => (hull(&p.leaf_bounds(primitive as usize).corners()), BOX),
        }
    }
}

impl Shaft {
    /// From the apex to the polygon.
    pub fn new(apex: &Point3, corners: &[Point3]) -> Self {
        let a = apex.coords;
        let n = corners.len().min(MAX_CORNERS);
        let mut points = ArrayVec::new();
        let mut normals = ArrayVec::<_, { MAX_CORNERS + 1 }>::new();
        let mut edges = ArrayVec::new();
        points.push(a);
        for k in 0..n {
            let (p, q) = (corners[k].coords, corners[(k + 1) % n].coords);
            points.push(p);
            normals.push((p - a).cross(&(q - a)));
            edges.push(p - a);
            edges.push(q - p);
        }
        if n >= 3 {
            normals.push((corners[1] - corners[0]).cross(&(corners[2] - corners[0])));
        }
        Self::of(points, &normals, edges)
    }

    /// From one quadrilateral to another, corner by corner.
    pub fn between(starts: &[Point3], ends: &[Point3]) -> Self {
        let n = starts.len().min(ends.len()).min(MAX_CORNERS / 2);
        let (mut points, mut edges) = (ArrayVec::new(), ArrayVec::new());
        let mut normals = ArrayVec::<_, { MAX_CORNERS + 1 }>::new();
        for k in 0..n {
            let (p, q) = (starts[k], starts[(k + 1) % n]);
            let (x, y) = (ends[k], ends[(k + 1) % n]);
            points.extend([p.coords, x.coords]);
            // Of the two planes through a side that need not be flat.
            let side = if (q - p).norm_squared() > (y - x).norm_squared() { q - p } else { y - x };
            normals.push(side.cross(&(x - p)));
            edges.extend([x - p, q - p, y - x]);
        }
        if n >= 3 {
            for corners in [starts, ends] {
                normals.push((corners[1] - corners[0]).cross(&(corners[2] - corners[0])));
            }
        }
        Self::of(points, &normals, edges)
    }

    fn of(
        points: ArrayVec<Vector3, { MAX_CORNERS + 1 }>,
        normals: &[Vector3],
        edges: ArrayVec<Vector3, { 2 * MAX_CORNERS }>,
    ) -> Self {
        // Touching is no crossing: rounding moves a projection by a few ulps of the coordinates.
        let size = points.iter().fold(0f64, |m, p: &Vector3| m.max(p.norm()));
        let mut shaft = Self { points, faces: ArrayVec::new(), edges, slack: 1e-13 * size };
        // Corners that coincide span no face.
        let normals = normals.iter().filter(|n| n.norm_squared() > 0.0);
        shaft.faces = normals.map(|axis| shaft.slackened(*axis)).collect();
        shaft
    }

    /// The shaft, and all within a distance [m] of it.
    pub fn widened(mut self, by: f64) -> Self {
        for (axis, low, high) in &mut self.faces {
            let more = (self.slack + by) * axis.norm();
            (*low, *high) = (*low - more, *high + more);
        }
        self.slack = -by;
        self
    }

    /// Whether a face of the shaft keeps a box out: quicker than a proof by all axes, and weaker.
    pub fn keeps_out(&self, b: &Aabb) -> bool {
        separated(&self.faces, b)
    }

    /// The shaft's extents along all axes that may separate it from boxes along the axes of space, beyond
    /// its faces: to be asked of many boxes by [`separated`].
    pub fn box_axes(&self) -> Vec<Extent> {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let crosses = self.edges.iter().flat_map(|e| axes.iter().map(move |f| e.cross(f)));
        let crosses = crosses.filter(|axis| axis.norm_squared() > 0.0);
        axes.iter().copied().chain(crosses).map(|axis| self.slackened(axis)).collect()
    }

    /// The extent along an axis, less the slack: touching is no crossing.
    fn slackened(&self, axis: Vector3) -> Extent {
        let (low, high) = self.extent(&axis);
        let slack = self.slack * axis.norm();
        (axis, low + slack, high - slack)
    }

    /// Whether the body and the inside of the shaft certainly have no point in common.
    pub fn excludes(&self, body: &Body) -> bool {
        match body {
            Body::Hull(points) => {
                let own_edges: ArrayVec<Vector3, 3> = match points.len() {
                    // Triangle and parallelogram.
                    3 => [points[1] - points[0], points[2] - points[1], points[0] - points[2]]
                        .into_iter()
                        .collect(),
                    4 => [points[1] - points[0], points[2] - points[1]].into_iter().collect(),
                    // A box along the axes of space, whose own edges are nothing where it is flat.
                    _ => [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().collect(),
                };
                // (All is as far along no axis at all: that would keep everything out.)
                let separates = |axis: &Vector3| {
                    let (_, low, high) = self.slackened(*axis);
                    let (from, to) = extent(points, axis);
                    axis.norm_squared() > 0.0 && (from >= high || to <= low)
                };
                self.faces.iter().any(|(axis, low, high)| {
                    let (from, to) = extent(points, axis);
                    from >= *high || to <= *low
                }) || (points.len() == 8 && own_edges.iter().any(separates))
                    || (points.len() < 8 && separates(&own_edges[0].cross(&own_edges[1])))
                    || self.edges.iter().any(|e| own_edges.iter().any(|f| separates(&e.cross(f))))
            }
            Body::Rod(ends, radius) => self.excludes_rod(ends, *radius),
            Body::Ball(centre, radius) => {
                let separates = |axis: &Vector3| {
                    let length = axis.norm();
                    let (_, low, high) = self.slackened(*axis);
                    let at = centre.dot(axis);
                    length > 0.0 && (at - radius * length >= high || at + radius * length <= low)
                };
                // Faces, edges (the plane through an edge that faces the centre) and corners.
                self.faces.iter().any(|(axis, ..)| separates(axis))
                    || self.points.iter().any(|p| separates(&(centre - p)))
                    || self.points.iter().enumerate().any(|(k, p)| {
                        self.points[..k].iter().any(|q| {
                            let e = q - p;
                            let to = centre - p;
                            separates(&(to - e * (to.dot(&e) / e.norm_squared())))
                        })
                    })
            }
        }
    }

    fn excludes_rod(&self, ends: &[Vector3; 2], radius: f64) -> bool {
        let along = (ends[1] - ends[0]).normalize();
        let separates = |axis: &Vector3| {
            let across = radius * (axis - along * axis.dot(&along)).norm();
            let (_, low, high) = self.slackened(*axis);
            let (from, to) = extent(ends, axis);
            axis.norm_squared() > 0.0 && (from - across >= high || to + across <= low)
        };
        let towards = |p: &Vector3| {
            let to = p - ends[0];
            to - along * to.dot(&along).clamp(0.0, (ends[1] - ends[0]).norm())
        };
        self.faces.iter().any(|(axis, ..)| separates(axis))
            || separates(&along)
            || self.edges.iter().any(|e| separates(&e.cross(&along)))
            || self.points.iter().any(|p| separates(&towards(p)))
    }

    fn extent(&self, axis: &Vector3) -> (f64, f64) {
        extent(&self.points, axis)
    }
}

/// Whether a box lies outside one of some extents.
pub fn separated(extents: &[Extent], b: &Aabb) -> bool {
    let (centre, half) = (b.centre().coords, b.max - b.centre());
    extents.iter().any(|(axis, low, high)| {
        let (at, reach) = (centre.dot(axis), half.dot(&axis.abs()));
        at - reach >= *high || at + reach <= *low
    })
}

fn extent(points: &[Vector3], axis: &Vector3) -> (f64, f64) {
    points.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| {
        let at = p.dot(axis);
        (low.min(at), high.max(at))
    })
}

/// Whether a shape, seen from a receiver on the `contacts`, is the lamp itself and no mesh, whose triangles may hide each
/// other (how a curved lamp hides itself samples tell), or lies in the receiver's plane.
pub fn is_end(scene: &Scene, shape: ShapeId, lamp: ShapeId, contacts: &[Anchor]) -> bool {
    match scene.shape(shape).surface {
        Surface::Mesh(_) => false,
        Surface::Rectangle(_) | Surface::Disk(_) => {
            shape == lamp || contacts.iter().any(|c| c.shape == shape)
        }
        _ => shape == lamp,
    }
}

/// What may stand between a receiver and a polygon: every primitive whose box reaches the box
/// around both, but for the lamp's own plane, planes that the receiver lies on, and what a proof
/// keeps out of the shaft. `None` if there are more than `limit`.
pub fn suspects(
    scene: &Scene,
    tracer: &Tracer<'_>,
    receiver: &Point3,
    lamp: ShapeId,
    corners: &[Point3],
    limit: usize,
) -> Option<Vec<(ShapeId, u32)>> {
    let bounds = Aabb::around(corners.iter().copied().chain([*receiver]));
    let mut found = Vec::new();
    if !tracer.occluders_in(&bounds, &mut found, limit) {
        return None;
    }
    let contacts = tracer.contacts(receiver);
    let shaft = Shaft::new(receiver, corners);
    found.retain(|&(shape, primitive)| {
        !is_end(scene, shape, lamp, &contacts)
            && !shaft.excludes(&Body::of(scene, shape, primitive).0)
    });
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(points: &[[f64; 3]]) -> Body {
        Body::Hull(points.iter().map(|p| Vector3::from(*p)).collect())
    }

    #[test]
    fn separates_what_stays_out() {
        let base = [[-1.0, 2.0, -1.0], [1.0, 2.0, -1.0], [1.0, 2.0, 1.0], [-1.0, 2.0, 1.0]]
            .map(Point3::from);
        let shaft = Shaft::new(&Point3::origin(), &base);
        // A triangle beside an edge that only an edge-edge axis separates, and one that cuts in.
        assert!(shaft.excludes(&body(&[[1.1, 1.0, 0.0], [0.6, 1.0, 3.0], [1.1, 2.0, 3.0]])));
        assert!(!shaft.excludes(&body(&[[0.3, 1.0, 0.0], [2.0, 1.0, 0.5], [2.0, 1.0, -0.5]])));
        // Boxes of no thickness, across the shaft and beside it.
        let flat = |low: [f64; 3], high: [f64; 3]| {
            let b = Aabb { min: Point3::from(low), max: Point3::from(high) };
            Body::Hull(b.corners().iter().map(|p| p.coords).collect())
        };
        assert!(!shaft.excludes(&flat([-3.0, 1.0, -3.0], [3.0, 1.0, 3.0])));
        assert!(!shaft.excludes(&flat([0.2, 0.5, -3.0], [0.2, 3.0, 3.0])));
        assert!(shaft.excludes(&flat([0.6, 1.0, -3.0], [3.0, 1.0, 3.0])));
        // Coplanar with the base, or behind it.
        assert!(shaft.excludes(&body(&[[-3.0, 2.0, -3.0], [3.0, 2.0, -3.0], [0.0, 2.0, 3.0]])));
        for (c, r, out) in [
            ([1.0, 1.0, 0.0], 0.44, true),
            ([1.0, 1.0, 0.0], 0.46, false),
            ([0.0, -0.5, 0.0], 0.4, true),
            ([1.5, 2.5, 1.5], 0.8, true),
            ([1.5, 2.5, 1.5], 0.9, false),
        ] {
            assert_eq!(shaft.excludes(&Body::Ball(Vector3::from(c), r)), out, "{c:?} {r}");
        }
        // Along a side of the base's plane, across an edge, with an end in the shaft.
        for (p, q, r, out) in [
            ([1.0, 1.0, -3.0], [1.0, 1.0, 3.0], 0.44, true),
            ([1.0, 1.0, -3.0], [1.0, 1.0, 3.0], 0.46, false),
            ([-3.0, 2.5, 0.0], [3.0, 2.5, 0.0], 0.49, true),
            ([-3.0, 2.5, 0.0], [3.0, 2.5, 0.0], 0.51, false),
            ([2.0, 1.0, 0.0], [0.6, 1.0, 0.0], 0.05, true),
            ([2.0, 1.0, 0.0], [0.4, 1.0, 0.0], 0.05, false),
        ] {
            let rod = Body::Rod([p, q].map(Vector3::from), r);
            assert_eq!(shaft.excludes(&rod), out, "{p:?} {q:?} {r}");
        }
    }
}
