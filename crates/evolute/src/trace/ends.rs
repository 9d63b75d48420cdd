//! The ends of a ray on surfaces: which roots are its own start or end, and what happens where that is
//! on the border of two triangles.

use arrayvec::ArrayVec;

use super::triangle::{Triangle, TriangleCrossing, border, enters_neighbour, in_plane, weights_on};
use super::{Anchor, Found};
use crate::geometry::{Point3, Ray, Vector3};
use crate::surface::{Mesh, PatchRoot, SurfacePoint, contact_tolerance};

/// A start or end on the border of triangles of a mesh: what decides whether a neighbour is met there.
pub struct BorderPoint {
    shape: u32,
    primitive: u32,
    /// The corners of the edge or vertex.
    corners: ArrayVec<Point3, 2>,
    x: Point3,
    /// From the point into its own triangle.
    inward: Vector3,
    /// The ray's direction away from the point.
    direction: Vector3,
    /// Ray parameter there.
    t: f64,
}

/// What a ray knows of its ends.
pub struct Ends<'a> {
    /// The surfaces on which the ray starts.
    pub start: &'a [Anchor],
    /// Shadow rays only: the end, and the point at t_max.
    pub end: Option<&'a Anchor>,
    pub end_point: Option<Point3>,
    /// Those of them that are on borders of triangles.
    pub borders: &'a [BorderPoint],
}

impl BorderPoint {
    /// The start (or end) of a ray, at ray parameter `t`, if it is on the border of a triangle of its mesh;
    /// `direction` is the ray's, away from the point.
    #[cold]
    pub fn of(mesh: &Mesh, anchor: &Anchor, direction: Vector3, t: f64) -> Option<Self> {
        let SurfacePoint { primitive, p, q, x } = anchor.point;
        let triangle = mesh.corners(primitive);
        let on = border(&triangle, p, q);
        if on.is_empty() {
            return None;
        }
        let [xp, xq] = mesh.tangents(&anchor.point);
        let inward = xp * (1.0 / 3.0 - p) + xq * (1.0 / 3.0 - q);
        let corners = on.iter().map(|&i| triangle[i]).collect();
        Some(Self { shape: anchor.shape.0, primitive, corners, x, inward, direction, t })
    }
}

impl Ends<'_> {
    /// Whether a root at `t` is the end of a shadow ray as far as rounding can tell: `on` decides for
    /// the end's point, and is asked only where it can matter.
    pub fn near_end(&self, t: f64, t_max: f64, on: impl Fn(&Point3) -> bool) -> bool {
        // The fraction is generous: it only decides whether the exact question is asked.
        self.end_point.as_ref().is_some_and(|x| t >= t_max * (1.0 - 1e-6) && on(x))
    }
}

/// The crossing of a ray's line with a triangle, if it is at 0 < t ≤ `t_max`.
#[inline(always)]
pub fn meet_triangle(
    triangle: &Triangle,
    c: &TriangleCrossing,
    ray: &Ray,
    t_max: f64,
    ends: &Ends,
) -> Option<Found> {
    if !(c.t > 0.0 && c.t <= t_max) {
        return None;
    }
    let own = |a: &Anchor| a.shape.0 == triangle.shape && a.point.primitive == triangle.primitive;
    if ends.start.iter().any(own)
        || ends.end.is_some_and(own)
        || c.is_start(&triangle.corners, &ray.origin)
        || ends.near_end(c.t, t_max, |x| in_plane(&triangle.corners, x))
    {
        return None;
    }
    let [corner, second, third] = &triangle.corners;
    let x = corner + (second - corner) * c.p + (third - corner) * c.q;
    Some((c.t, SurfacePoint { primitive: triangle.primitive, p: c.p, q: c.q, x }))
}

