//! A hierarchy of boxes, eight to a node, over any primitives.
//!
//! Built as a binary tree by `obvhs` (parallel locally-ordered clustering, Meister & Bittner 2018)
//! and collapsed to eight children a node. Boxes are single precision in a frame in which the scene
//! fills [−1, 1]³, so that neither a scene's scale nor its place matters. They are rounded outward and
//! the slab test is arranged so that rounding can only let a ray in, never keep it out (Woop, Benthin
//! & Wald, "Watertight Ray/Triangle Intersection", JCGT 2013, section 3.2, after Ize): a ray that meets
//! a primitive in double precision always reaches its leaf.

use crate::geometry::{Aabb, Point3, Ray, Vector3};
use arrayvec::ArrayVec;
use prefetch_index::prefetch_index;
use wide::f32x8;

/// At most this many triangles share a leaf: measured on 500,000 triangles, 6 to
/// 8 are equally fast, 4 a sixth slower: nodes are what misses the caches.
pub(super) const LEAF_SIZE: u32 = 8;

/// Costs of visiting an inner node and a leaf of some triangles, in the same unit: measured where all
/// fits the caches.
const NODE_COST: f32 = 1.0;
fn leaf_cost(count: u32) -> f32 {
    0.8 + 0.3 * count as f32
}

/// Children as 32 bits: an inner node's index, or with [`LEAF`] a class (one bit), a count less one
/// (three bits) and a leaf's number.
const LEAF: u32 = 1 << 31;
const CLASS: u32 = 1 << 30;
const COUNT_SHIFT: u32 = 27;
const NUMBER: u32 = (1 << COUNT_SHIFT) - 1;

/// Boxes are also grown by 2⁻⁴⁰ of the scene, so that a ray that runs exactly in a box's face, with a
/// component of its direction replaced by [`LEAST_DIRECTION`], stays inside.
const GROWTH: f32 = 1.0 / (1u64 << 40) as f32;
/// The least size of a direction's component: turns no ray by more than 2⁻⁶⁰ rad, and keeps
/// reciprocals finite.
const LEAST_DIRECTION: f64 = 1.0 / (1u64 << 60) as f64;

/// A node: bounds of its children and what they are. Missing children have an inverted infinite box.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Node {
    /// `planes[axis][0]` are lower, `planes[axis][1]` upper bounds.
    planes: [[f32x8; 2]; 3],
    children: [u32; 8],
}

/// Primitives of one leaf, all of one class.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    pub class: usize,
    /// The leaf's number among those of its class, or what [`Hierarchy::renumber`] made of it. Its
    /// primitives are [`Hierarchy::order`]`[class][starts[class][number]..][..count]`.
    pub number: usize,
    pub count: usize,
}

impl Leaf {
    fn of(child: u32) -> Self {
        Self {
            class: usize::from(child & CLASS != 0),
            number: (child & NUMBER) as usize,
            count: ((child & !(LEAF | CLASS)) >> COUNT_SHIFT) as usize + 1,
        }
    }

    fn child(self) -> u32 {
        LEAF | (self.class as u32 * CLASS)
            | ((self.count as u32 - 1) << COUNT_SHIFT)
            | self.number as u32
    }
}

/// The hierarchy. Primitives are numbered by the caller, in two classes: those of class 0 share leaves.
#[derive(Clone, Debug)]
pub(super) struct Hierarchy {
    nodes: Vec<Node>,
    /// The root as a child; `None` without primitives.
    root: Option<u32>,
    /// For each class, the caller's numbers in the order in which leaves refer to them.
    pub order: [Vec<u32>; 2],
    /// For each class, where in `order` each leaf begins.
    pub starts: [Vec<u32>; 2],
    /// local = (world − centre) · scale lies in [−1, 1]³; scale is a power of two.
    centre: Point3,
    scale: f64,
    pub bounds: Aabb,
}

/// The least single not below `x`, and the greatest not above.
fn up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}
fn down(x: f64) -> f32 {
    -up(-x)
}

/// A stack that allocates only for hierarchies far deeper than any that was seen.
struct Stack {
    fast: ArrayVec<(f32, u32), 192>,
    spill: Vec<(f32, u32)>,
}

impl Stack {
    fn new() -> Self {
        Self { fast: ArrayVec::new(), spill: Vec::new() }
    }

