//! Where a family of rays meets a surface continued past its border.
//!
//! Chains are followed on extended surfaces, so that the border of a mirror is an edge function that
//! changes sign inside a cell, not a place where the chain breaks off. Planes, cylinders and formula
//! patches have an extension; spheres need none but have a limb; meshes have none.

use arrayvec::ArrayVec;

use crate::geometry::{Point3, Ray, Transform, Vector3};
use crate::optics::{Dual, DualRay, DualVector};
use crate::surface::{Cylinder, Mesh, Surface, SurfacePoint};
use crate::trace::Hit;

/// A family of rays on a surface.
pub struct Meeting {
    /// Points [m].
    pub x: DualVector,
    /// Unit normals on the shape's front.
    pub n: DualVector,
    /// The central ray's point as the surface knows it (beyond the border, too).
    pub point: SurfacePoint,
    /// Positive inside the border, negative outside; always the same number for a surface.
    pub apertures: ArrayVec<Dual, 3>,
}

/// A few roundings of a coordinate, as its share.
const CONTACT: f64 = 1e-14;

/// Whether a mesh is so coarse and flat that each triangle is a mirror of its own.
pub fn is_faceted(mesh: &Mesh) -> bool {
    // A cube has 12; beyond a few dozen, words by triangle outnumber the cells of one domain.
    mesh.normals().is_none() && mesh.triangles().len() <= 64
}

/// The number of the facet that a primitive belongs to, if the surface is a faceted mesh.
pub fn facet(surface: &Surface, primitive: u32) -> Option<u32> {
    match surface {
        Surface::Mesh(m) if is_faceted(m) => Some(facet_of(m, primitive).id),
        _ => None,
    }
}

/// A flat piece of a faceted mesh: a triangle, or two that make a parallelogram.
#[derive(Clone, Copy, Debug)]
pub struct Facet {
    /// Its triangle, or the first of its two.
    pub id: u32,
    /// One corner [m].
    pub origin: Point3,
    /// Edges from there [m].
    pub edges: [Vector3; 2],
    /// Whether it is a parallelogram.
    pub quad: bool,
}

impl Facet {
    /// The point as the mesh knows it: on the triangle that it lies on, or whose plane it lies in.
    pub fn point(&self, mesh: &Mesh, x: Point3) -> SurfacePoint {
        let (p, q) = barycentric(&self.edges[0], &self.edges[1], &(x - self.origin));
        // The origin is the corner that the second triangle does not have.
        let primitive = if self.quad && p + q > 1.0 { self.id + 1 } else { self.id };
        let [v0, v1, v2] = mesh.corners(primitive);
        let (p, q) = barycentric(&(v1 - v0), &(v2 - v0), &(x - v0));
        SurfacePoint { primitive, p, q, x }
    }
}

/// The facet that a triangle of a faceted mesh belongs to. Files and shapes write the two triangles
/// of a quadrilateral one after the other, so that only the partner by number is looked at.
pub fn facet_of(mesh: &Mesh, triangle: u32) -> Facet {
    let own = mesh.corners(triangle);
    let alone = Facet {
        id: triangle,
        origin: own[0],
        edges: [own[1] - own[0], own[2] - own[0]],
        quad: false,
    };
    let partner = triangle ^ 1;
    if partner as usize >= mesh.triangles().len() {
        return alone;
    }
    let id = triangle.min(partner);
    let (first, second) = (mesh.corners(id), mesh.corners(id + 1));
    let apex = |own: &[Point3; 3], other: &[Point3; 3]| {
        let mut free = own.iter().copied().filter(|p| !other.contains(p));
        free.next().filter(|_| free.next().is_none())
    };
    let (Some(p), Some(q)) = (apex(&first, &second), apex(&second, &first)) else { return alone };
    let mut shared = first.iter().copied().filter(|c| *c != p);
    let (Some(u), Some(v)) = (shared.next(), shared.next()) else { return alone };
    let (e1, e2) = (u - p, v - p);
    // Corners of one quadrilateral differ by rounding alone.
    let gap = (q - p) - (e1 + e2);
    if gap.norm() > 1e-12 * (e1.norm() + e2.norm() + p.coords.norm()) {
        return alone;
    }
    Facet { id, origin: p, edges: [e1, e2], quad: true }
}

