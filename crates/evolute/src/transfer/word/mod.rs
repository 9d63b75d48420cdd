//! Words: the sequences of surfaces and events that chains from one receiver go through, as a tree
//! whose nodes share the legs that are already traced.

mod area;
mod known;
mod leg;

use std::collections::HashMap;

use arrayvec::ArrayVec;

use super::chain::{Departure, Event, Step, events};
use super::domain::{Domain, FirstPoint};
use super::grid::{GridHasher, GridPoint};
use super::landing::{Landings, Square, Target};
use super::part::Part;
use super::settings::{Counts, Receiver};
use super::store::Store;
use super::window::Window;
use crate::geometry::{Point3, Vector3};
use crate::scene::{Scene, ShapeId};
use crate::surface::{Surface, SurfacePoint};
use crate::trace::{Anchor, Tracer};

/// Index of a word in its tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
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
    departures: Store<Option<Departure>>,
    /// Their numbers by grid point.
    traced: HashMap<u64, u32, GridHasher>,
    discovered: Vec<Step>,
    children: Vec<WordId>,
    landings: Landings,
    /// Part of the domain that legal chains come from, as far as samples tell.
    area: f64,
    /// Level of the first grid.
    first_level: u32,
    /// Cells in which letters were searched for, as far as they were divided for it.
    scouted: Vec<Square>,
    /// Luminance of the brightest that its chains may come to [W/(m² sr)], where that is known.
    reach: Option<f64>,
    /// What the receiver sees through it, if it is all plane mirrors.
    window: Option<Box<Window>>,
}

/// The first leg at a grid point and what stands in it: shared by the events at the first surface.
type FirstLeg = Option<(FirstPoint, Option<ShapeId>)>;

struct Root<'s> {
    domain: Domain<'s>,
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
            self.roots.push(Root { domain, legs: HashMap::default() });
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
        // Chains that go on along a mirror are some of those before.
        let reach = match source {
            Source::After(parent) => {
                let before = &self.words[parent.0 as usize];
                before.reach.filter(|_| before.step.same_letter(&step))
            }
            Source::First(_) => None,
        };
        let before = match source {
            Source::After(parent) => self.words[parent.0 as usize].window.as_deref(),
            Source::First(_) => None,
        };
        let plane = before.is_some() || matches!(source, Source::First(_));
        let surface = &self.scene.shape(step.shape).surface;
        let window = plane
            .then(|| Window::of(surface, &step, before, &self.receiver))
            .flatten()
            .map(Box::new);
        self.words.push(Word {
            source,
            step,
            depth,
            grey,
            guessed,
            departures: Store::default(),
            traced: HashMap::default(),
            discovered: Vec::new(),
            children: Vec::new(),
            landings: Landings::default(),
            area: 1.0,
            first_level: 0,
            scouted: Vec::new(),
            reach,
            window,
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
    pub fn normal_cone(&self, word: WordId, cell: Square) -> f64 {
        match self.words[word.0 as usize].source {
            Source::After(parent) => self.normal_cone(parent, cell),
            Source::First(root) => self.roots[root].domain.normal_cone(cell),
        }
    }

    /// Direction of the first leg at a grid point, whether or not a chain goes on from there.
    pub fn first_direction(&mut self, word: WordId, at: GridPoint) -> Option<Vector3> {
        match self.words[word.0 as usize].source {
            Source::After(parent) => self.first_direction(parent, at),
            Source::First(root) => self.first_leg(root, at).as_ref().map(|(first, _)| first.d.v),
        }
    }

    /// The grid point of the domain nearest to a direction from the receiver; `None` where that is known only
    /// by a search.
    pub fn towards(&self, word: WordId, d: &Vector3) -> Option<GridPoint> {
        match self.words[word.0 as usize].source {
            Source::After(parent) => self.towards(parent, d),
            Source::First(root) => self.roots[root].domain.towards(d).map(GridPoint::nearest),
        }
    }

    /// The part of the domain in which directions from the receiver to a convex polygon lie; `None` where
    /// straight lines are not straight in the domain.
    pub fn part(&self, word: WordId, polygon: &[Point3]) -> Option<Part> {
        match self.words[word.0 as usize].source {
            Source::After(parent) => self.part(parent, polygon),
            Source::First(root) => {
                let Root { domain, .. } = &self.roots[root];
                if !domain.keeps_lines() {
                    return None;
                }
                let to = |x: &Point3| domain.towards(&(x - self.receiver.position));
                let corners = polygon.iter().map(|x| to(x).map(|(a, b)| [a, b]));
                corners.collect::<Option<Vec<_>>>().map(Part::new)
            }
        }
    }

    /// What the receiver sees through a word of plane mirrors.
    pub fn window(&self, word: WordId) -> Option<&Window> {
        self.words[word.0 as usize].window.as_deref()
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

    /// All words.
    pub fn ids(&self) -> impl Iterator<Item = WordId> + use<> {
        (0..self.words.len() as u32).map(WordId)
    }

    /// Chains of a word that are kept.
    pub fn chains(&self, word: WordId) -> u64 {
        self.words[word.0 as usize].traced.len() as u64
    }

    /// Forgets a word's departures; they are traced again when they are asked for.
    pub fn forget(&mut self, word: WordId) {
        let word = &mut self.words[word.0 as usize];
        (word.departures, word.traced) = Default::default();
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

    /// How often the word's last letter stands at its end in a row.
    pub fn run(&self, word: WordId) -> usize {
        let last = self.words[word.0 as usize].step;
        let mut at = Some(word);
        std::iter::from_fn(|| {
            let here = at?;
            at = self.parent(here);
            Some(self.words[here.0 as usize].step)
        })
        .take_while(|step| step.same_letter(&last))
        .count()
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
        let number = self.number(word, at);
        self.numbered(word, number)
    }

    /// The number of a word's departure at a grid point, traced if it was not before.
    pub fn number(&mut self, word: WordId, at: GridPoint) -> usize {
        if let Some(known) = self.words[word.0 as usize].traced.get(&at.key()) {
            return *known as usize;
        }
        let traced = self.trace(word, at);
        let word = &mut self.words[word.0 as usize];
        let number = word.departures.push(traced);
        word.traced.insert(at.key(), number as u32);
        number
    }

    /// The departure of that number.
    pub fn numbered(&self, word: WordId, number: usize) -> Option<&Departure> {
        self.words[word.0 as usize].departures[number].as_ref()
    }

    /// The departure at a grid point, if it was traced before.
    fn known(&self, word: WordId, at: GridPoint) -> Option<&Departure> {
        let number = *self.words[word.0 as usize].traced.get(&at.key())?;
        self.numbered(word, number as usize)
    }

    /// The departure at a grid point that the word before reaches by a legal chain; where that is not, this
    /// one is not either, and need not be traced.
    pub fn reached(&mut self, word: WordId, at: GridPoint) -> Option<&Departure> {
        let parent = self.parent(word);
        if parent.is_some_and(|parent| !self.is_legal(parent, at)) {
            return None;
        }
        self.departure(word, at)
    }

    /// Where the last letter of a word is.
    pub fn letter(&self, word: WordId) -> Target {
        self.words[word.0 as usize].step.target()
    }

    /// What happens at its last letter.
    pub fn event(&self, word: WordId) -> Event {
        self.words[word.0 as usize].step.event
    }

    /// Keeps the level of a word's first grid.
    pub fn set_first_level(&mut self, word: WordId, level: u32) {
        self.words[word.0 as usize].first_level = level;
    }
}
