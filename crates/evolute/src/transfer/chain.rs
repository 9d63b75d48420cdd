//! What happens to a family of rays at one specular surface.

use arrayvec::ArrayVec;

use super::landing::Target;
use crate::geometry::Vector3;
use crate::optics::differential::{fresnel_conductor, fresnel_dielectric, reflected, refracted};
use crate::optics::{Dual, DualRay, DualVector};
use crate::scene::{Material, ShapeId};
use crate::surface::SurfacePoint;
use crate::trace::{Anchor, Hit};

/// Most edge functions that a chain carries for horizon, sides and borders; what comes later is
/// decided by sampling.
pub const MAX_CHAIN_EDGES: usize = 12;

/// What a specular surface does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Event {
    /// Reflection.
    Reflect,
    /// Refraction.
    Transmit,
}

/// One letter of a word: a surface, the side it is met on, and what happens there.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// The surface.
    pub shape: ShapeId,
    /// The triangle, for a faceted mesh.
    pub primitive: Option<u32>,
    /// Whether it is met on its front.
    pub front: bool,
    /// What happens.
    pub event: Event,
    /// A point where some ray of the family met it.
    pub hint: SurfacePoint,
}

impl Step {
    /// What a chain meets that goes on by this letter.
    pub fn target(&self) -> Target {
        Target { shape: self.shape, primitive: self.primitive, front: self.front, lamp: false }
    }

    /// Whether both are the same letter (hints aside).
    pub fn same_letter(&self, other: &Self) -> bool {
        (self.shape, self.primitive, self.front, self.event)
            == (other.shape, other.primitive, other.front, other.event)
    }
}

/// What stands in a chain's way, and in which of its legs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Blocker {
    /// The body.
    pub shape: ShapeId,
    /// How many letters come before the leg.
    pub leg: u32,
}

/// Whether the legs of a chain so far are free.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Visibility {
    /// Nothing in the way.
    Free,
    /// Something stands in a leg: what, if it is known.
    Blocked(Option<Blocker>),
    /// The chain is beyond a border, where an edge function decides.
    Beyond,
}

/// A family of rays as it meets a surface.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// The central point.
    pub anchor: Anchor,
    /// Points [m].
    pub x: DualVector,
    /// Unit directions in which the family travels (away from the receiver).
    pub d: DualVector,
    /// Unit normals on the shape's front.
    pub n: DualVector,
    /// Normal of the first surface, for criterion 2.
    pub first_normal: Vector3,
    /// cos θ₁ times solid angle at the receiver per unit of (a, b) [sr].
    pub weight: Dual,
    /// Direction of the first leg, for criterion 1.
    pub first_direction: Vector3,
    /// Throughput of radiance so far, a channel each.
    pub throughput: [Dual; 3],
    /// (n_P / n)² for the medium that the family is in: the part of the throughput that leaving the
    /// medium gives back.
    pub radiance_scale: f64,
    /// Positive where the chain is inside borders and on the right side.
    pub edges: ArrayVec<Dual, MAX_CHAIN_EDGES>,
    /// Whether the legs are free.
    pub visible: Visibility,
}

impl Arrival {
    /// Adds an edge function, or decides by sampling when there are too many.
    pub fn push_edge(&mut self, edge: Dual) {
        if self.edges.try_push(edge).is_err() && edge.v <= 0.0 {
            self.visible = Visibility::Blocked(None);
        }
    }
}

/// A family of rays as it leaves a surface.
#[derive(Clone, Debug)]
pub struct Departure {
    /// Where the central ray leaves.
    pub anchor: Anchor,
    /// As it leaves; the origin is on the surface.
    pub ray: DualRay,
    /// As in [`Arrival::first_normal`].
    pub first_normal: Vector3,
    /// As in [`Arrival::weight`].
    pub weight: Dual,
    /// As in [`Arrival::first_direction`].
    pub first_direction: Vector3,
    /// Throughput of radiance after the event, a channel each.
    pub throughput: [Dual; 3],
    /// As in [`Arrival::radiance_scale`].
    pub radiance_scale: f64,
    /// As in [`Arrival::edges`].
    pub edges: ArrayVec<Dual, MAX_CHAIN_EDGES>,
    /// As in [`Arrival::visible`].
    pub visible: Visibility,
    /// The nearest hit of the central ray, looked for only where the legs are free.
    pub next: Option<Hit>,
}

