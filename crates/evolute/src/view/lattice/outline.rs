//! Light beside outlines: a shadow may begin where the thing that throws it hides the rest, and be narrower than any
//! distance of nodes.

use rayon::prelude::*;

use super::block::Block;
use super::{FINEST, Lattice, Lit, PIXEL, distance, find, total};
use crate::geometry::Rgb;
use crate::transfer::{Control, Order};
use crate::view::View;
use crate::view::receiver::Allowance;

/// A side of a block, by its ends [units], the upper or left one first.
pub(super) type Side = [(u32, u32); 2];

/// Halvings that tell where on a side an outline lies.
const HALVINGS: u32 = 6;

/// Difference of the light beside an outline and at the end of the side, in tolerances, that counts.
const CHANGE: f64 = 10.0;

/// What one look found.
struct Look {
    changes: bool,
    stopped: bool,
    seen: super::Node,
}

impl Block {
    /// Sides, in no particular order.
    pub fn sides(&self) -> [Side; 4] {
        let [a, b, c, d] = self.corners();
        [[a, b], [c, d], [a, c], [b, d]]
    }
}

impl Lattice {
    /// Looks beside the outlines on the sides of blocks that are not known yet; `false` if told to stop.
    pub(super) fn look_beside(
        &mut self,
        blocks: &[Block],
        view: &View<'_>,
        tolerance: f64,
        control: &Control<'_>,
    ) -> bool {
        let mut sides: Vec<Side> = blocks
            .iter()
            .flat_map(Block::sides)
            .filter(|side| !self.outlined.contains_key(side))
            .collect();
        sides.sort_unstable();
        sides.dedup();
        let looks: Vec<Option<Look>> = sides
            .par_iter()
            .map(|side| {
                let go = (control.order)() == Order::Go;
                if go { self.look(side, view, tolerance) } else { None }
            })
            .collect();
        if (control.order)() != Order::Go {
            return false;
        }
        let mut whole = true;
        for (side, look) in sides.into_iter().zip(looks) {
            let Some(look) = look else { continue };
            whole &= !look.stopped;
            self.counts += look.seen.counts;
            self.receivers += look.seen.lit.len() as u64;
            self.unmet += look.seen.unmet;
            self.largest_error = self.largest_error.max(look.seen.largest_error);
            self.outlined.insert(side, look.changes);
        }
        whole
    }

    /// Looks at the light on what one end of a side sees and the other does not, where it is seen last. `None` if there
    /// is nothing of that kind.
    fn look(&self, side: &Side, view: &View<'_>, tolerance: f64) -> Option<Look> {
        let [p, q] = side.map(|at| self.nodes.get(&at));
        let (p, q) = (p?, q?);
        let small = tolerance * (total(p).max().max(total(q).max()) + self.dark);
        let mut look: Option<Look> = None;
        for ((near, far), (from, to)) in
            [((p, q), (side[0], side[1])), ((q, p), (side[1], side[0]))]
        {
            for lit in near {
                // What is dark here may be lit where the other end hides it.
                if find(far, &lit.leaf).is_some() {
                    continue;
                }
                let look = look.get_or_insert_with(|| Look {
                    changes: false,
                    stopped: false,
                    seen: super::Node::default(),
                });
                self.look_along(lit, from, to, view, CHANGE * small, look);
            }
        }
        look
    }

    /// Light on a surface that is seen at `from` and not at `to`, where it is seen last in between.
    fn look_along(
        &self,
        lit: &Lit,
        from: (u32, u32),
        to: (u32, u32),
        view: &View<'_>,
        allowed: f64,
        look: &mut Look,
    ) {
        let at = |f: f64| {
            let along = |p: u32, q: u32| {
                let (p, q) = (f64::from(p), f64::from(q));
                (p + f * (q - p)) / f64::from(super::UNITS)
            };
            (along(from.0, to.0), along(from.1, to.1))
        };
        let mut last = None;
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let (x, y) = at(middle);
            let leaves = view.sight(x, y).leaves;
            match leaves.iter().position(|leaf| leaf.same(&lit.leaf)) {
                Some(i) => {
                    low = middle;
                    last = Some((leaves, i));
                }
                None => high = middle,
            }
        }
        let Some((leaves, i)) = last else { return };
        let leaf = leaves[i];
        // Direct light comes first: no other lattice is there yet.
        let known: Vec<Rgb> = leaves.iter().map(|l| view.foreknown(l, self.part)).collect();
        let allowance = Allowance::new(&leaves, &known, self.dark);
        let share = view.relative * allowance.share(&leaf, known[i]);
        let light = (view.light)(&leaf, self.part, share);
        look.stopped |= light.stopped;
        let seen = Lit { leaf, irradiance: light.irradiance, known: known[i] };
        look.changes |= distance(seen.radiance(), lit.radiance()) > allowed;
        look.seen.counts += light.counts;
        look.seen.unmet += u64::from(!light.met);
        look.seen.largest_error = look.seen.largest_error.max(light.error);
        look.seen.lit.push(seen);
    }

    /// Whether light changes beside an outline in the pixel (x, y) more finely than nodes can tell.
    pub fn changes_in(&self, x: u32, y: u32) -> bool {
        let pixel = Block { level: PIXEL, x, y };
        self.split.contains(&pixel)
            && pixel.children().iter().any(|b| {
                debug_assert_eq!(b.level, FINEST);
                b.sides().iter().any(|side| self.outlined.get(side) == Some(&true))
            })
    }
}