/// Where the family meets `surface` coming from its front or back.
///
/// `real` is the tracer's nearest hit if it is on this surface (and primitive) and side; `leaving` is the
/// central ray's origin if the rays leave this very surface; `hint` is a point that a neighbouring ray of
/// the family hit. `None` where the extension has no such point.
pub fn meet(
    surface: &Surface,
    primitive: Option<u32>,
    front: bool,
    ray: &DualRay,
    real: Option<&Hit>,
    leaving: Option<&SurfacePoint>,
    hint: &SurfacePoint,
) -> Option<Meeting> {
    let same = leaving.is_some();
    let origin = Point3::from(ray.o.v);
    let central = Ray::new(origin, ray.d.v);
    if let Some(hit) = real {
        let local = surface.local(&hit.anchor.point)?;
        let x = ray.met(hit.t, &hit.anchor.point.x, &local.ng)?;
        let n = DualVector::new(local.n.into_inner(), local.dn_dx * x.a, local.dn_dx * x.b);
        let mut apertures = apertures(surface, primitive, &hit.anchor.point, &x)?;
        apertures.extend(rim(surface, front, ray, same));
        return Some(Meeting { x, n, point: hit.anchor.point, apertures });
    }
    let (t, point) = match surface {
        Surface::Rectangle(r) => {
            on_plane(&central, &r.centre(), &r.normal(), r.world_from_object())?
        }
        Surface::Disk(d) => on_plane(&central, &d.centre(), &d.normal(), d.world_from_object())?,
        Surface::Sphere(s) => {
            let t = if same {
                s.other_root(&origin, &central.direction)
            } else {
                let roots = s.roots(&central)?;
                if front == s.faces_outward() { roots[0] } else { roots[1] }
            };
            (t, s.projected(&central.at(t))?)
        }
        Surface::Cylinder(c) => {
            let t = if same {
                c.other_root(&origin, &central.direction)?
            } else {
                let roots = c.roots(&central)?;
                if front == c.faces_outward() { roots[0] } else { roots[1] }
            };
            (t, c.projected(&central.at(t))?)
        }
        Surface::Parametric(p) => {
            let known = leaving.map(|from| (from.p, from.q));
            let (t, s, q) = p.extended_hit(&central, (hint.p, hint.q), known)?;
            (t, SurfacePoint { primitive: 0, p: s, q, x: p.position(s, q) })
        }
        Surface::Mesh(m) => {
            let facet = facet_of(m, primitive?);
            let [e1, e2] = facet.edges;
            let normal = e1.cross(&e2);
            let along = central.direction.dot(&normal);
            let t = (facet.origin - origin).dot(&normal) / along;
            (t, facet.point(m, central.at(t)))
        }
    };
    // Where two surfaces touch, the leg between them has no length, but for rounding. A surface touches
    // itself wherever a ray leaves it.
    let least = if same { f64::MIN_POSITIVE } else { -CONTACT * origin.coords.amax() };
    if !(t >= least && t.is_finite()) {
        return None;
    }
    let t = t.max(0.0);
    let local = surface.local(&point)?;
    let x = ray.met(t, &point.x, &local.ng)?;
    let n = DualVector::new(local.n.into_inner(), local.dn_dx * x.a, local.dn_dx * x.b);
    let mut apertures = apertures(surface, primitive, &point, &x)?;
    apertures.extend(rim(surface, front, ray, same));
    Some(Meeting { x, n, point, apertures })
}

/// The border that a cylinder's own wall is on the way to its inside.
fn rim(surface: &Surface, front: bool, ray: &DualRay, same: bool) -> Option<Dual> {
    match surface {
        Surface::Cylinder(c) if !same && front != c.faces_outward() => Some(over_the_rim(c, ray)),
        _ => None,
    }
}

/// Positive where a family of rays that comes from outside passes a cylinder's near wall beyond one of
/// its ends: h (h − 1) of the height h at which it crosses the infinite wall.
pub fn over_the_rim(cylinder: &Cylinder, ray: &DualRay) -> Dual {
    let central = Ray::new(Point3::from(ray.o.v), ray.d.v);
    let crossing = || {
        let t = cylinder.roots(&central)?[0];
        height(cylinder, ray, t).filter(|_| t > 0.0)
    };
    // Rays that start inside the infinite cylinder pass no wall.
    crossing().map_or(Dual::constant(1.0), |h| h * (h + -1.0))
}

