//! Words: the sequences of surfaces and events that chains from one receiver go through, as a tree
//! whose nodes share the legs that are already traced.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

use arrayvec::ArrayVec;

use super::chain::{Arrival, Departure, Event, Step, Visibility, depart, events};
use super::domain::Domain;
use super::extension::{facet_of, is_faceted, meet};
use super::lamp::{outlined, part_of};
use super::landing::{Landings, Square, Target};
use super::settings::{Counts, Receiver};
use crate::geometry::Ray;
use crate::optics::{Dual, DualRay};
use crate::scene::{Scene, ShapeId};
use crate::surface::{Surface, SurfacePoint};
use crate::trace::{Anchor, Hit, Tracer};

/// Domains are resolved to this many binary digits: cells of level 14 may still bisect their sides
/// ten times.
pub const GRID_BITS: u32 = 24;

/// Two hits along a ray are in the same place when their distances differ by less than this share.
const SAME_PLACE: f64 = 1e-9;

/// A point of a domain on the finest dyadic grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GridPoint {
    /// a · 2^GRID_BITS.
    pub i: u32,
    /// b · 2^GRID_BITS.
    pub j: u32,
}

impl GridPoint {
    /// a and b in [0, 1].
    pub fn coordinates(&self) -> (f64, f64) {
        let unit = 1.0 / f64::from(1u32 << GRID_BITS);
        (f64::from(self.i) * unit, f64::from(self.j) * unit)
    }

    /// One number for both.
    pub fn key(&self) -> u64 {
        (u64::from(self.i) << 32) | u64::from(self.j)
    }
}

/// Index of a word in its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct WordId(pub u32);

#[derive(Clone, Copy, Debug)]
enum Source {
    /// The first surface, through a domain.
    First(usize),
    /// After another word.
    After(WordId),
}

/// A word and the departures already traced for it.
struct Word {
    source: Source,
    step: Step,
    depth: u32,
    grey: bool,
    /// Whether a later letter than the first is on a surface whose continuation is only iterated for.
    guessed: bool,
    departures: HashMap<u64, Option<Box<Departure>>, GridHasher>,
    discovered: Vec<Step>,
    children: Vec<WordId>,
    landings: Landings,
    /// Part of the domain that legal chains come from, as far as samples tell.
    area: f64,
    /// Level of the first grid.
    first_level: u32,
}

/// The first leg at a grid point and what stands in it: shared by the events at the first surface.
type FirstLeg = Option<(super::domain::FirstPoint, Option<ShapeId>)>;

struct Root<'s> {
    domain: Domain<'s>,
    /// Cones of normals by cell.
    cones: HashMap<u64, f64, GridHasher>,
    legs: HashMap<u64, FirstLeg, GridHasher>,
}

/// The words of one receiver.
pub struct Words<'s> {
    scene: &'s Scene,
    tracer: &'s Tracer<'s>,
    receiver: Receiver,
    contacts: ArrayVec<Anchor, 8>,
    roots: Vec<Root<'s>>,
    words: Vec<Word>,
    /// Landings that nobody has looked at yet.
    fresh: Vec<(WordId, Target, GridPoint)>,
    /// Work done so far.
    pub counts: Counts,
}

impl<'s> Words<'s> {
    /// No words yet.
    pub fn new(scene: &'s Scene, tracer: &'s Tracer<'s>, receiver: Receiver) -> Self {
        let contacts = tracer.contacts(&receiver.position);
        Self {
            scene,
            tracer,
            receiver,
            contacts,
            roots: Vec::new(),
            words: Vec::new(),
            fresh: Vec::new(),
            counts: Counts::default(),
        }
    }

    /// The scene.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// The tracer.
    pub fn tracer(&self) -> &'s Tracer<'s> {
        self.tracer
    }

    /// Whether the receiver lies on a shape.
    pub fn touches(&self, shape: ShapeId) -> bool {
        self.contacts.iter().any(|c| c.shape == shape)
    }