    fn push(&mut self, entry: (f32, u32)) {
        if self.fast.try_push(entry).is_err() {
            self.spill.push(entry);
        }
    }

    fn pop(&mut self) -> Option<(f32, u32)> {
        if self.spill.is_empty() { self.fast.pop() } else { self.spill.pop() }
    }
}

impl Hierarchy {
    /// Over `boxes` (finite, world frame [m]); `class` of each is 0 (small and alike: triangles) or 1.
    pub fn new(boxes: &[Aabb], class: impl Fn(u32) -> usize) -> Self {
        let bounds = boxes.iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        let centre = if boxes.is_empty() { Point3::origin() } else { bounds.centre() };
        let half = 0.5 * bounds.extent().amax();
        // A scene of one point has any scale.
        let half = if half.is_finite() && half > f64::MIN_POSITIVE { half } else { 1.0 };
        let mut this = Self {
            nodes: Vec::new(),
            root: None,
            order: [Vec::new(), Vec::new()],
            starts: [Vec::new(), Vec::new()],
            centre,
            scale: power_of_two_below(0.99 / half),
            bounds,
        };
        let local: Vec<[[f32; 3]; 2]> = boxes.iter().map(|b| this.local_box(b)).collect();
        let boxed: Vec<obvhs::aabb::Aabb> =
            local.iter().map(|b| obvhs::aabb::Aabb::new(b[0].into(), b[1].into())).collect();
        this.root = match boxed.len() {
            0 => None,
            1 => Some(this.leaf(class(0), &[0])),
            n => {
                let mut tree = obvhs::ploc::PlocBuilder::with_capacity(n).build(
                    // Presets of obvhs's "slow" build: the widest search, and reinsertion of a fifth
                    // of the nodes; half a second for 500,000 triangles.
                    obvhs::ploc::PlocSearchDistance::High,
                    &boxed,
                    (0..n as u32).collect(),
                    obvhs::ploc::SortPrecision::U64,
                    2,
                );
                obvhs::bvh2::reinsertion::ReinsertionOptimizer::default().run(&mut tree, 0.2, None);
                Some(this.collapse(&tree, &class))
            }
        };
        this
    }

    /// Gives the leaves of class 0 other numbers.
    pub fn renumber(&mut self, numbers: &[u32]) {
        let renumber = |child: &mut u32| {
            if *child & (LEAF | CLASS) == LEAF {
                let old = (*child & NUMBER) as usize;
                *child = *child & !NUMBER | numbers.get(old).map_or(0, |n| n & NUMBER);
            }
        };
        self.nodes.iter_mut().flat_map(|n| &mut n.children).for_each(renumber);
        self.root.iter_mut().for_each(renumber);
    }

    /// In the frame in which the scene fills [−1, 1]³.
    fn local(&self, p: &Point3) -> Vector3 {
        (p - self.centre) * self.scale
    }

    /// A box in the local frame, rounded outward and grown by [`GROWTH`].
    fn local_box(&self, b: &Aabb) -> [[f32; 3]; 2] {
        let (min, max) = (self.local(&b.min), self.local(&b.max));
        [
            std::array::from_fn(|i| (down(min[i]) - GROWTH).next_down()),
            std::array::from_fn(|i| (up(max[i]) + GROWTH).next_up()),
        ]
    }

    /// Appends a leaf and returns it as a child.
    fn leaf(&mut self, class: usize, primitives: &[u32]) -> u32 {
        let number = self.starts[class].len();
        self.starts[class].push(self.order[class].len() as u32);
        self.order[class].extend_from_slice(primitives);
        Leaf { class, number, count: primitives.len() }.child()
    }