/// The nearest root of a ray and a patch of a smooth mesh at 0 < t ≤ `t_max`.
pub fn meet_patch(
    mesh: &Mesh,
    shape: u32,
    primitive: u32,
    ray: &Ray,
    t_max: f64,
    ends: &Ends,
) -> Option<Found> {
    let own = |a: &&Anchor| a.shape.0 == shape && a.point.primitive == primitive;
    // Weights at which the ray starts or ends on this patch, and the ray parameters there.
    let mut known: ArrayVec<(f64, [f64; 2]), 4> = ArrayVec::new();
    let ends_here = ends.start.iter().map(|a| (0.0, a)).chain(ends.end.map(|a| (t_max, a)));
    let ends_here = ends_here.filter(|(_, a)| own(a));
    known.extend(ends_here.take(2).map(|(t, a)| (t, [a.point.p, a.point.q])));
    for b in ends.borders.iter().filter(|b| b.shape == shape && b.primitive != primitive) {
        let corners = mesh.corners(primitive);
        let shared = shared_corners(&corners, b);
        if shared.is_empty() {
            continue;
        }
        let weights = weights_on(&corners, &shared, &b.x);
        let (p, q) = (weights[1], weights[2]);
        // The patch's tangent plane, as a triangle, stands for it.
        let at = SurfacePoint { primitive, p, q, x: b.x };
        let [xp, xq] = mesh.tangents(&at);
        let flat =
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|(u, v)| b.x + xp * (u - p) + xq * (v - q));
        if enters_neighbour(&flat, &shared, &b.inward, &b.direction) && b.t <= t_max {
            return Some((b.t, at));
        }
        let _ = known.try_push((b.t, [p, q]));
    }
    let speed = ray.direction.norm();
    let mut best: Option<Found> = None;
    for root in mesh.patch_roots(primitive, ray, known.first().copied()) {
        let PatchRoot { t, p, q } = root;
        // A patch knows its start by its weights; a chord of 1e-9 of a triangle is none.
        let same = |(_, k): &(f64, [f64; 2])| (k[0] - p).abs() + (k[1] - q).abs() < 1e-9;
        if !(t > 0.0 && t <= t_max)
            || best.is_some_and(|b| t >= b.0)
            || known.iter().any(same)
            || t * speed <= contact_tolerance(&ray.origin, &mesh.bounds())
        {
            continue;
        }
        let point = mesh.at(primitive, p, q);
        let on = |x: &Point3| (point.x - x).norm() <= contact_tolerance(x, &mesh.bounds());
        if !ends.near_end(t, t_max, on) {
            best = Some((t, point));
        }
    }
    best
}

/// The corners of a triangle that are a start's (or end's) edge or vertex, as indices; none unless all
/// are there.
fn shared_corners(corners: &[Point3; 3], b: &BorderPoint) -> ArrayVec<usize, 3> {
    let shared: ArrayVec<usize, 3> = (0..3).filter(|&i| b.corners.contains(&corners[i])).collect();
    if shared.len() == b.corners.len() { shared } else { ArrayVec::new() }
}

pub enum AtBorder {
    /// The triangle does not have the border in question.
    Elsewhere,
    /// It has, and the ray leaves it at once.
    Passed,
    /// It has, and the ray runs into it at once.
    Met(Found),
}

/// What happens at a start (or end) on a border to triangles that share it.
pub fn meet_at_border(triangle: &Triangle, ends: &Ends) -> AtBorder {
    let mut result = AtBorder::Elsewhere;
    for b in ends.borders.iter().filter(|b| b.shape == triangle.shape) {
        if b.primitive == triangle.primitive {
            return AtBorder::Passed;
        }
        let shared = shared_corners(&triangle.corners, b);
        if shared.is_empty() {
            continue;
        }
        result = AtBorder::Passed;
        if enters_neighbour(&triangle.corners, &shared, &b.inward, &b.direction) {
            let weights = weights_on(&triangle.corners, &shared, &b.x);
            let (p, q) = (weights[1], weights[2]);
            let primitive = triangle.primitive;
            return AtBorder::Met((b.t, SurfacePoint { primitive, p, q, x: b.x }));
        }
    }
    result
}
