//! The integrand of one term of a receiver's irradiance: a lamp seen directly, or through a word.

use arrayvec::ArrayVec;

use super::chain::{Blocker, Departure, MAX_CHAIN_EDGES, Visibility};
use super::cut::MAX_CONSTRAINTS;
use super::domain::{Domain, FirstPoint};
use super::extension::over_the_far_rim;
use super::grid::GridPoint;
use super::lamp::{Lamp, MAX_LAMP_EDGES};
use super::settings::{Counts, Receiver};
use super::shaft::{Body, Shaft, is_end};
use super::word::{WordId, Words};
use crate::geometry::{Aabb, Point3, Ray, Vector3};
use crate::optics::Dual;
use crate::scene::{Scene, ShapeId};
use crate::surface::Surface;
use crate::trace::{Anchor, Tracer};

/// Most edge functions of a field; the rest of [`MAX_CONSTRAINTS`] is for the border of shadows.
pub const MAX_FIELD_EDGES: usize = MAX_CHAIN_EDGES + MAX_LAMP_EDGES + 1;
const _: () = assert!(MAX_FIELD_EDGES < MAX_CONSTRAINTS);

/// What sampling knows of a point of a domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sight {
    /// Nothing stands in the way.
    On,
    /// Something does, or the chain does not exist.
    Off,
    /// Not known; edge functions rule here.
    Unknown,
}

/// Values and gradients at one grid point.
#[derive(Clone, Debug)]
pub struct FieldSample {
    /// Positive where light comes through.
    pub edges: ArrayVec<Dual, MAX_FIELD_EDGES>,
    /// How many of them, the first, are borders of the chain; the others are the lamp's outline.
    pub borders: usize,
    /// Irradiance per unit of (a, b) and of radiance, a channel each (only the first, if grey).
    pub weight: [Dual; 3],
    /// Whether the chain is real: free as far as the last leg, and inside its borders.
    pub legal: bool,
    /// Whether something stands in the way.
    pub sight: Sight,
    /// What does, if it is known; beside the lamp, what stands before the place where the chain passes it.
    pub blocker: Option<Blocker>,
    /// Normal of the first surface.
    pub normal: Vector3,
    /// Direction of the last leg.
    pub direction: Vector3,
    /// How fast the last leg turns [rad] per unit of (a, b).
    pub turning: f64,
    /// Direction of the first leg.
    pub first_direction: Vector3,
    /// Largest share of radiance that gets through, of all channels.
    pub throughput: f64,
    /// What the last leg meets.
    pub next: Option<ShapeId>,
}

impl FieldSample {
    /// Whether all edge functions are positive.
    pub fn is_inside(&self) -> bool {
        self.edges.iter().all(|e| e.v > 0.0)
    }
}

/// A lamp seen directly, through the domain of its own surface.
pub struct DirectField<'s> {
    domain: Domain<'s>,
    shape: ShapeId,
    receiver: Receiver,
    contacts: ArrayVec<Anchor, 8>,
    tracer: &'s Tracer<'s>,
    /// What may hide parts of a flat lamp; `None` if that is much, or not known.
    suspects: Option<Vec<(ShapeId, u32)>>,
}

impl<'s> DirectField<'s> {
    /// The field of one domain of a lamp.
    pub fn new(
        domain: Domain<'s>,
        shape: ShapeId,
        receiver: Receiver,
        tracer: &'s Tracer<'s>,
        suspects: Option<Vec<(ShapeId, u32)>>,
    ) -> Self {
        let contacts = tracer.contacts(&receiver.position);
        Self { domain, shape, receiver, contacts, tracer, suspects }
    }

    /// Whether something that is not among the `known` may hide a part of the cell [a, a+h] × [b, b+h]
    /// that samples did not see. Bodies known only by their boxes count on the first divisions alone, since a box that
    /// reaches in may do so for ever.
    pub fn may_hide(&self, (a, b): (f64, f64), h: f64, divisions: u32, known: &[ShapeId]) -> bool {
        let corners: ArrayVec<Point3, 4> = [(a, b), (a + h, b), (a + h, b + h), (a, b + h)]
            .into_iter()
            .filter_map(|(a, b)| Some(Point3::from(self.domain.at(a, b)?.x.v)))
            .collect();
        if corners.len() < 4 {
            return false;
        }
        let shaft = Shaft::new(&self.receiver.position, &corners);
        let hides = |shape: ShapeId, primitive: u32| {
            let (body, counts) = Body::of(self.tracer.scene(), shape, primitive);
            !known.contains(&shape) && divisions < counts && !shaft.excludes(&body)
        };
        if let Some(suspects) = &self.suspects {
            return suspects.iter().any(|&(shape, primitive)| hides(shape, primitive));
        }
        let bounds = Aabb::around(corners.iter().copied().chain([self.receiver.position]));
        let scene = self.tracer.scene();
        let wanted = |shape: ShapeId, _: u32| {
            !known.contains(&shape) && !is_end(scene, shape, self.shape, &self.contacts)
        };
        self.tracer.any_in(&bounds, |b| !shaft.keeps_out(b), wanted, hides)
    }

    /// Whether nothing stands between the receiver and the point of the lamp; not known beyond an edge of the field.
    fn sight(&self, first: &FirstPoint, cos_1: f64, facing: f64, counts: &mut Counts) -> Sight {
        if cos_1 <= 0.0 || facing <= 0.0 {
            return Sight::Unknown;
        }
        counts.rays += 1;
        let ray = Ray::new(self.receiver.position, first.d.v);
        let end = Anchor { shape: self.shape, point: first.point };
        let hidden = self.tracer.occluded(&ray, first.distance, &self.contacts, Some(&end));
        if hidden { Sight::Off } else { Sight::On }
    }