    /// The binary tree with eight children a node, such that the expected cost of a random ray (surface
    /// area heuristic) is least: `cost[i]` of a binary node is that of its subtree as at most i + 1
    /// children of one wide node (Ylitie, Karras & Laine, "Efficient Incoherent Ray Traversal on GPUs
    /// Through Compressed Wide BVHs", HPG 2017, section 3.1).
    fn collapse(&mut self, tree: &obvhs::bvh2::Bvh2, class: &impl Fn(u32) -> usize) -> u32 {
        let nodes = &tree.nodes;
        // Parents before children.
        let mut preorder = vec![0usize];
        let mut i = 0;
        while i < preorder.len() {
            let node = &nodes[preorder[i]];
            if !node.is_leaf() {
                let first = node.first_index as usize;
                preorder.extend([first, first + 1]);
            }
            i += 1;
        }
        // How many primitives are below each node; more than a leaf holds if they are not of class 0.
        let mut below = vec![0u32; nodes.len()];
        let mut cost = vec![[0f32; 8]; nodes.len()];
        for &i in preorder.iter().rev() {
            let node = &nodes[i];
            let area = node.aabb().half_area();
            if node.is_leaf() {
                below[i] = match class(tree.primitive_indices[node.first_index as usize]) {
                    0 => node.prim_count,
                    _ => u32::MAX,
                };
                cost[i] = [area * leaf_cost(1); 8];
                continue;
            }
            let first = node.first_index as usize;
            below[i] = below[first].saturating_add(below[first + 1]);
            let shared = |children: usize| {
                let shares =
                    (1..children).map(|k| cost[first][k - 1] + cost[first + 1][children - k - 1]);
                shares.fold(f32::INFINITY, f32::min)
            };
            let mut costs = [0.0; 8];
            let wide = area * NODE_COST + shared(8);
            costs[0] =
                if below[i] <= LEAF_SIZE { wide.min(area * leaf_cost(below[i])) } else { wide };
            for children in 2..=8 {
                costs[children - 1] = shared(children).min(costs[children - 2]);
            }
            cost[i] = costs;
        }
        let is_leaf = |i: usize| {
            nodes[i].is_leaf()
                || below[i] <= LEAF_SIZE
                    && cost[i][0] >= nodes[i].aabb().half_area() * leaf_cost(below[i])
        };
        // (binary node, where its eight-wide counterpart is to be noted)
        let mut waiting: Vec<(usize, Option<(usize, usize)>)> = vec![(0, None)];
        let mut root = 0;
        while let Some((binary, place)) = waiting.pop() {
            let child = if is_leaf(binary) {
                let mut primitives: ArrayVec<u32, { LEAF_SIZE as usize }> = ArrayVec::new();
                let mut inside: ArrayVec<usize, { LEAF_SIZE as usize }> = ArrayVec::new();
                inside.push(binary);
                while let Some(i) = inside.pop() {
                    let (node, first) = (&nodes[i], nodes[i].first_index as usize);
                    if node.is_leaf() {
                        let end = first + node.prim_count as usize;
                        primitives.extend(tree.primitive_indices[first..end].iter().copied());
                    } else {
                        inside.extend([first + 1, first]);
                    }
                }
                let class = primitives.first().map_or(0, |&p| class(p));
                self.leaf(class, &primitives)
            } else {
                // Share out eight places over the subtree as the costs were made.
                let mut open: ArrayVec<usize, 8> = ArrayVec::new();
                let mut shares: ArrayVec<(usize, usize), 16> = ArrayVec::new();
                let share = |i: usize, children: usize| {
                    let first = nodes[i].first_index as usize;
                    let k = (1..children)
                        .min_by(|&k, &l| {
                            let of =
                                |k: usize| cost[first][k - 1] + cost[first + 1][children - k - 1];
                            of(k).total_cmp(&of(l))
                        })
                        .unwrap_or(1);
                    [(first + 1, children - k), (first, k)]
                };
                shares.extend(share(binary, 8));
                while let Some((i, mut children)) = shares.pop() {
                    while children > 1 && cost[i][children - 1] >= cost[i][children - 2] {
                        children -= 1;
                    }
                    if children == 1 { open.push(i) } else { shares.extend(share(i, children)) }
                }
                let index = self.nodes.len();
                let mut planes = [[[f32::INFINITY; 8], [f32::NEG_INFINITY; 8]]; 3];
                for (slot, &i) in open.iter().enumerate() {
                    let b = nodes[i].aabb();
                    for axis in 0..3 {
                        planes[axis][0][slot] = b.min[axis];
                        planes[axis][1][slot] = b.max[axis];
                    }
                    waiting.push((i, Some((index, slot))));
                }
                let planes = planes.map(|axis| axis.map(f32x8::new));
                self.nodes.push(Node { planes, children: [0; 8] });
                index as u32
            };
            match place {
                Some((node, slot)) => self.nodes[node].children[slot] = child,
                None => root = child,
            }
        }
        root
    }

