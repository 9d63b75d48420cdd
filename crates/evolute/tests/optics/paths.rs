//! Random chains and the rays of their neighbourhoods.

use crate::bodies::{Body, Placed, Random};
use evolute::geometry::{Matrix2, Point3, Rgb, UnitVector3, Vector3};
use evolute::optics::{
    DielectricBoundary, Interaction, Vertex, Wavefront, reflect_direction, refract_direction,
};

/// A chain whose surfaces can be met again by other rays.
pub struct Path<'b> {
    pub start: Point3,
    pub direction: UnitVector3,
    pub links: Vec<Placed<'b>>,
    pub vertices: Vec<Vertex>,
    pub end: Point3,
    /// Direction of the last leg, from the receiver outward.
    pub last: UnitVector3,
    /// What the chain meets, for tables: indices into the list of bodies.
    pub kinds: Vec<usize>,
}

/// Which way along a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    FromReceiver,
    FromSource,
}

/// Which rays: through one point, or parallel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Family {
    Point,
    Collimated,
}

/// Draws a chain of `count` interactions. From the end of the last leg a new leg of 0.1 to 3 m
/// (uniform in the logarithm) is drawn, then a body of 0.3 to 5 m, a point of it, its slant (the cosine
/// of incidence uniform in 0.02 to 1), its side, and whether it reflects (half of them; so it does at
/// total reflection) or refracts into an index uniform in 1 to 2. With `focus`, the last leg ends
/// that fraction of itself before or behind a focus of the wave from P, where there is one ahead;
/// so come the large condition numbers.
pub fn random_path<'b>(
    bodies: &'b [Body],
    count: usize,
    focus: Option<f64>,
    r: &mut Random,
) -> Option<Path<'b>> {
    let start = Point3::new(r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0), r.uniform(-1.0, 1.0));
    let direction = r.direction();
    let (mut o, mut d, mut index) = (start, direction, r.uniform(1.0, 2.0));
    let mut wave = Wavefront::spherical(d, index);
    let (mut links, mut vertices, mut kinds) = (vec![], vec![], vec![]);
    for _ in 0..count {
        let x = o + d.into_inner() * r.scale(0.1, 3.0);
        let cos = r.uniform(0.02, 1.0);
        let across = d.cross(&r.direction()).try_normalize(0.0)?;
        let n = d.into_inner() * cos + across * (1.0 - cos * cos).sqrt();
        let n = UnitVector3::new_normalize(n * r.sign());
        let kind = r.below(bodies.len());
        let placed = Placed::new(&bodies[kind], r.scale(0.3, 5.0), x, n, r)?;
        let (t, local) = placed.meet(&o, &d)?;
        let mirror = r.chance(0.25);
        let other = r.uniform(1.0, 2.0);
        let refracted = refract_direction(&d, &local.n, index, other);
        let (reflectance, transmittance) =
            DielectricBoundary { n1: index, n2: other }.split(d.dot(&local.n).abs());
        let split = r.chance(2.0 / 3.0);
        let (interaction, throughput, next) = match refracted {
            _ if mirror => (Interaction::Reflection, 0.9, index),
            Some(_) if split => (Interaction::Refraction, transmittance, other),
            _ => (Interaction::Reflection, reflectance, index),
        };
        wave = wave.transferred(t);
        (d, wave) = match (interaction, refracted) {
            (Interaction::Refraction, Some(f)) => (f.direction, wave.refracted(&local, next)?),
            _ => (reflect_direction(&d, &local.n), wave.reflected(&local)?),
        };
        vertices.push(Vertex {
            local,
            interaction,
            index_toward_receiver: index,
            index_toward_source: next,
            throughput: Rgb::grey(throughput),
        });
        links.push(placed);
        kinds.push(kind);
        (o, index) = (local.x, next);
    }
    let ahead = wave.focal_distances().into_iter().find(|f| (0.05..50.0).contains(f));
    let length = match (focus, ahead) {
        (Some(off), Some(f)) => f * (1.0 + off),
        _ => r.scale(0.1, 3.0),
    };
    let end = o + d.into_inner() * length;
    Some(Path { start, direction, links, vertices, end, last: d, kinds })
}

