//! Irradiance over the film: computed at the nodes of a quadtree of blocks of pixels, refined until
//! interpolation between them is as good as computing. Direct, indirect and specular light have a lattice
//! each, as a shadow's edge is no reason to compute caustics finely.
//!
//! A node is a point of the film; it keeps the diffuse surfaces that the eye sees there and their
//! irradiance. Between the corners of a block, irradiance on the same surface seen the same way is
//! interpolated; which surfaces are seen is never interpolated but asked of the tracer at every
//! sample. A block is split
//! - where its corners see different things and light on one of them is not steady around, down to
//!   pixels,
//! - where light beside an outline between two corners is not that at the corner, down to half a pixel,
//! - where radiance differs much between corners, where it bends between nodes in a row, or where a
//!   node that a neighbour already has on a common edge disagrees with the interpolation, down to
//!   half a pixel.
//!
//! The last rule follows a caustic or a shadow edge from block to block wherever it was found once.
//! Light that begins beside an outline, a narrow shadow of what hides the rest, is looked for there (`outline.rs`).
//! A feature that is narrower than the coarsest spacing and shorter than a few of them can be
//! missed. Nodes are pure functions of their place, and blocks are judged in rounds in a fixed
//! order: the result does not depend on the number of threads.

mod block;
mod outline;

use std::collections::{HashMap, HashSet};

use rayon::prelude::*;

use crate::geometry::Rgb;
use crate::trace::tree::Leaf;
use crate::transfer::{Control, Counts, Order};

use super::View;
use super::receiver::{Allowance, Part};
use block::{Block, COARSEST};
use outline::Side;

/// Units of the lattice's coordinates in a pixel: the finest nodes are half a pixel apart. A hard
/// edge of light is then smeared over half a pixel, less than by any filter.
pub(super) const UNITS: u32 = 2;

/// Level of blocks of one pixel, and of the finest blocks.
const PIXEL: u8 = 3;
const FINEST: u8 = 4;

/// The widest spacing of nodes is 4 pixels, or 8 on films of more columns than this: fine enough to
/// meet a caustic's edge somewhere along its length.
const LARGE_FILM: u32 = 960;

/// Contrast between corners above which a block of a level is split, in tolerances. Interpolation
/// errors go with the second difference, of which large first differences warn; below a pixel only
/// what would show as a jagged edge is worth splitting.
const CONTRAST: [f64; 4] = [10.0, 10.0, 12.0, 20.0];

/// Blocks below this level are looked at through the eyes of the meshes, at so many points a side, and split where
/// those differ by this part of all that shows.
const HINTED: u8 = 1;
const HINTS: u32 = 4;
const HINT: f64 = 0.05;

/// Contrast around a node, in tolerances, up to which light is steady enough to be taken for the same
/// as far as the outline that hides the next node.
const STEADY: f64 = 3.0;

/// Factor on the tolerance of indirect light: what interpolation does to light without edges shows less.
const SMOOTH: f64 = 2.0;

/// Part of the picture's mean radiance below which differences do not count: a fiftieth of white
/// paper's brightness is near black on a display.
const DARK: f64 = 0.02;

/// Cosine above which two normals belong to one face (18°).
const SAME_FACE: f64 = 0.95;

/// Nodes that are computed between two looks at the clock.
const BATCH: usize = 512;

/// A diffuse surface that is seen, and the light on it.
#[derive(Clone, Copy, Debug)]
struct Lit {
    leaf: Leaf,
    /// Irradiance [W/m²]: the lattice's part of it, and the part that was known before.
    irradiance: Rgb,
    known: Rgb,
}

impl Lit {
    /// What the lattice's part adds to the radiance at the eye [W/(m² sr)].
    fn radiance(&self) -> Rgb {
        self.leaf.radiance(self.irradiance)
    }
}

/// What was computed for one point of the film.
#[derive(Default)]
struct Node {
    lit: Vec<Lit>,
    counts: Counts,
    /// Receivers that missed their tolerance.
    unmet: u64,
    largest_error: f64,
}