    /// Visits the leaves whose boxes the ray passes at 0 ≤ t ≤ `t_max`, roughly in the order in which it
    /// reaches them, until `visit` returns true. `visit` may lower `t_max`.
    /// `ahead` is told which leaves are likely to be next.
    pub fn along(
        &self,
        slabs: &Slabs,
        mut t_max: f64,
        ahead: impl Fn(Leaf),
        mut visit: impl FnMut(Leaf, &mut f64) -> bool,
    ) {
        let Some(root) = self.root else { return };
        let mut reach = f32x8::splat(slabs.reach(t_max));
        let mut reach_scalar = slabs.reach(t_max);
        let mut stack = Stack::new();
        let mut next = (0.0f32, root);
        loop {
            let (near, child) = next;
            if near <= reach_scalar {
                if child & LEAF != 0 {
                    let before = t_max;
                    if visit(Leaf::of(child), &mut t_max) {
                        return;
                    }
                    if t_max != before {
                        reach_scalar = slabs.reach(t_max);
                        reach = f32x8::splat(reach_scalar);
                    }
                } else {
                    let node = &self.nodes[child as usize];
                    let (near, mut hits) = slabs.meet(node, reach);
                    if hits != 0 {
                        let near = near.to_array();
                        let first = hits.trailing_zeros() as usize;
                        hits &= hits - 1;
                        let mut nearest = (near[first], node.children[first]);
                        // Farther children wait, the nearest goes first; the few that wait are sorted
                        // so that the next nearest is on top.
                        let mut waiting: ArrayVec<(f32, u32), 8> = ArrayVec::new();
                        while hits != 0 {
                            let slot = hits.trailing_zeros() as usize;
                            hits &= hits - 1;
                            let mut entry = (near[slot], node.children[slot]);
                            if entry.0 < nearest.0 {
                                std::mem::swap(&mut entry, &mut nearest);
                            }
                            let mut i = waiting.len();
                            waiting.push(entry);
                            while i > 0 && waiting[i - 1].0 < entry.0 {
                                waiting[i] = waiting[i - 1];
                                i -= 1;
                            }
                            waiting[i] = entry;
                        }
                        for entry in waiting {
                            self.prefetch(entry.1, &ahead);
                            stack.push(entry);
                        }
                        self.prefetch(nearest.1, &ahead);
                        next = nearest;
                        continue;
                    }
                }
            }
            match stack.pop() {
                Some(entry) => next = entry,
                None => return,
            }
        }
    }

    /// Asks for a child's memory.
    #[inline(always)]
    fn prefetch(&self, child: u32, ahead: &impl Fn(Leaf)) {
        if child & LEAF != 0 {
            ahead(Leaf::of(child));
        } else if let Some(node) = self.nodes.get(child as usize) {
            // A cache line each.
            prefetch_index(node.planes.as_slice(), 0);
            prefetch_index(node.planes.as_slice(), 1);
            prefetch_index(node.planes.as_slice(), 2);
            prefetch_index(node.children.as_slice(), 0);
        }
    }

    /// Visits the leaves whose boxes overlap `b` until `visit` returns true; what lies in a box of which
    /// `keep` does not hold is passed over.
    pub fn within(
        &self,
        b: &Aabb,
        keep: impl Fn(&Aabb) -> bool,
        mut visit: impl FnMut(Leaf) -> bool,
    ) {
        let Some(root) = self.root else { return };
        let [min, max] = self.local_box(b).map(|corner| corner.map(f32x8::splat));
        let mut stack = Stack::new();
        stack.push((0.0, root));
        while let Some((_, child)) = stack.pop() {
            if child & LEAF != 0 {
                if visit(Leaf::of(child)) {
                    return;
                }
                continue;
            }
            let node = &self.nodes[child as usize];
            let mut mask = 0xff;
            for axis in 0..3 {
                mask &= node.planes[axis][0].simd_le(max[axis]).to_bitmask();
                mask &= min[axis].simd_le(node.planes[axis][1]).to_bitmask();
            }
            while mask != 0 {
                let k = mask.trailing_zeros() as usize;
                if keep(&self.world_box(node, k)) {
                    stack.push((0.0, node.children[k]));
                }
                mask &= mask - 1;
            }
        }
    }

    /// The box of a node's child in the world frame, to single precision.
    fn world_box(&self, node: &Node, child: usize) -> Aabb {
        let corner = |side: usize| {
            Point3::from(std::array::from_fn(|i| {
                f64::from(node.planes[i][side].as_array()[child]) / self.scale + self.centre[i]
            }))
        };
        Aabb { min: corner(0), max: corner(1) }
    }
}

