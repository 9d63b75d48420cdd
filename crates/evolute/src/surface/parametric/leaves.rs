//! The pieces into which a surface is cut before any ray comes, and the tree of boxes over them.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

use super::evaluate::Evaluator;
use super::patch::{Cell, Patch};
use crate::geometry::Aabb;
use crate::surface::SurfaceError;

/// Share of hitting rays that may be left to splitting on the fly. A ray that splits costs some ten
/// that do not; at a fiftieth that is a fifth of the whole, and more leaves would cost as much in
/// memory that is not in the cache.
const UNDECIDED_SHARE: f64 = 0.02;

/// Most leaves: 16 MB of them. Rougher surfaces split more on the fly.
const MAX_LEAVES: usize = 32_768;

/// Most cells looked at to prove that positions are finite. Formulas that are finite everywhere need
/// one or a few; those that touch the border of a domain are never proved there and end as samples.
const MAX_FINITE_CELLS: usize = 4_096;

/// Leaves and a tree over them.
#[derive(Clone, Debug)]
pub(super) struct Leaves {
    pub patches: Vec<Patch>,
    nodes: Vec<Node>,
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Aabb,
    /// Inner node: its two children. Leaf: the patch.
    kind: NodeKind,
}

#[derive(Clone, Copy, Debug)]
enum NodeKind {
    Inner([u32; 2]),
    Leaf(u32),
}

/// A leaf waiting to be split, worst first.
struct Waiting {
    /// Area times the share of undecided rays [m²].
    cost: f64,
    node: usize,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        // The older node first among equals, so that the order is one.
        self.cost.total_cmp(&other.cost).then(other.node.cmp(&self.node))
    }
}
impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Waiting {}

impl Leaves {
    /// Cuts the domain until only few rays are left undecided.
    pub fn new(evaluator: &Evaluator) -> Result<Self, SurfaceError> {
        check_finite(evaluator)?;
        let root = Patch::new(evaluator, Cell::DOMAIN);
        let mut build = Build { nodes: Vec::new(), heap: BinaryHeap::new() };
        build.add(root);
        let (mut leaf_count, mut undecided, mut area) = (1usize, 0.0, 0.0);
        if let Some((p, _)) = build.nodes.first() {
            undecided = cost(p);
            area = p.area();
        }
        while leaf_count < MAX_LEAVES {
            let Some(Waiting { cost: worst, node }) = build.heap.pop() else { break };
            let enough = worst < f64::MAX && undecided <= UNDECIDED_SHARE * area;
            if enough {
                break;
            }
            let parent = &build.nodes[node].0;
            if is_point(parent) {
                continue; // stays undecided, and in the sum
            }
            let axis = parent.split_axis();
            let parts = parent.cell.split(axis).map(|c| Patch::new(evaluator, c));
            undecided += parts.iter().map(cost).sum::<f64>() - cost(parent);
            area += parts.iter().map(Patch::area).sum::<f64>() - parent.area();
            let children = parts.map(|p| build.add(p));
            build.nodes[node].1 = Some(children);
            leaf_count += 1;
            if leaf_count % 256 == 0 {
                // Running sums drift; once in a while they are made anew.
                let leaves = || build.nodes.iter().filter(|n| n.1.is_none()).map(|n| &n.0);
                undecided = leaves().map(cost).sum();
                area = leaves().map(Patch::area).sum();
            }
        }
        build.finish()
    }

    /// The box around everything.
    pub fn bounds(&self) -> Aabb {
        self.nodes.first().map_or(Aabb::EMPTY, |n| n.bounds)
    }

    /// Calls `visit` with every leaf whose box `enter` accepts, as all boxes above it.
    pub fn for_each(&self, mut enter: impl FnMut(&Aabb) -> bool, mut visit: impl FnMut(usize)) {
        // The tree's depth is at most the halvings of both parameters in double precision.
        let mut stack = arrayvec::ArrayVec::<u32, 256>::new();
        let _ = stack.try_push(0);
        while let Some(i) = stack.pop() {
            let Some(node) = self.nodes.get(i as usize) else { continue };
            if !enter(&node.bounds) {
                continue;
            }
            match node.kind {
                NodeKind::Leaf(patch) => visit(patch as usize),
                NodeKind::Inner([a, b]) => {
                    let _ = stack.try_push(b);
                    let _ = stack.try_push(a);
                }
            }
        }
    }
}