/// Positive where a family of rays that leaves a cylinder's inside passes its far wall beyond one of its
/// ends, or ends before, at distance `end` [m]: as [`over_the_rim`].
pub fn over_the_far_rim(cylinder: &Cylinder, ray: &DualRay, end: f64) -> Dual {
    let origin = Point3::from(ray.o.v);
    let crossing = || {
        let t = cylinder.other_root(&origin, &ray.d.v).filter(|t| *t > 0.0 && *t < end)?;
        height(cylinder, ray, t)
    };
    crossing().map_or(Dual::constant(1.0), |h| h * (h + -1.0))
}

/// The height at which a family of rays meets the infinite cylinder, in its length from the first end.
fn height(cylinder: &Cylinder, ray: &DualRay, t: f64) -> Option<Dual> {
    let point = cylinder.projected(&(Point3::from(ray.o.v) + ray.d.v * t))?;
    let n = cylinder.local(&point)?.ng;
    let x = ray.met(t, &point.x, &n)?;
    let axis = cylinder.axis().into_inner() / cylinder.length();
    Some(Dual::new(point.q, x.a.dot(&axis), x.b.dot(&axis)))
}

fn on_plane(
    ray: &Ray,
    centre: &Point3,
    normal: &Vector3,
    world_from_object: &Transform,
) -> Option<(f64, SurfacePoint)> {
    let t = (centre - ray.origin).dot(normal) / ray.direction.dot(normal);
    let x = ray.at(t);
    let local = world_from_object.inverse().point(&x);
    t.is_finite().then_some((t, SurfacePoint { primitive: 0, p: local.x, q: local.y, x }))
}

/// Weights of the second and third vertex of a point of the plane, from the edges.
fn barycentric(e1: &Vector3, e2: &Vector3, x: &Vector3) -> (f64, f64) {
    let full = e1.cross(e2);
    let inverse = 1.0 / full.norm_squared();
    (x.cross(e2).dot(&full) * inverse, e1.cross(x).dot(&full) * inverse)
}

/// The border functions of a surface at a point and how they move along the family.
fn apertures(
    surface: &Surface,
    primitive: Option<u32>,
    point: &SurfacePoint,
    x: &DualVector,
) -> Option<ArrayVec<Dual, 3>> {
    let mut list = ArrayVec::new();
    let object = |t: &Transform| {
        let inverse = t.inverse();
        let (a, b) = (inverse.vector(&x.a), inverse.vector(&x.b));
        (Dual::new(point.p, a.x, b.x), Dual::new(point.q, a.y, b.y))
    };
    match surface {
        Surface::Rectangle(r) => {
            let (p, q) = object(r.world_from_object());
            list.push(p.squared() * -1.0 + 1.0);
            list.push(q.squared() * -1.0 + 1.0);
        }
        Surface::Disk(d) => {
            let (p, q) = object(d.world_from_object());
            list.push((p.squared() + q.squared()) * -1.0 + 1.0);
        }
        Surface::Sphere(_) => {}
        Surface::Cylinder(c) => {
            let axis = c.axis().into_inner() / c.length();
            let h = Dual::new(point.q, x.a.dot(&axis), x.b.dot(&axis));
            list.push(h * (h * -1.0 + 1.0));
        }
        Surface::Parametric(surface) => {
            let jet = surface.jet(point.p, point.q);
            let (a, b) = (jet.parameters_along(&x.a)?, jet.parameters_along(&x.b)?);
            for (value, k) in [(point.p, 0), (point.q, 1)] {
                let s = Dual::new(value, a[k], b[k]);
                list.push(s * (s * -1.0 + 1.0));
            }
        }
        Surface::Mesh(m) => {
            if let Some(triangle) = primitive {
                let facet = facet_of(m, triangle);
                let [e1, e2] = facet.edges;
                let (p, q) = barycentric(&e1, &e2, &(x.v - facet.origin.coords));
                let (pa, qa) = barycentric(&e1, &e2, &x.a);
                let (pb, qb) = barycentric(&e1, &e2, &x.b);
                let (p, q) = (Dual::new(p, pa, pb), Dual::new(q, qa, qb));
                if facet.quad {
                    list.push(p * (p * -1.0 + 1.0));
                    list.push(q * (q * -1.0 + 1.0));
                } else {
                    list.push(p);
                    list.push(q);
                    list.push((p + q) * -1.0 + 1.0);
                }
            }
        }
    }
    Some(list)
}