impl Path<'_> {
    /// The ray from one end, moved by `offset` [m], followed surface by surface: where it crosses the
    /// plane through the other end across the chain there, as a displacement from that end.
    pub fn follow(&self, way: Way, offset: &Vector3, direction: &Vector3) -> Option<Vector3> {
        let count = self.links.len();
        let (from, to, across) = match way {
            Way::FromReceiver => (self.start, self.end, self.last),
            Way::FromSource => (self.end, self.start, self.direction),
        };
        let mut o = from + offset;
        let mut d = UnitVector3::new_normalize(*direction);
        for step in 0..count {
            let i = if way == Way::FromReceiver { step } else { count - 1 - step };
            let (_, local) = self.links[i].meet(&o, &d)?;
            let vertex = &self.vertices[i];
            let mut indices = (vertex.index_toward_receiver, vertex.index_toward_source);
            if way == Way::FromSource {
                indices = (indices.1, indices.0);
            }
            d = match vertex.interaction {
                Interaction::Reflection => reflect_direction(&d, &local.n),
                Interaction::Refraction => {
                    refract_direction(&d, &local.n, indices.0, indices.1)?.direction
                }
            };
            o = local.x;
        }
        let t = across.dot(&(to - o)) / across.dot(&d);
        Some(o + d.into_inner() * t - to)
    }

    /// Direction and refractive index at an end.
    pub fn beginning(&self, way: Way) -> (UnitVector3, f64) {
        match way {
            Way::FromReceiver => (self.direction, self.vertices[0].index_toward_receiver),
            Way::FromSource => {
                (-self.last, self.vertices[self.links.len() - 1].index_toward_source)
            }
        }
    }

    /// A wave that begins at one end, at the other; and a step for finite differences in the family's
    /// own coordinates: a thousandth of what changes something on the way by itself.
    pub fn carried(&self, way: Way, mut wave: Wavefront) -> Option<(Wavefront, f64)> {
        let count = self.links.len();
        let (mut at, to) = match way {
            Way::FromReceiver => (self.start, self.end),
            Way::FromSource => (self.end, self.start),
        };
        let mut rate = 1.0f64;
        for step in 0..count {
            let i = if way == Way::FromReceiver { step } else { count - 1 - step };
            let vertex = &self.vertices[i];
            wave = wave.transferred((vertex.local.x - at).norm());
            at = vertex.local.x;
            let cos = wave.direction().dot(&vertex.local.n).abs();
            let foot = wave.position_jacobian().norm() / cos;
            let before = wave.direction_jacobian().norm();
            let next = match way {
                Way::FromReceiver => vertex.index_toward_source,
                Way::FromSource => vertex.index_toward_receiver,
            };
            wave = match vertex.interaction {
                Interaction::Reflection => wave.reflected(&vertex.local)?,
                Interaction::Refraction => wave.refracted(&vertex.local, next)?,
            };
            let turn = before + wave.direction_jacobian().norm() + vertex.local.dn_dx.norm() * foot;
            let least = cos.min(wave.direction().dot(&vertex.local.n).abs());
            // √ at the limb and at total reflection: angles count as squares of cosines.
            rate = rate.max(foot / self.links[i].smooth).max(turn / (least * least));
        }
        Some((wave.transferred((to - at).norm()), 1e-3 / rate))
    }

    /// ∂(displacement at the other end)/∂(coordinates of the family at this one) by central differences of traced rays,
    /// extrapolated to no step; in the frames of the wave. `None` if no step worked.
    pub fn difference(
        &self,
        way: Way,
        family: Family,
        wave: &Wavefront,
        step: f64,
    ) -> Option<Matrix2> {
        let direction = self.beginning(way).0;
        let (e1, e2) = evolute::geometry::tangent_frame(&direction);
        let frame = wave.frame();
        let column = |e: &Vector3, h: f64| {
            let ray = |h: f64| match family {
                Family::Point => {
                    self.follow(way, &Vector3::zeros(), &(direction.into_inner() + e * h))
                }
                Family::Collimated => self.follow(way, &(e * h), &direction),
            };
            let (plus, minus) = (ray(h)?, ray(-h)?);
            Some((plus - minus) / (2.0 * h))
        };
        // Three step lengths; errors of order h² and h⁴ cancel.
        let extrapolated = |e: &Vector3, h: f64| {
            let [a, b, c] = [column(e, h)?, column(e, h / 2.0)?, column(e, h / 4.0)?];
            let (ab, bc) = ((b * 4.0 - a) / 3.0, (c * 4.0 - b) / 3.0);
            Some(((bc * 16.0 - ab) / 15.0, (bc - ab).norm()))
        };
        let mut best: Option<(Matrix2, f64)> = None;
        for shorter in [1.0, 10.0, 100.0, 1e3, 0.1, 0.01] {
            let h = step * shorter;
            let Some(((c1, r1), (c2, r2))) = extrapolated(&e1, h).zip(extrapolated(&e2, h)) else {
                continue;
            };
            let j = Matrix2::new(
                frame[0].dot(&c1),
                frame[0].dot(&c2),
                frame[1].dot(&c1),
                frame[1].dot(&c2),
            );
            let doubt = (r1 + r2) / j.norm();
            if best.is_none_or(|b| doubt < b.1) {
                best = Some((j, doubt));
            }
            if doubt < 1e-8 {
                break;
            }
        }
        best.map(|b| b.0)
    }
}