impl Departure {
    /// Whether all legs are free and the chain is inside all borders.
    pub fn is_legal(&self) -> bool {
        self.visible == Visibility::Free && self.edges.iter().all(|e| e.v >= 0.0)
    }

    /// How fast the last leg turns [rad] per unit of (a, b).
    pub fn turning(&self) -> f64 {
        self.ray.d.a.norm() + self.ray.d.b.norm()
    }

    /// The throughput, largest channel, that is left of a chain which loses nothing more: leaving the
    /// medium is reckoned in.
    pub fn lossless_throughput(&self) -> f64 {
        self.throughput.iter().fold(0f64, |m, t| m.max(t.v)) / self.radiance_scale
    }
}

/// Carries the family through `step`; `None` where it cannot be (total reflection asked to
/// transmit). `next` is left empty.
///
/// Throughput follows radiance from the far end to the receiver: Fresnel's factors, and (n₁/n₂)² at a
/// boundary from the receiver's side 1 into 2.
pub fn depart(arrival: &Arrival, material: &Material, step: &Step) -> Option<Departure> {
    let mut radiance_scale = arrival.radiance_scale;
    // The normal on the side that the family comes from.
    let n = if step.front { arrival.n } else { -arrival.n };
    let cos_i = -arrival.d.dot(&n);
    let side = if step.front { &material.front } else { &material.back };
    let mut throughput = arrival.throughput;
    let d = match (step.event, &material.dielectric) {
        (event, Some(boundary)) if side.mirror.is_none() || event == Event::Transmit => {
            let (n1, n2) = if step.front {
                (boundary.exterior_ior, boundary.interior_ior)
            } else {
                (boundary.interior_ior, boundary.exterior_ior)
            };
            let inside = refracted(&arrival.d, &n, n1 / n2, cos_i);
            let reflectance = inside.as_ref().map_or(Dual::constant(1.0), |(_, cos_t)| {
                fresnel_dielectric(cos_i, *cos_t, n1, n2)
            });
            match event {
                Event::Reflect => {
                    for (t, f) in throughput.iter_mut().zip(boundary.reflectance.0) {
                        *t = *t * reflectance * f;
                    }
                    reflected(&arrival.d, &n)
                }
                Event::Transmit => {
                    radiance_scale *= (n1 * n1) / (n2 * n2);
                    let passed = (reflectance * -1.0 + 1.0) * ((n1 * n1) / (n2 * n2));
                    for (t, f) in throughput.iter_mut().zip(boundary.transmittance.0) {
                        *t = *t * passed * f;
                    }
                    inside?.0
                }
            }
        }
        (Event::Transmit, _) => return None,
        (Event::Reflect, _) => {
            let mirror = side.mirror.as_ref()?;
            for (c, t) in throughput.iter_mut().enumerate() {
                let reflectance = match &mirror.conductor {
                    Some((eta, k)) => fresnel_conductor(cos_i, eta[c], k[c]),
                    None => Dual::constant(1.0),
                };
                *t = *t * reflectance * mirror.weight[c];
            }
            reflected(&arrival.d, &n)
        }
    };
    let ray = DualRay { o: arrival.x, d };
    let finite = d.v.iter().chain(d.a.iter()).chain(d.b.iter()).all(|c| c.is_finite())
        && throughput.iter().all(Dual::is_finite);
    finite.then(|| Departure {
        anchor: arrival.anchor,
        ray,
        first_normal: arrival.first_normal,
        weight: arrival.weight,
        first_direction: arrival.first_direction,
        throughput,
        radiance_scale,
        edges: arrival.edges.clone(),
        visible: arrival.visible,
        next: None,
    })
}

/// The events that a surface offers to light on one of its sides.
pub fn events(material: &Material, front: bool) -> ArrayVec<Event, 2> {
    let side = if front { &material.front } else { &material.back };
    let mut list = ArrayVec::new();
    let boundary = material.dielectric.as_ref();
    if side.mirror.is_some() || boundary.is_some_and(|d| !d.reflectance.is_black()) {
        list.push(Event::Reflect);
    }
    if boundary.is_some_and(|d| !d.transmittance.is_black()) {
        list.push(Event::Transmit);
    }
    list
}