/// A ray as the slab test wants it.
pub(super) struct Slabs {
    /// Origin, rounded to the side that makes the entry earlier, and to the side that makes the exit
    /// later.
    origin_in: [f32x8; 3],
    origin_out: [f32x8; 3],
    reciprocal: [f32x8; 3],
    /// Which plane of an axis is met first.
    first: [usize; 3],
    /// local t = (t − start) · rate
    start: f64,
    rate: f64,
}

impl Slabs {
    /// `None` if the ray is far from the whole scene, or has no direction.
    #[inline(always)]
    pub fn new(hierarchy: &Hierarchy, ray: &Ray) -> Option<Self> {
        let rate = ray.direction.amax() * hierarchy.scale;
        if !(rate > 0.0 && rate.is_finite()) {
            return None;
        }
        let unit = hierarchy.scale / rate;
        let direction = ray.direction.map(|d| {
            let d = d * unit;
            if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d }
        });
        let far_origin = hierarchy.local(&ray.origin);
        // Single precision is fine only near the scene: rays from afar start at the cube [−2, 2]³.
        let mut entry = 0.0f64;
        let mut origin = far_origin;
        if far_origin.amax() > 2.0 {
            let mut exit = f64::INFINITY;
            for i in 0..3 {
                let a = (-2.0 - far_origin[i]) / direction[i];
                let b = (2.0 - far_origin[i]) / direction[i];
                entry = entry.max(a.min(b));
                exit = exit.min(a.max(b));
            }
            if exit.is_nan() || entry > exit {
                return None;
            }
            origin += direction * entry;
        }
        // What the way here may have rounded off, and what rounding to single precision does.
        let doubt = (8.0 * f64::EPSILON * far_origin.amax()) as f32 + f32::MIN_POSITIVE;
        let forward = direction.map(|d| d > 0.0);
        let towards = |i: usize, later: bool| {
            let o = origin[i] as f32;
            let doubt = doubt + o.abs() * f32::EPSILON;
            f32x8::splat(if later { o + doubt } else { o - doubt })
        };
        Some(Self {
            origin_in: [0, 1, 2].map(|i| towards(i, forward[i])),
            origin_out: [0, 1, 2].map(|i| towards(i, !forward[i])),
            reciprocal: [0, 1, 2].map(|i: usize| f32x8::splat(1.0 / direction[i] as f32)),
            first: [0, 1, 2].map(|i: usize| usize::from(!forward[i])),
            start: entry / rate,
            rate,
        })
    }

    /// The local parameter of `t`, rounded up.
    fn reach(&self, t: f64) -> f32 {
        let local = (t - self.start) * self.rate;
        up(local + local.abs() * f64::EPSILON * 8.0 + self.start * self.rate * f64::EPSILON * 8.0)
    }

    /// Where the ray enters each child's box, and which ones it passes before `reach`.
    ///
    /// Subtraction, reciprocal and product each round by at most 2⁻²⁴ relative: the factors below are
    /// a little more than all three, as the origin's own rounding is in `origin_in` and `origin_out`.
    #[inline(always)]
    fn meet(&self, node: &Node, reach: f32x8) -> (f32x8, u32) {
        const EARLIER: f32 = 1.0 - 4.0 * f32::EPSILON;
        const LATER: f32 = 1.0 + 4.0 * f32::EPSILON;
        let entry =
            |i: usize| (node.planes[i][self.first[i] & 1] - self.origin_in[i]) * self.reciprocal[i];
        let exit = |i: usize| {
            (node.planes[i][(self.first[i] & 1) ^ 1] - self.origin_out[i]) * self.reciprocal[i]
        };
        let near = entry(0).fast_max(entry(1)).fast_max(entry(2).fast_max(f32x8::ZERO));
        let far = exit(0).fast_min(exit(1)).fast_min(exit(2));
        let near = near * f32x8::splat(EARLIER);
        let far = (far * f32x8::splat(LATER)).fast_min(reach);
        (near, near.simd_le(far).to_bitmask())
    }
}

/// The greatest power of two not above `x` > 0.
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.clamp(f64::MIN_POSITIVE, f64::MAX).to_bits() & 0x7ff0_0000_0000_0000)
}