/// Area times the share of undecided rays; what is not bounded comes first.
fn cost(p: &Patch) -> f64 {
    let cost = p.area() * p.undecided_share();
    if cost.is_finite() && p.is_bounded() { cost } else { f64::MAX }
}

/// Whether a piece is too small to be worth splitting beforehand: less than a millionth of its reach,
/// so that it matters to a 10⁻¹² part of the rays.
fn is_point(p: &Patch) -> bool {
    let reach = p.jet.x.coords.amax();
    p.cell.half.iter().any(|h| *h < 1e-9) || p.extent() < 1e-6 * reach.max(f64::MIN_POSITIVE)
}

struct Build {
    /// Patches and, when they were split, their parts. Parts come after their wholes.
    nodes: Vec<(Patch, Option<[usize; 2]>)>,
    heap: BinaryHeap<Waiting>,
}

impl Build {
    fn add(&mut self, patch: Patch) -> usize {
        let node = self.nodes.len();
        self.heap.push(Waiting { cost: cost(&patch), node });
        self.nodes.push((patch, None));
        node
    }

    fn finish(self) -> Result<Leaves, SurfaceError> {
        let mut nodes: Vec<Node> = Vec::with_capacity(self.nodes.len());
        let mut patches = Vec::new();
        for (patch, children) in self.nodes {
            let kind = match children {
                Some(c) => NodeKind::Inner(c.map(|i| i as u32)),
                None => {
                    patches.push(patch.clone());
                    NodeKind::Leaf((patches.len() - 1) as u32)
                }
            };
            nodes.push(Node { bounds: patch.bounds, kind });
        }
        // Parts bound better than the whole.
        for i in (0..nodes.len()).rev() {
            if let NodeKind::Inner([a, b]) = nodes[i].kind {
                nodes[i].bounds = nodes[a as usize].bounds.union(&nodes[b as usize].bounds);
            }
        }
        if let Some(p) = patches.iter().find(|p| !p.is_bounded()) {
            let [s, t] = p.cell.centre;
            return Err(SurfaceError::Unbounded { s, t });
        }
        Ok(Leaves { patches, nodes })
    }
}

/// Whether positions are finite all over the domain: by intervals, and where these cannot decide (at
/// the border of a function's domain), by samples.
fn check_finite(evaluator: &Evaluator) -> Result<(), SurfaceError> {
    // Breadth first, so that the budget is spent evenly.
    let mut cells = VecDeque::from([Cell::DOMAIN]);
    let mut seen = 0;
    while let Some(cell) = cells.pop_front() {
        seen += 1;
        if evaluator.is_finite_on(cell.intervals()) {
            continue;
        }
        let [s, t] = cell.centre;
        for i in 0..9 {
            let s = s + cell.half[0] * f64::from(i % 3 - 1);
            let t = t + cell.half[1] * f64::from(i / 3 - 1);
            let x = evaluator.position(s, t);
            if x.iter().any(|x| !x.is_finite()) {
                return Err(SurfaceError::Undefined { s, t, x: x.coords.into() });
            }
        }
        // Halves across the parameter that helps more; of equals, across the longer side. Trouble along
        // a side or a line of constant s or t is boxed in by one small cell a halving.
        let proved = |axis: usize| {
            cell.split(axis).iter().filter(|c| evaluator.is_finite_on(c.intervals())).count()
        };
        let axis = match proved(0).cmp(&proved(1)) {
            Ordering::Greater => 0,
            Ordering::Less => 1,
            Ordering::Equal => usize::from(cell.half[1] > cell.half[0]),
        };
        // Halved further the ends of a cell are no longer different numbers.
        let divisible = cell.half[axis] > 4.0 * f64::EPSILON;
        if divisible && seen + cells.len() < MAX_FINITE_CELLS {
            cells.extend(cell.split(axis));
        } else if evaluator.position_box(cell.intervals()).iter().any(|x| !x.is_bounded()) {
            return Err(SurfaceError::Unbounded { s, t });
        }
    }
    Ok(())
}