    /// Adds the words of one event each at `shape`; their ids.
    pub fn begin(&mut self, shape: ShapeId) -> Vec<WordId> {
        let scene = self.scene;
        let target = scene.shape(shape);
        let on_surface = self.contacts.iter().any(|c| c.shape == shape);
        // Whatever lies wholly behind the receiver sends nothing.
        let n = self.receiver.normal;
        let position = self.receiver.position;
        let bounds = target.surface.bounds();
        if bounds.corners().iter().all(|c| (c - position).dot(&n) <= 0.0) {
            return Vec::new();
        }
        let mut ids = Vec::new();
        for domain in Domain::of(&target.surface, &position, on_surface) {
            // One look tells the side of a one-sided domain, a grid the sides of another.
            let mut sides: ArrayVec<bool, 2> = ArrayVec::new();
            let probe = if domain.one_sided() { 3 } else { 8 };
            for (i, j) in (1..2 * probe).flat_map(|i| (1..2 * probe).map(move |j| (i, j))) {
                let (a, b) =
                    (f64::from(i) / f64::from(2 * probe), f64::from(j) / f64::from(2 * probe));
                let Some(p) = domain.at(a, b) else { continue };
                let front = p.d.v.dot(&p.n.v) < 0.0;
                if !sides.contains(&front) {
                    sides.push(front);
                }
                if sides.len() == 2 || domain.one_sided() {
                    break;
                }
            }
            let root = self.roots.len();
            let primitive = matches!(target.surface, Surface::Mesh(_)).then(|| domain.primitive());
            for front in sides {
                for event in events(&target.material, front) {
                    let hint =
                        SurfacePoint { primitive: domain.primitive(), p: 0.5, q: 0.5, x: position };
                    let step = Step { shape, primitive, front, event, hint };
                    ids.push(self.add(Source::First(root), step, 1, true));
                }
            }
            self.roots.push(Root { domain, cones: HashMap::default(), legs: HashMap::default() });
        }
        ids
    }

    /// Adds the words that continue `word` by the letters its chains were seen to meet and that are
    /// not there yet; their ids.
    pub fn continue_word(&mut self, word: WordId) -> Vec<WordId> {
        let steps = std::mem::take(&mut self.words[word.0 as usize].discovered);
        let (depth, grey) = {
            let w = &self.words[word.0 as usize];
            (w.depth + 1, w.grey)
        };
        let mut ids = Vec::new();
        for step in steps {
            let known = self.words[word.0 as usize]
                .children
                .iter()
                .any(|child| self.words[child.0 as usize].step.same_letter(&step));
            if !known {
                ids.push(self.add(Source::After(word), step, depth, grey));
            }
        }
        ids
    }

    fn add(&mut self, source: Source, step: Step, depth: u32, grey: bool) -> WordId {
        let material = &self.scene.shape(step.shape).material;
        let side = if step.front { &material.front } else { &material.back };
        let same = |c: &crate::geometry::Rgb| c[0] == c[1] && c[1] == c[2];
        let grey =
            grey && side.mirror.as_ref().is_none_or(|m| {
                same(&m.weight) && m.conductor.as_ref().is_none_or(|(e, k)| same(e) && same(k))
            }) && material
                .dielectric
                .as_ref()
                .is_none_or(|d| same(&d.reflectance) && same(&d.transmittance));
        let guessed = match source {
            Source::First(_) => false,
            Source::After(parent) => {
                let formula =
                    matches!(self.scene.shape(step.shape).surface, Surface::Parametric(_));
                formula || self.words[parent.0 as usize].guessed
            }
        };
        self.words.push(Word {
            source,
            step,
            depth,
            grey,
            guessed,
            departures: HashMap::default(),
            discovered: Vec::new(),
            children: Vec::new(),
            landings: Landings::default(),
            area: 1.0,
            first_level: 0,
        });
        let id = WordId(self.words.len() as u32 - 1);
        if let Source::After(parent) = source {
            self.words[parent.0 as usize].children.push(id);
        }
        id
    }

    /// Whose words they are.
    pub fn receiver(&self) -> Receiver {
        self.receiver
    }

    /// Half the opening [rad] of a cone that certainly holds all normals of the first surface in a cell.
    pub fn normal_cone(&mut self, word: WordId, cell: Square) -> f64 {
        match self.words[word.0 as usize].source {
            Source::After(parent) => self.normal_cone(parent, cell),
            Source::First(root) => {
                let Root { domain, cones, .. } = &mut self.roots[root];
                let (from, side) = (cell.corner().coordinates(), cell.size());
                *cones.entry(cell.key()).or_insert_with(|| {
                    domain.normal_cone([from.0, from.0 + side], [from.1, from.1 + side])
                })
            }
        }
    }

    /// The word before the last letter.
    pub fn parent(&self, word: WordId) -> Option<WordId> {
        match self.words[word.0 as usize].source {
            Source::First(_) => None,
            Source::After(parent) => Some(parent),
        }
    }

    /// Whether the word's chain exists at a grid point, is free, and inside all borders.
    pub fn is_legal(&mut self, word: WordId, at: GridPoint) -> bool {
        self.departure(word, at).is_some_and(Departure::is_legal)
    }