    /// Whether nothing is known to stand in the way at a grid point.
    pub fn sees(&self, at: GridPoint, counts: &mut Counts) -> bool {
        let (a, b) = at.coordinates();
        self.domain.at(a, b).is_some_and(|first| {
            let cos_1 = first.d.v.dot(&self.receiver.normal);
            let facing = -first.d.v.dot(&first.n.v);
            self.sight(&first, cos_1, facing, counts) != Sight::Off
        })
    }

    /// The sample at a grid point.
    pub fn sample(&self, at: GridPoint, counts: &mut Counts) -> Option<FieldSample> {
        let (a, b) = at.coordinates();
        let first = self.domain.at(a, b)?;
        let cos_1 = first.d.dot_constant(&self.receiver.normal);
        let facing = -first.d.dot(&first.n);
        let mut solid_angle = first.solid_angle;
        if facing.v < 0.0 {
            solid_angle = -solid_angle;
        }
        let weight = cos_1 * solid_angle;
        let mut edges = ArrayVec::new();
        edges.push(cos_1);
        edges.push(facing);
        let sight = self.sight(&first, cos_1.v, facing.v, counts);
        let blocker = (sight == Sight::Off).then(|| {
            counts.rays += 1;
            let ray = Ray::new(self.receiver.position, first.d.v);
            self.tracer.nearest(&ray, first.distance, &self.contacts)
        });
        let blocker = blocker.flatten().map(|hit| Blocker { shape: hit.anchor.shape, leg: 0 });
        Some(FieldSample {
            borders: edges.len(),
            edges,
            weight: [weight; 3],
            legal: true,
            sight,
            blocker,
            normal: first.n.v,
            direction: first.d.v,
            turning: first.d.a.norm() + first.d.b.norm(),
            first_direction: first.d.v,
            throughput: 1.0,
            next: Some(self.shape),
        })
    }
}

/// The sample of a lamp through a word.
pub fn sample_through(
    words: &mut Words<'_>,
    word: WordId,
    lamp: &Lamp,
    at: GridPoint,
) -> Option<FieldSample> {
    let (scene, depth) = (words.scene(), words.depth(word));
    let departure = words.departure(word, at)?;
    let mut edges: ArrayVec<Dual, MAX_FIELD_EDGES> = departure.edges.iter().copied().collect();
    let outline = lamp.edges(&departure.ray);
    let on_lamp = outline.iter().all(|e| e.v > 0.0);
    edges.extend(outline);
    let (mut sight, blocker) = sight(departure, lamp, scene, on_lamp, depth);
    if let Surface::Cylinder(cylinder) = &scene.shape(departure.anchor.shape).surface {
        // The far wall is the one occluder that has an edge function.
        let end = lamp.passes_at(&departure.ray).unwrap_or(f64::INFINITY);
        let wall = over_the_far_rim(cylinder, &departure.ray, end);
        edges.push(wall);
        if wall.v <= 0.0 && sight == Sight::Off {
            sight = Sight::Unknown;
        }
    }
    let w = departure.weight;
    Some(FieldSample {
        edges,
        borders: departure.edges.len(),
        weight: departure.throughput.map(|t| w * t),
        legal: departure.is_legal(),
        sight,
        blocker,
        normal: departure.first_normal,
        direction: departure.ray.d.v,
        turning: departure.turning(),
        first_direction: departure.first_direction,
        throughput: departure.throughput.iter().fold(0.0, |m, t| m.max(t.v.abs())),
        next: departure.next.map(|h| h.anchor.shape),
    })
}

/// Whether the last leg reaches the lamp, and what keeps it from it. Where it misses the outline, what it
/// meets instead says nothing: a wall that touches the lamp's edge is no occluder.
fn sight(
    departure: &Departure,
    lamp: &Lamp,
    scene: &Scene,
    on_outline: bool,
    leg: u32,
) -> (Sight, Option<Blocker>) {
    match departure.visible {
        Visibility::Blocked(by) => return (Sight::Off, by),
        Visibility::Beyond => return (Sight::Unknown, None),
        Visibility::Free => {}
    }
    let next = departure.next.as_ref();
    let on_lamp = next.is_some_and(|h| lamp.is_hit(&h.anchor, scene));
    let by = next.map(|h| Blocker { shape: h.anchor.shape, leg });
    if !lamp.has_outline() {
        // The tracer alone knows; the back is dark and hides what is behind it.
        let front = next.and_then(|h| scene.shape(h.anchor.shape).surface.local(&h.anchor.point));
        let front = front.is_some_and(|l| l.ng.dot(&departure.ray.d.v) < 0.0);
        return if on_lamp && front { (Sight::On, None) } else { (Sight::Off, by) };
    }
    if on_lamp {
        return (Sight::On, None);
    }
    let Some(at) = lamp.passes_at(&departure.ray) else { return (Sight::Unknown, None) };
    // The lamp's own plane is met at the same distance but for rounding.
    match next {
        Some(hit) if hit.t < at * (1.0 - 1e-9) => {
            (if on_outline { Sight::Off } else { Sight::Unknown }, by)
        }
        _ if on_outline => (Sight::On, None),
        _ => (Sight::Unknown, None),
    }
}
