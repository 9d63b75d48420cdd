//! Domains of first rays: maps from (a, b) in the unit square to the rays from a receiver that meet
//! one surface first, with their measure and its derivatives.
//!
//! Two kinds: the surface's own parameters (Yu & Wu (11)), good where the receiver is far off
//! compared with the cells; and the cone of directions from the receiver, in coordinates that are
//! smooth in the angle of incidence up to the limb (a sphere: sin i = sin(πa/2) and the azimuth; a
//! cylinder: sin ψ = (R/ρ) sin i).

use super::extension::{Facet, facet_of, is_faceted, over_the_rim};
use super::landing::Square;
use crate::geometry::{Point3, Vector3, math, tangent_frame};
use crate::optics::{Dual, DualRay, DualVector};
use crate::surface::{Cylinder, Mesh, Parametric, Sphere, Surface, SurfacePoint};

use std::f64::consts::PI;

/// The largest angle of incidence [rad]. A ray on the limb itself touches the surface, and what becomes
/// of it is rounding: where it meets the surface again, whether it is totally reflected inside. The
/// ring that is left out is 1e-10 of a disc.
const LIMB: f64 = 0.5 * PI - 1e-5;

/// A domain of first rays from one receiver to one surface (or one triangle of a mesh).
#[derive(Clone, Debug)]
pub struct Domain<'s> {
    receiver: Point3,
    kind: Kind<'s>,
}