    /// Whether a legal chain of the word before meets the last letter at a grid point and is totally
    /// reflected there instead of transmitted.
    pub fn is_total(&mut self, word: WordId, at: GridPoint) -> bool {
        let Step { event: Event::Transmit, .. } = self.words[word.0 as usize].step else {
            return false;
        };
        let Some(parent) = self.parent(word) else { return false };
        if !self.is_legal(parent, at) || self.departure(word, at).is_some() {
            return false;
        }
        self.met(parent, at) == Some(self.letter(word))
    }

    /// What a chain of a word meets as a letter that may follow.
    fn met(&mut self, word: WordId, at: GridPoint) -> Option<Target> {
        let scene = self.scene;
        let departure = self.departure(word, at)?;
        let hit = departure.next.as_ref()?;
        let surface = &scene.shape(hit.anchor.shape).surface;
        let local = surface.local(&hit.anchor.point)?;
        let front = departure.ray.d.v.dot(&local.ng) < 0.0;
        let primitive = facet(surface, &hit.anchor);
        Some(Target { shape: hit.anchor.shape, primitive, front, lamp: false })
    }

    /// All words.
    pub fn ids(&self) -> impl Iterator<Item = WordId> + use<> {
        (0..self.words.len() as u32).map(WordId)
    }

    /// Chains of a word that are kept.
    pub fn chains(&self, word: WordId) -> u64 {
        self.words[word.0 as usize].departures.len() as u64
    }

    /// Forgets a word's departures; they are traced again when they are asked for.
    pub fn forget(&mut self, word: WordId) {
        self.words[word.0 as usize].departures = HashMap::default();
    }

    /// Interactions of a word.
    pub fn depth(&self, word: WordId) -> u32 {
        self.words[word.0 as usize].depth
    }

    /// Whether its throughput is the same in all channels.
    pub fn is_grey(&self, word: WordId) -> bool {
        self.words[word.0 as usize].grey
    }

    /// Whether a chain of the word that is not found at a grid point may exist beside it all the same: not
    /// at the limb of a ball, but where an iteration for a formula's surface fails.
    pub fn is_guessed(&self, word: WordId) -> bool {
        self.words[word.0 as usize].guessed
    }

    /// Whether chains of the word were seen to meet further specular surfaces.
    pub fn has_discoveries(&self, word: WordId) -> bool {
        !self.words[word.0 as usize].discovered.is_empty()
    }

    /// The letters of a word, first surface first.
    pub fn letters(&self, word: WordId) -> Vec<Step> {
        let w = &self.words[word.0 as usize];
        let mut list = match w.source {
            Source::First(_) => Vec::new(),
            Source::After(parent) => self.letters(parent),
        };
        list.push(w.step);
        list
    }

    /// The departure of a word's chain at a grid point; `None` where the chain does not exist.
    pub fn departure(&mut self, word: WordId, at: GridPoint) -> Option<&Departure> {
        if !self.words[word.0 as usize].departures.contains_key(&at.key()) {
            let traced = self.trace(word, at).map(Box::new);
            self.words[word.0 as usize].departures.insert(at.key(), traced);
        }
        self.words[word.0 as usize].departures.get(&at.key())?.as_deref()
    }

