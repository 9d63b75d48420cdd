//! The legs of chains: from a word's departure at a grid point to the next surface, and what was met
//! there on the way.

use arrayvec::ArrayVec;

use super::{FirstLeg, Source, WordId, Words};
use crate::geometry::Ray;
use crate::optics::{Dual, DualRay};
use crate::surface::{Surface, SurfacePoint};
use crate::trace::{Anchor, Hit};
use crate::transfer::chain::{Arrival, Blocker, Departure, Step, Visibility, depart, events};
use crate::transfer::extension::{facet, meet};
use crate::transfer::grid::GridPoint;
use crate::transfer::lamp::{outlined, part_of};
use crate::transfer::landing::Target;

/// Two hits along a ray are in the same place when their distances differ by less than this share.
const SAME_PLACE: f64 = 1e-9;

impl Words<'_> {
    /// Traces a word's chain at a grid point; `None` where it does not exist.
    pub(super) fn trace(&mut self, word: WordId, at: GridPoint) -> Option<Departure> {
        self.counts.chains += 1;
        let step = self.words[word.0 as usize].step;
        let arrival = match self.words[word.0 as usize].source {
            Source::First(root) => self.first_arrival(root, &step, at)?,
            Source::After(parent) => self.next_arrival(parent, &step, at)?,
        };
        let material = &self.scene.shape(step.shape).material;
        let mut departure = depart(&arrival, material, &step)?;
        if departure.visible == Visibility::Free {
            let ray = Ray::new(departure.anchor.point.x, departure.ray.d.v);
            self.counts.rays += 1;
            let next = self.tracer.nearest(&ray, f64::INFINITY, &[departure.anchor]);
            departure.next = next;
            let legal = departure.is_legal();
            let told = next.is_some_and(|hit| self.discover(word, at, &departure.ray, &hit, legal));
            if legal && !told {
                self.words[word.0 as usize].landings.add_nothing(at);
            }
        }
        Some(departure)
    }

    /// Notes which letters could follow, and where a legal chain landed; whether on a letter or a lamp.
    fn discover(
        &mut self,
        word: WordId,
        at: GridPoint,
        ray: &DualRay,
        hit: &Hit,
        legal: bool,
    ) -> bool {
        let shape = self.scene.shape(hit.anchor.shape);
        let (specular, lamp) = (shape.material.is_specular(), !shape.radiance.is_black());
        if !specular && !lamp {
            return false;
        }
        let Some(local) = shape.surface.local(&hit.anchor.point) else { return false };
        let front = ray.d.v.dot(&local.ng) < 0.0;
        let mut landed = |target: Target| {
            if legal {
                self.words[word.0 as usize].landings.add(target, at);
                self.fresh.push((word, target, at));
            }
        };
        if lamp && front {
            let primitive = match &shape.surface {
                Surface::Mesh(m) if outlined(&shape.surface) => {
                    Some(part_of(m, hit.anchor.point.primitive))
                }
                _ => None,
            };
            landed(Target { shape: hit.anchor.shape, primitive, front, lamp: true });
        }
        if specular {
            let primitive = facet(&shape.surface, hit.anchor.point.primitive);
            landed(Target { shape: hit.anchor.shape, primitive, front, lamp: false });
            for event in events(&shape.material, front) {
                let step = Step {
                    shape: hit.anchor.shape,
                    primitive,
                    front,
                    event,
                    hint: hit.anchor.point,
                };
                let list = &mut self.words[word.0 as usize].discovered;
                if !list.iter().any(|s| s.same_letter(&step)) {
                    list.push(step);
                }
            }
        }
        specular || front
    }

    /// What a chain of a word meets as a letter that may follow.
    pub(super) fn met(&mut self, word: WordId, at: GridPoint) -> Option<Target> {
        let scene = self.scene;
        let departure = self.departure(word, at)?;
        let hit = departure.next.as_ref()?;
        let surface = &scene.shape(hit.anchor.shape).surface;
        let local = surface.local(&hit.anchor.point)?;
        let front = departure.ray.d.v.dot(&local.ng) < 0.0;
        let primitive = facet(surface, hit.anchor.point.primitive);
        Some(Target { shape: hit.anchor.shape, primitive, front, lamp: false })
    }

    /// The first leg at a grid point and what stands in it.
    pub(super) fn first_leg(&mut self, root: usize, at: GridPoint) -> &FirstLeg {
        let position = self.receiver.position;
        if !self.roots[root].legs.contains_key(&at.key()) {
            let (a, b) = at.coordinates();
            let leg = self.roots[root].domain.at(a, b).map(|first| {
                self.counts.rays += 1;
                let ray = Ray::new(position, first.d.v);
                let hit = self.tracer.nearest(&ray, f64::INFINITY, &self.contacts);
                // Nothing nearer than the point, whose own root the tracer finds at the same distance
                // but for rounding, or misses on a border or at the limb.
                let hit = hit.filter(|h| h.t < first.distance * (1.0 - 1e-8));
                (first, hit.map(|h| h.anchor.shape))
            });
            self.roots[root].legs.insert(at.key(), leg);
        }
        self.roots[root].legs.get(&at.key()).unwrap_or(&None)
    }

    fn first_arrival(&mut self, root: usize, step: &Step, at: GridPoint) -> Option<Arrival> {
        let (first, blocker) = *self.first_leg(root, at).as_ref()?;
        let normal = self.receiver.normal;
        let cos_1 = first.d.dot_constant(&normal);
        let mut arrival = Arrival {
            anchor: Anchor { shape: step.shape, point: first.point },
            x: first.x,
            d: first.d,
            n: first.n,
            first_normal: first.n.v,
            weight: cos_1 * first.solid_angle,
            first_direction: first.d.v,
            throughput: [Dual::constant(1.0); 3],
            radiance_scale: 1.0,
            edges: ArrayVec::new(),
            visible: blocker.map_or(Visibility::Free, |shape| {
                Visibility::Blocked(Some(Blocker { shape, leg: 0 }))
            }),
        };
        arrival.push_edge(cos_1);
        if let Some(rim) = self.roots[root].domain.rim(&first) {
            arrival.push_edge(rim);
            if rim.v <= 0.0 {
                arrival.visible = Visibility::Beyond;
            }
        }
        if !self.roots[root].domain.one_sided() {
            let facing = first.d.dot(&first.n);
            arrival.push_edge(if step.front { -facing } else { facing });
            // The domain's measure is unsigned; seen from the other side it goes on with the sign.
            if arrival.edges[1].v < 0.0 {
                arrival.weight = -arrival.weight;
                arrival.visible = Visibility::Beyond;
            }
        }
        Some(arrival)
    }

    /// A point of a letter that a chain traced near `at` met.
    fn hint(&self, parent: WordId, step: &Step, at: GridPoint) -> SurfacePoint {
        let near = self.words[parent.0 as usize].landings.near(step.target(), at);
        let met = near.and_then(|near| self.known(parent, near)?.next);
        met.map_or(step.hint, |hit| hit.anchor.point)
    }

    fn next_arrival(&mut self, parent: WordId, step: &Step, at: GridPoint) -> Option<Arrival> {
        let scene = self.scene;
        let surface = &scene.shape(step.shape).surface;
        let leg = self.depth(parent);
        self.departure(parent, at)?;
        let hint = self.hint(parent, step, at);
        let target = step.target();
        let is_met = self.met(parent, at) == Some(target);
        let before = self.departure(parent, at)?;
        let real = before.next.as_ref().filter(|_| is_met);
        let leaving = (before.anchor.shape == step.shape).then_some(&before.anchor.point);
        let meeting = meet(surface, step.primitive, step.front, &before.ray, real, leaving, &hint)?;
        let inside = meeting.apertures.iter().all(|e| e.v > 0.0);
        // What is met later does not stand in the way: on a line of contact the tracer may miss the
        // surface. What is met in the same place is its other side, or another piece of it.
        let along = (meeting.x.v - before.ray.o.v).dot(&before.ray.d.v);
        let blocker = before.next.as_ref().filter(|h| h.t < along * (1.0 - SAME_PLACE));
        let visible = match before.visible {
            Visibility::Free if real.is_some() => Visibility::Free,
            Visibility::Free if inside && blocker.is_some() => {
                Visibility::Blocked(blocker.map(|h| Blocker { shape: h.anchor.shape, leg }))
            }
            Visibility::Free => Visibility::Beyond,
            other => other,
        };
        let mut arrival = Arrival {
            anchor: Anchor { shape: step.shape, point: meeting.point },
            x: meeting.x,
            d: before.ray.d,
            n: meeting.n,
            first_normal: before.first_normal,
            weight: before.weight,
            first_direction: before.first_direction,
            throughput: before.throughput,
            radiance_scale: before.radiance_scale,
            edges: before.edges.clone(),
            visible,
        };
        for e in meeting.apertures {
            arrival.push_edge(e);
        }
        if !matches!(surface, Surface::Sphere(_) | Surface::Cylinder(_)) {
            let facing = arrival.d.dot(&arrival.n);
            arrival.push_edge(if step.front { -facing } else { facing });
        }
        Some(arrival)
    }
}