#[derive(Clone, Debug)]
enum Kind<'s> {
    /// Centre and half edges; a, b ∈ [0, 1] over [−1, 1]².
    Parallelogram { centre: Vector3, edges: [Vector3; 2], normal: Vector3 },
    /// A facet of a mesh that is a parallelogram.
    Facet { mesh: &'s Mesh, facet: Facet, normal: Vector3 },
    /// Centre and two radii; a is the radius, b the azimuth.
    Ellipse { centre: Vector3, radii: [Vector3; 2], normal: Vector3 },
    /// A triangle of a mesh, collapsed towards its second vertex.
    Triangle { mesh: &'s Mesh, triangle: u32 },
    /// The surface's own parameters.
    Parameters { surface: &'s Parametric },
    /// Receiver outside a sphere: angle of incidence and azimuth.
    SphereFromOutside { sphere: &'s Sphere, frame: [Vector3; 3], distance: f64 },
    /// Receiver inside, or on the sphere (chords alone): polar angle of the direction from the
    /// receiver's radius, and azimuth.
    SphereFromInside { sphere: &'s Sphere, frame: [Vector3; 3], distance: f64, chords: bool },
    /// Receiver beside a cylinder: angle of incidence across, height along; its near or far wall.
    CylinderFromOutside { cylinder: &'s Cylinder, frame: [Vector3; 2], ratio: f64, far: bool },
    /// Receiver within the infinite cylinder: azimuth and height.
    CylinderFromInside { cylinder: &'s Cylinder, frame: [Vector3; 2] },
}

/// Where the first ray meets the surface.
#[derive(Clone, Copy, Debug)]
pub struct FirstPoint {
    /// The point [m].
    pub x: DualVector,
    /// The unit normal on the shape's front.
    pub n: DualVector,
    /// The unit direction from the receiver.
    pub d: DualVector,
    /// Distance from the receiver [m].
    pub distance: f64,
    /// Solid angle at the receiver per unit of (a, b) [sr], positive; the cosine at the receiver is
    /// not in it.
    pub solid_angle: Dual,
    /// The point as the surface knows it.
    pub point: SurfacePoint,
}

impl<'s> Domain<'s> {
    /// The domains that together cover every ray from `receiver` to `surface` once.
    ///
    /// `on_surface` says that the receiver lies on the surface.
    pub fn of(surface: &'s Surface, receiver: &Point3, on_surface: bool) -> Vec<Self> {
        let receiver = *receiver;
        let with = |kind| Self { receiver, kind };
        match surface {
            // No ray from a point of a plane meets the plane elsewhere.
            Surface::Rectangle(_) | Surface::Disk(_) if on_surface => Vec::new(),
            Surface::Rectangle(r) => vec![with(Kind::Parallelogram {
                centre: r.centre().coords,
                edges: r.half_edges(),
                normal: r.normal().into_inner(),
            })],
            Surface::Disk(d) => {
                vec![with(Kind::Ellipse {
                    centre: d.centre().coords,
                    radii: d.radii(),
                    normal: d.normal().into_inner(),
                })]
            }
            Surface::Sphere(s) => {
                let radial = receiver - s.centre();
                let distance = radial.norm();
                let axis = if distance > 0.0 { radial / distance } else { Vector3::z() };
                let (e1, e2) = tangent_frame(&nalgebra::Unit::new_unchecked(axis));
                if distance > s.radius() && !on_surface {
                    vec![with(Kind::SphereFromOutside {
                        sphere: s,
                        frame: [e1, e2, -axis],
                        distance,
                    })]
                } else {
                    vec![with(Kind::SphereFromInside {
                        sphere: s,
                        frame: [e1, e2, axis],
                        distance,
                        chords: on_surface,
                    })]
                }
            }
            Surface::Cylinder(c) => {
                let offset = receiver - c.ends()[0];
                let axis = c.axis();
                let across = offset - axis.into_inner() * offset.dot(&axis);
                let rho = across.norm();
                let e1 =
                    if rho > 1e-12 * c.radius() { across / rho } else { tangent_frame(&axis).0 };
                let frame = [e1, axis.cross(&e1)];
                if rho > c.radius() && !on_surface {
                    let ratio = c.radius() / rho;
                    [false, true]
                        .map(|far| {
                            with(Kind::CylinderFromOutside { cylinder: c, frame, ratio, far })
                        })
                        .to_vec()
                } else {
                    vec![with(Kind::CylinderFromInside { cylinder: c, frame })]
                }
            }
            Surface::Parametric(p) => vec![with(Kind::Parameters { surface: p })],
            Surface::Mesh(m) => (0..m.triangles().len() as u32)
                .filter(|&t| m.area_vector(t).dot(&(receiver - m.corners(t)[0])).abs() > 0.0)
                .filter_map(|triangle| {
                    let facet = facet_of(m, triangle);
                    if !(is_faceted(m) && facet.quad) {
                        return Some(with(Kind::Triangle { mesh: m, triangle }));
                    }
                    let normal = m.area_vector(triangle).try_normalize(0.0)?;
                    (facet.id == triangle).then(|| with(Kind::Facet { mesh: m, facet, normal }))
                })
                .collect(),
        }
    }

    /// Triangle of a mesh, else 0.
    pub fn primitive(&self) -> u32 {
        match self.kind {
            Kind::Triangle { triangle, .. } => triangle,
            Kind::Facet { facet, .. } => facet.id,
            _ => 0,
        }
    }

    /// Whether the surface turns the same side to the receiver everywhere in the domain.
    pub fn one_sided(&self) -> bool {
        !matches!(self.kind, Kind::Parameters { .. })
    }

    /// Half the opening [rad] of a cone that certainly holds all normals of a cell, where the domain is
    /// known only by evaluating it; zero where its coordinates leave no doubt.
    pub fn normal_cone(&self, cell: Square) -> f64 {
        match &self.kind {
            Kind::Parameters { surface } => {
                surface.normal_cone(cell.level, [cell.i, cell.j].map(|k| k / cell.side()))
            }
            _ => 0.0,
        }
    }

    /// Whether straight lines on the surface are straight in the domain.
    pub fn keeps_lines(&self) -> bool {
        matches!(self.kind, Kind::Parallelogram { .. } | Kind::Facet { .. })
    }

    /// Where a ray from the receiver meets a plane domain, in its coordinates; `None` if it does not, or the
    /// domain is not plane.
    pub fn towards(&self, d: &Vector3) -> Option<(f64, f64)> {
        // x = origin + p e₁ + q e₂ = receiver + t d.
        let weights = |origin: Vector3, [e1, e2]: [Vector3; 2]| {
            let to = self.receiver.coords - origin;
            let full = e1.cross(&e2).dot(d);
            let (p, q) = (to.cross(&e2).dot(d) / full, e1.cross(&to).dot(d) / full);
            let t = -to.dot(&e1.cross(&e2)) / full;
            (t > 0.0 && p.is_finite() && q.is_finite()).then_some((p, q))
        };
        match &self.kind {
            Kind::Parallelogram { centre, edges, .. } => {
                let (p, q) = weights(*centre, *edges)?;
                Some((0.5 + 0.5 * p, 0.5 + 0.5 * q))
            }
            Kind::Facet { facet, .. } => weights(facet.origin.coords, facet.edges),
            Kind::Ellipse { centre, radii, .. } => {
                let (p, q) = weights(*centre, *radii)?;
                let turn = math::atan2(q, p) / (2.0 * PI);
                Some(((p * p + q * q).sqrt(), turn - turn.floor()))
            }
            Kind::Triangle { mesh, triangle } => {
                let [v0, v1, v2] = mesh.corners(*triangle);
                let (p, q) = weights(v0.coords, [v1 - v0, v2 - v0])?;
                Some((p / (1.0 - q).max(f64::MIN_POSITIVE), q))
            }
            _ => None,
        }
    }

    /// The border that the surface's own near wall is on the way to a first point on its far wall.
    pub fn rim(&self, first: &FirstPoint) -> Option<Dual> {
        let Kind::CylinderFromOutside { cylinder, far: true, .. } = &self.kind else { return None };
        let ray = DualRay { o: DualVector::constant(self.receiver.coords), d: first.d };
        Some(over_the_rim(cylinder, &ray))
    }

    /// The first point at (a, b); `None` where the parametrisation is singular or the receiver lies
    /// on it.
    pub fn at(&self, a: f64, b: f64) -> Option<FirstPoint> {
        let (a, b) = (Dual::new(a, 1.0, 0.0), Dual::new(b, 0.0, 1.0));
        let combine = |o: &Vector3, v: &[Vector3; 2], f: [Dual; 2]| DualVector {
            v: o + v[0] * f[0].v + v[1] * f[1].v,
            a: v[0] * f[0].a + v[1] * f[1].a,
            b: v[0] * f[0].b + v[1] * f[1].b,
        };
        match &self.kind {
            Kind::Facet { mesh, facet, normal } => {
                let x = combine(&facet.origin.coords, &facet.edges, [a, b]);
                let area = DualVector::constant(facet.edges[0].cross(&facet.edges[1]));
                let point = facet.point(mesh, Point3::from(x.v));
                self.finish_with(x, area, DualVector::constant(*normal), point)
            }
            Kind::Parallelogram { centre, edges, normal } => {
                let (p, q) = (a * 2.0 + -1.0, b * 2.0 + -1.0);
                let x = combine(centre, edges, [p, q]);
                let area = DualVector::constant(edges[0].cross(&edges[1]) * 4.0);
                self.finish(x, area, DualVector::constant(*normal), (p.v, q.v))
            }
            Kind::Ellipse { centre, radii, normal } => {
                let phi = b * (2.0 * PI);
                let (p, q) = (a * phi.cos(), a * phi.sin());
                let x = combine(centre, radii, [p, q]);
                let cross = radii[0].cross(&radii[1]);
                let area = DualVector::constant(cross).scaled(a * (2.0 * PI));
                self.finish(x, area, DualVector::constant(*normal), (p.v, q.v))
            }
            Kind::Triangle { mesh, triangle } => {
                // Weights of the second and third vertex: a (1 − b) and b.
                let (p, q) = (a * (b * -1.0 + 1.0), b);
                let point = mesh.at(*triangle, p.v, q.v);
                let [xp, xq] = mesh.tangents(&point);
                let [xpp, xpq, xqq] = mesh.second_derivatives(*triangle);
                let along = |u: &Vector3, v: &Vector3| (u * p.a + v * q.a, u * p.b + v * q.b);
                let (xa, xb) = along(&xp, &xq);
                let x = DualVector::new(point.x.coords, xa, xb);
                let (ua, ub) = along(&xpp, &xpq);
                let (va, vb) = along(&xpq, &xqq);
                let (u, v) = (DualVector::new(xp, ua, ub), DualVector::new(xq, va, vb));
                let area = u.cross(&v).scaled(b * -1.0 + 1.0);
                let local = mesh.local(&point)?;
                let n = DualVector::new(local.n.into_inner(), local.dn_dx * x.a, local.dn_dx * x.b);
                self.finish_with(x, area, n, point)
            }
            Kind::Parameters { surface } => {
                let jet = surface.jet(a.v, b.v);
                let x = DualVector::new(jet.x.coords, jet.xu, jet.xv);
                let area = DualVector::new(
                    jet.xu.cross(&jet.xv),
                    jet.xuu.cross(&jet.xv) + jet.xu.cross(&jet.xuv),
                    jet.xuv.cross(&jet.xv) + jet.xu.cross(&jet.xvv),
                );
                let n = area.scaled(area.norm_squared().sqrt().recip()) * surface.normal_sign();
                if !n.v.iter().all(|c| c.is_finite()) {
                    return None;
                }
                self.finish(x, area, n, (a.v, b.v))
            }
            Kind::SphereFromOutside { sphere, frame: [e1, e2, axis], distance } => {
                let i = a * LIMB;
                let (sin_i, cos_i) = (i.sin(), i.cos());
                let k = sphere.radius() / distance;
                let sin_alpha = sin_i * k;
                let cos_alpha = (sin_alpha.squared() * -1.0 + 1.0).sqrt();
                let phi = b * (2.0 * PI);
                let across = combine(&Vector3::zeros(), &[*e1, *e2], [phi.cos(), phi.sin()]);
                let d = DualVector::constant(*axis).scaled(cos_alpha) + across.scaled(sin_alpha);
                let t = cos_alpha * *distance - cos_i * sphere.radius();
                let x = DualVector::constant(self.receiver.coords) + d.scaled(t);
                let outward =
                    (x - DualVector::constant(sphere.centre().coords)) * (1.0 / sphere.radius());
                let solid_angle = sin_alpha * cos_i * (k * LIMB * 2.0 * PI) / cos_alpha;
                let sign = if sphere.faces_outward() { 1.0 } else { -1.0 };
                Some(FirstPoint {
                    x,
                    n: outward * sign,
                    d,
                    distance: t.v,
                    solid_angle,
                    point: SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x: Point3::from(x.v) },
                })
            }
            Kind::SphereFromInside { sphere, frame: [e1, e2, axis], distance, chords } => {
                // On the sphere itself half of all directions lead away from it.
                let span = if *chords { 0.5 * PI } else { PI };
                let psi = a * span + (PI - span);
                let (sin, cos) = (psi.sin(), psi.cos());
                let phi = b * (2.0 * PI);
                let across = combine(&Vector3::zeros(), &[*e1, *e2], [phi.cos(), phi.sin()]);
                let d = DualVector::constant(*axis).scaled(cos) + across.scaled(sin);
                let r = sphere.radius();
                let half = if *chords {
                    cos * -*distance
                } else {
                    ((sin * *distance).squared() * -1.0 + r * r).sqrt()
                };
                let t = half + cos * -*distance;
                let x = DualVector::constant(self.receiver.coords) + d.scaled(t);
                let outward = (x - DualVector::constant(sphere.centre().coords)) * (1.0 / r);
                let sign = if sphere.faces_outward() { 1.0 } else { -1.0 };
                Some(FirstPoint {
                    x,
                    n: outward * sign,
                    d,
                    distance: t.v,
                    solid_angle: sin * (span * 2.0 * PI),
                    point: SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x: Point3::from(x.v) },
                })
            }
            Kind::CylinderFromOutside { cylinder, frame, ratio, far } => {
                let i = a * (2.0 * LIMB) + (-LIMB);
                let (sin_i, cos_i) = (i.sin(), i.cos());
                let sin_psi = sin_i * *ratio;
                let cos_psi = (sin_psi.squared() * -1.0 + 1.0).sqrt();
                let turn = cos_i * *ratio / cos_psi;
                let (beta, rate) = if *far {
                    (i * -1.0 + PI - sin_psi.asin(), turn + 1.0)
                } else {
                    (i - sin_psi.asin(), turn * -1.0 + 1.0)
                };
                self.on_cylinder(cylinder, frame, beta, rate * (2.0 * LIMB), b)
            }
            Kind::CylinderFromInside { cylinder, frame } => {
                self.on_cylinder(cylinder, frame, a * (2.0 * PI), Dual::constant(2.0 * PI), b)
            }
        }
    }

    /// A point of a cylinder by azimuth `beta` (turning at `rate` per unit of a) and height b.
    fn on_cylinder(
        &self,
        cylinder: &Cylinder,
        frame: &[Vector3; 2],
        beta: Dual,
        rate: Dual,
        height: Dual,
    ) -> Option<FirstPoint> {
        let (c, s) = (beta.cos(), beta.sin());
        let n = DualVector {
            v: frame[0] * c.v + frame[1] * s.v,
            a: frame[0] * c.a + frame[1] * s.a,
            b: frame[0] * c.b + frame[1] * s.b,
        };
        let (r, length) = (cylinder.radius(), cylinder.length());
        let along = DualVector::constant(cylinder.axis().into_inner() * length).scaled(height);
        let x = DualVector::constant(cylinder.ends()[0].coords) + along + n * r;
        let area = n.scaled(rate * (r * length));
        let sign = if cylinder.faces_outward() { 1.0 } else { -1.0 };
        self.finish(x, area, n * sign, (0.0, height.v))
    }

    fn finish(
        &self,
        x: DualVector,
        area: DualVector,
        n: DualVector,
        (p, q): (f64, f64),
    ) -> Option<FirstPoint> {
        let point = SurfacePoint { primitive: 0, p, q, x: Point3::from(x.v) };
        self.finish_with(x, area, n, point)
    }

    /// Direction and solid angle from the point and its area vector per unit of (a, b).
    fn finish_with(
        &self,
        x: DualVector,
        area: DualVector,
        n: DualVector,
        point: SurfacePoint,
    ) -> Option<FirstPoint> {
        let l = x - DualVector::constant(self.receiver.coords);
        let r2 = l.norm_squared();
        if r2.v <= 0.0 {
            return None;
        }
        let inverse = r2.sqrt().recip();
        let d = l.scaled(inverse);
        // Yu & Wu (12), (13): cos θ₂ dA / r².
        let signed = d.dot(&area) * inverse * inverse;
        let solid_angle = if signed.v < 0.0 { -signed } else { signed };
        Some(FirstPoint { x, n, d, distance: r2.v.sqrt(), solid_angle, point })
    }
}