impl Leaf {
    /// Radiance at the eye [W/(m² sr)] of an irradiance [W/m²]: E ρ/π.
    pub(super) fn radiance(&self, irradiance: Rgb) -> Rgb {
        irradiance * self.throughput * self.reflectance * std::f64::consts::FRAC_1_PI
    }

    /// Whether two rays see the same face in the same way.
    pub(super) fn same(&self, other: &Self) -> bool {
        self.path == other.path && self.normal.dot(&other.normal) > SAME_FACE
    }
}

/// One part of the irradiance over a film.
pub(super) struct Lattice {
    part: Part,
    /// Blocks below this level are always split.
    first: u8,
    nodes: HashMap<(u32, u32), Vec<Lit>>,
    /// Sides of blocks with an outline between their ends: whether light changes beside it.
    outlined: HashMap<Side, bool>,
    split: HashSet<Block>,
    /// Film in units.
    width: u32,
    height: u32,
    /// Differences of radiance below this count as equal [W/(m² sr)].
    pub dark: f64,
    /// Work of all receivers, how many there were, and how many missed their tolerance.
    pub counts: Counts,
    pub receivers: u64,
    pub unmet: u64,
    /// The largest estimated error of them [W/m²].
    pub largest_error: f64,
    /// Whether everything that should be split was.
    pub complete: bool,
}

impl Lattice {
    /// Computes the lattice of a view. Tolerances are relative to this part and the `known` ones together, or
    /// to all that shows at the same place of the film, or to what still counts there as dark.
    pub fn build(view: &View<'_>, part: Part, known: &[Self], control: &Control<'_>) -> Self {
        let mut lattice = Self {
            part,
            // Indirect light has no edges that could be missed, and where specular light has some, meshes may tell.
            first: match part {
                Part::Indirect => 0,
                _ if view.hint.is_some() => 0,
                _ => u8::from(view.width <= LARGE_FILM),
            },
            nodes: HashMap::new(),
            outlined: HashMap::new(),
            split: HashSet::new(),
            width: view.width * UNITS,
            height: view.height * UNITS,
            dark: 0.0,
            counts: Counts::default(),
            receivers: 0,
            unmet: 0,
            largest_error: 0.0,
            complete: true,
        };
        let tolerance = view.tolerance() * if part == Part::Indirect { SMOOTH } else { 1.0 };
        let (columns, rows) = (lattice.width.div_ceil(COARSEST), lattice.height.div_ceil(COARSEST));
        let mut pending: Vec<Block> =
            (0..rows).flat_map(|y| (0..columns).map(move |x| Block { level: 0, x, y })).collect();
        while !pending.is_empty() {
            pending.sort_unstable();
            pending.dedup();
            if !lattice.compute_corners(&pending, view, known, control) {
                lattice.complete = false;
                break;
            }
            if lattice.dark == 0.0 {
                lattice.dark = DARK * lattice.mean_radiance();
            }
            if part == Part::Direct && !lattice.look_beside(&pending, view, tolerance, control) {
                lattice.complete = false;
                break;
            }
            let splits: Vec<Block> = pending
                .par_iter()
                .copied()
                .filter(|b| lattice.must_split(b, tolerance) || lattice.is_hinted(b, view))
                .collect();
            pending = lattice.apply(splits);
        }
        lattice
    }