    fn trace(&mut self, word: WordId, at: GridPoint) -> Option<Departure> {
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
            if let Some(hit) = next {
                let legal = departure.edges.iter().all(|e| e.v > 0.0);
                self.discover(word, at, &departure.ray, &hit, legal);
            }
        }
        Some(departure)
    }

    /// Notes which letters could follow, and where a legal chain landed.
    fn discover(&mut self, word: WordId, at: GridPoint, ray: &DualRay, hit: &Hit, legal: bool) {
        let shape = self.scene.shape(hit.anchor.shape);
        let (specular, lamp) = (shape.material.is_specular(), !shape.radiance.is_black());
        if !specular && !lamp {
            return;
        }
        let Some(local) = shape.surface.local(&hit.anchor.point) else { return };
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
            let primitive = facet(&shape.surface, &hit.anchor);
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
    }

    /// The landings that were not asked for before: word, what was met, from where.
    pub fn take_fresh(&mut self) -> Vec<(WordId, Target, GridPoint)> {
        std::mem::take(&mut self.fresh)
    }

    /// The words after `word` whose last letter is at the target.
    pub fn children_at(&self, word: WordId, target: Target) -> impl Iterator<Item = WordId> + '_ {
        let children = &self.words[word.0 as usize].children;
        children.iter().copied().filter(move |child| self.letter(*child) == target)
    }

    /// Where the last letter of a word is.
    fn letter(&self, word: WordId) -> Target {
        self.words[word.0 as usize].step.target()
    }

    /// Whether a legal chain of the word before was seen to meet the word's last letter from inside
    /// the cell.
    pub fn is_met_from(&self, word: WordId, cell: Square) -> bool {
        self.parent(word).is_some_and(|parent| {
            self.words[parent.0 as usize].landings.any(self.letter(word), cell)
        })
    }

    /// A few points of the cell from which the word's last letter or the lamp was seen to be met.
    pub fn known_from(&self, word: WordId, lamp: Target, cell: Square) -> Vec<GridPoint> {
        const FEW: usize = 4;
        let mut points = self.words[word.0 as usize].landings.from(lamp, cell, FEW);
        if let Some(parent) = self.parent(word) {
            let landings = &self.words[parent.0 as usize].landings;
            points.extend(landings.from(self.letter(word), cell, FEW));
        }
        points
    }

    /// Whether a legal chain of the word was seen to reach a lamp from inside the cell.
    pub fn reaches_from(&self, word: WordId, lamp: Target, cell: Square) -> bool {
        self.words[word.0 as usize].landings.any(lamp, cell)
    }

    /// Up to `count` points at which legal chains of the word before met the word's last letter.
    pub fn met_at(&self, word: WordId, count: usize) -> Vec<GridPoint> {
        self.parent(word).map_or_else(Vec::new, |parent| {
            self.words[parent.0 as usize].landings.some(self.letter(word), count)
        })
    }

    /// Keeps the level of a word's first grid.
    pub fn set_first_level(&mut self, word: WordId, level: u32) {
        self.words[word.0 as usize].first_level = level;
    }

    /// How much of the domain legal chains seem to come from.
    pub fn area(&self, word: WordId) -> f64 {
        self.words[word.0 as usize].area
    }

    /// Keeps how much of the domain legal chains come from: `sampled` for a first letter, and else what
    /// the landings of the word before say. Letters that share a parent share its chains.
    pub fn set_area(&mut self, word: WordId, sampled: f64) -> f64 {
        let area = self.parent(word).map_or(sampled, |parent| {
            let parent = &self.words[parent.0 as usize];
            let (regular, share) = parent.landings.share(self.letter(word), parent.first_level);
            let grid = f64::from(((1u32 << parent.first_level) + 1).pow(2));
            if regular > 0 {
                regular as f64 / grid
            } else {
                // An island between the grid's points is no larger than one point's share.
                share * parent.area.min(1.0 / grid)
            }
        });
        self.words[word.0 as usize].area = area;
        area
    }

    fn first_arrival(&mut self, root: usize, step: &Step, at: GridPoint) -> Option<Arrival> {
        let (position, normal) = (self.receiver.position, self.receiver.normal);
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
        let (first, blocker) = (*self.roots[root].legs.get(&at.key())?)?;
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
            visible: blocker.map_or(Visibility::Free, |b| Visibility::Blocked(Some(b))),
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
        let parent = &self.words[parent.0 as usize];
        let near = parent.landings.near(step.target(), at);
        let met = near.and_then(|near| parent.departures.get(&near.key())?.as_ref()?.next);
        met.map_or(step.hint, |hit| hit.anchor.point)
    }

    fn next_arrival(&mut self, parent: WordId, step: &Step, at: GridPoint) -> Option<Arrival> {
        let scene = self.scene;
        let surface = &scene.shape(step.shape).surface;
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
                Visibility::Blocked(blocker.map(|h| h.anchor.shape))
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

/// The triangle, if each triangle of the surface is a mirror of its own.
fn facet(surface: &Surface, anchor: &Anchor) -> Option<u32> {
    match surface {
        Surface::Mesh(m) if is_faceted(m) => Some(facet_of(m, anchor.point.primitive).id),
        _ => None,
    }
}

/// Multiplies grid keys by an odd constant (2⁶⁴ over the golden ratio) and folds; the map is only
/// ever asked for single keys, so its order never shows.
#[derive(Default)]
pub struct GridHash(u64);

impl Hasher for GridHash {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for b in bytes {
            self.write_u64(u64::from(*b));
        }
    }
    fn write_u64(&mut self, key: u64) {
        let mixed = (self.0 ^ key).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

/// Builds hashers of grid keys.
pub type GridHasher = BuildHasherDefault<GridHash>;