    /// Computes the nodes at the corners of blocks where they are missing; `false` if told to stop.
    fn compute_corners(
        &mut self,
        blocks: &[Block],
        view: &View<'_>,
        known: &[Self],
        control: &Control<'_>,
    ) -> bool {
        let mut missing: Vec<(u32, u32)> = blocks
            .iter()
            .flat_map(Block::corners)
            .filter(|at| !self.nodes.contains_key(at))
            .collect();
        missing.sort_unstable_by_key(|(x, y)| (*y, *x));
        missing.dedup();
        for (i, batch) in missing.chunks(BATCH).enumerate() {
            if (control.order)() != Order::Go {
                return false;
            }
            (control.progress)(self.part.stage(), (i * BATCH) as u64, missing.len() as u64);
            let computed: Vec<_> = batch
                .par_iter()
                .map(|(x, y)| {
                    let at = |units: u32| f64::from(units) / f64::from(UNITS);
                    let go = (control.order)() == Order::Go;
                    if go { self.node(view, known, at(*x), at(*y)) } else { None }
                })
                .collect();
            let mut whole = true;
            for (at, node) in batch.iter().zip(computed) {
                let Some(node) = node else {
                    whole = false;
                    continue;
                };
                self.counts += node.counts;
                self.receivers += node.lit.len() as u64;
                self.unmet += node.unmet;
                self.largest_error = self.largest_error.max(node.largest_error);
                self.nodes.insert(*at, node.lit);
            }
            if !whole {
                return false;
            }
        }
        true
    }

    /// The leaves seen at (x, y) of the film [pixels] with the light on them; `None` if the light was
    /// given up, as half of it would look like a dark spot.
    fn node(&self, view: &View<'_>, before: &[Self], x: f64, y: f64) -> Option<Node> {
        let mut node = Node::default();
        let leaves = view.sight(x, y).leaves;
        let known = |l: &Leaf| irradiance_of(before, x, y, l) + view.foreknown(l, self.part);
        let known: Vec<Rgb> = leaves.iter().map(known).collect();
        let dark = before.last().map_or(0.0, |l| l.dark);
        let allowance = Allowance::new(&leaves, &known, dark);
        for (leaf, known) in leaves.iter().zip(known) {
            let share = view.relative * allowance.share(leaf, known);
            let light = (view.light)(leaf, self.part, share);
            if light.stopped {
                return None;
            }
            node.counts += light.counts;
            node.unmet += u64::from(!light.met);
            node.largest_error = node.largest_error.max(light.error);
            node.lit.push(Lit { leaf: *leaf, irradiance: light.irradiance, known });
        }
        Some(node)
    }

    /// Mean radiance of the nodes, the largest channel counting [W/(m² sr)].
    fn mean_radiance(&self) -> f64 {
        // Summed in the order of the film: a hash map has none.
        let mut nodes: Vec<_> = self.nodes.iter().collect();
        nodes.sort_unstable_by_key(|(at, _)| **at);
        let sum: f64 = nodes.iter().map(|(_, node)| total(node).max()).sum();
        sum / nodes.len().max(1) as f64
    }

    fn exists(&self, block: &Block) -> bool {
        block.parent().is_none_or(|p| self.split.contains(&p))
    }

    fn on_film(&self, block: &Block) -> bool {
        let s = block.size();
        block.x * s < self.width && block.y * s < self.height
    }

    /// The neighbours on the film that share an edge.
    fn neighbours(&self, b: &Block) -> impl Iterator<Item = Block> + use<'_> {
        let b = *b;
        [(-1, 0), (1, 0), (0, -1), (0, 1)].into_iter().filter_map(move |(dx, dy)| {
            let block = Block {
                level: b.level,
                x: b.x.checked_add_signed(dx)?,
                y: b.y.checked_add_signed(dy)?,
            };
            self.on_film(&block).then_some(block)
        })
    }

    /// Splits blocks, and neighbours as far as needed to keep the sizes of neighbours within a factor
    /// of two. Returns what is to be judged next: the children, and neighbours that now have a
    /// node on their edge.
    fn apply(&mut self, mut splits: Vec<Block>) -> Vec<Block> {
        let mut next = Vec::new();
        while let Some(block) = splits.pop() {
            if let Some(parent) = block.parent().filter(|p| !self.split.contains(p)) {
                splits.extend([block, parent]);
                continue;
            }
            if !self.split.insert(block) {
                continue;
            }
            next.extend(block.children().into_iter().filter(|b| self.on_film(b)));
            let neighbours: Vec<Block> = self.neighbours(&block).collect();
            for neighbour in neighbours {
                if !self.exists(&neighbour) {
                    splits.extend(neighbour.parent());
                } else if !self.split.contains(&neighbour) {
                    next.push(neighbour);
                }
            }
        }
        next.retain(|b| !self.split.contains(b));
        next
    }

    fn must_split(&self, block: &Block, tolerance: f64) -> bool {
        if block.level < self.first {
            return true;
        }
        if block.level >= FINEST || self.split.contains(block) {
            return false;
        }
        let at = block.corners();
        let [Some(a), Some(b), Some(c), Some(d)] = at.map(|p| self.nodes.get(&p)) else {
            return false;
        };
        let corners = [a, b, c, d];
        let level = corners.iter().map(|n| total(n).max()).fold(0.0, f64::max) + self.dark;
        let small = tolerance * level;
        if block.sides().iter().any(|side| self.outlined.get(side) == Some(&true)) {
            return true;
        }
        let contrast = CONTRAST[usize::from(block.level)] * small;
        for (k, corner) in corners.iter().enumerate() {
            for lit in corner.iter().filter(|lit| lit.radiance().max() > small) {
                for other in corners.iter().enumerate().filter(|(j, _)| *j != k).map(|o| o.1) {
                    match find(other, &lit.leaf) {
                        None if block.level < PIXEL
                            && !self.steady(at[k], block.size(), lit, STEADY * small) =>
                        {
                            return true;
                        }
                        Some(o) if distance(lit.radiance(), o.radiance()) > contrast => {
                            return true;
                        }
                        _ => {}
                    }
                }
            }
        }
        [(0, 1), (2, 3), (0, 2), (1, 3)]
            .into_iter()
            .any(|(i, j)| self.bends(at[i], at[j], corners[i], corners[j], small))
    }

    /// Whether the meshes of the first pass show specular light in a block that its corners do not.
    fn is_hinted(&self, block: &Block, view: &View<'_>) -> bool {
        let Some(hint) = view.hint.filter(|_| self.part != Part::Indirect) else { return false };
        if block.level >= HINTED || self.split.contains(block) {
            return false;
        }
        let shown = |x: f64, y: f64| {
            let leaves = view.sight(x / f64::from(UNITS), y / f64::from(UNITS)).leaves;
            leaves.iter().fold(Rgb::BLACK, |sum, l| sum + l.radiance(hint(l)[self.part as usize]))
        };
        let (size, n) = (f64::from(block.size()), HINTS);
        let at = |i: u32, b: u32| (f64::from(b) + f64::from(i) / f64::from(n)) * size;
        let (mut low, mut high) = ([f64::INFINITY; 3], [0f64; 3]);
        for (i, j) in (0..=n).flat_map(|i| (0..=n).map(move |j| (i, j))) {
            let x = shown(at(i, block.x), at(j, block.y));
            let each = [0, 1, 2];
            (low, high) = (each.map(|i| low[i].min(x[i])), each.map(|i| high[i].max(x[i])));
        }
        let corners = block.corners().map(|p| self.nodes.get(&p).map_or(Rgb::BLACK, |n| total(n)));
        let level = corners.iter().map(Rgb::max).fold(0.0, f64::max) + self.dark;
        (0..3).any(|i| high[i] - low[i] > HINT * level)
    }

    /// Whether enough nodes around one see the same surface, and about the same light on it.
    fn steady(&self, at: (u32, u32), size: u32, lit: &Lit, allowed: f64) -> bool {
        let step = i64::from(size);
        let mut seen = 0;
        for (dx, dy) in [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)] {
            let place = |p: u32, d: i64| u32::try_from(i64::from(p) + d * step).ok();
            let Some(place) = place(at.0, dx).zip(place(at.1, dy)) else { continue };
            if let Some(other) = self.nodes.get(&place).and_then(|n| find(n, &lit.leaf)) {
                if distance(lit.radiance(), other.radiance()) > allowed {
                    return false;
                }
                seen += 1;
            }
        }
        // One alone could lie on the same thin stripe.
        seen >= 2
    }

    /// Whether the radiance of a surface seen at both ends of a block's side is not straight between
    /// them, as far as other nodes tell.
    fn bends(&self, p: (u32, u32), q: (u32, u32), a: &[Lit], b: &[Lit], small: f64) -> bool {
        let middle = ((p.0 + q.0) / 2, (p.1 + q.1) / 2);
        // A side of one unit has no middle.
        let middle = self.nodes.get(&middle).filter(|_| middle != p && middle != q);
        let beyond = |p: (u32, u32), q: (u32, u32)| {
            let at = ((2 * q.0).checked_sub(p.0)?, (2 * q.1).checked_sub(p.1)?);
            self.nodes.get(&at)
        };
        let (before, after) = (beyond(q, p), beyond(p, q));
        a.iter().any(|lit| {
            let Some(far) = find(b, &lit.leaf) else { return false };
            let (x, y) = (lit.radiance(), far.radiance());
            let at =
                |node: Option<&Vec<Lit>>| node.and_then(|n| find(n, &lit.leaf)).map(Lit::radiance);
            let in_middle = at(middle).is_some_and(|m| distance(m, (x + y) * 0.5) > 1.5 * small);
            // Half a step aside, a parabola is off its chord by an eighth of the second difference.
            let along = |m: Option<Rgb>, x: Rgb, y: Rgb| {
                m.is_some_and(|m| distance(m + y, x * 2.0) > 8.0 * small)
            };
            in_middle || along(at(before), x, y) || along(at(after), y, x)
        })
    }

    /// Whether the pixel (x, y) has nodes of its own inside.
    pub fn finer_than_pixel(&self, x: u32, y: u32) -> bool {
        self.split.contains(&Block { level: PIXEL, x, y })
    }

    /// This part of the irradiance at a leaf seen at (x, y) of the film [pixels]; `None` if no corner
    /// of the block there sees the same.
    pub fn irradiance(&self, x: f64, y: f64, leaf: &Leaf) -> Option<Rgb> {
        let (x, y) = (x * f64::from(UNITS), y * f64::from(UNITS));
        let mut block = Block { level: 0, x: 0, y: 0 };
        for level in 0..=FINEST {
            let size = f64::from(COARSEST >> level);
            block = Block { level, x: (x / size) as u32, y: (y / size) as u32 };
            if !self.split.contains(&block) {
                break;
            }
        }
        let size = f64::from(block.size());
        let (u, v) = (x / size - f64::from(block.x), y / size - f64::from(block.y));
        let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
        let mut sum = 0.0;
        let mut irradiance = Rgb::BLACK;
        for (at, weight) in block.corners().into_iter().zip(weights) {
            // A corner that alone sees the surface counts however far it is.
            let weight = weight.max(1e-9);
            if let Some(lit) = self.nodes.get(&at).and_then(|n| find(n, leaf)) {
                irradiance += lit.irradiance * weight;
                sum += weight;
            }
        }
        (sum > 0.0).then(|| irradiance * (1.0 / sum))
    }

    /// The part that it holds.
    pub fn part(&self) -> Part {
        self.part
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }
}

/// The irradiance at a leaf seen at (x, y) of the film [pixels], in all parts that lattices know of.
pub(super) fn irradiance_of(lattices: &[Lattice], x: f64, y: f64, leaf: &Leaf) -> Rgb {
    let known = lattices.iter().filter_map(|l| l.irradiance(x, y, leaf));
    known.fold(Rgb::BLACK, |sum, e| sum + e)
}

/// The leaf of a node that sees the same as another.
fn find<'n>(node: &'n [Lit], leaf: &Leaf) -> Option<&'n Lit> {
    node.iter().find(|lit| lit.leaf.same(leaf))
}

/// Radiance of all that is seen at a node, in the parts known so far.
fn total(node: &[Lit]) -> Rgb {
    node.iter().fold(Rgb::BLACK, |sum, lit| sum + lit.leaf.radiance(lit.irradiance + lit.known))
}

/// Largest difference of a channel.
fn distance(a: Rgb, b: Rgb) -> f64 {
    (a - b).map(f64::abs).max()
}
