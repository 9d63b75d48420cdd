//! Which lines pass a surface at most once.
//!
//! By the mean value theorem, a coordinate at a time, a chord between two points of the surface is
//! Δs A + Δt B with A and B in the boxes around all x_s and all x_t; so it is perpendicular to A × B. A line
//! that is perpendicular to no vector in the box around these products holds no chord.

use super::evaluate::Evaluator;
use super::patch::Cell;
use crate::formula::{Interval, Tape};
use crate::geometry::{Transform, Vector3};

/// Cells along each parameter whose boxes are joined: intervals over the whole domain would be too wide.
const CELLS: u32 = 8;

/// Bounds of the directions of all chords.
#[derive(Clone, Debug)]
pub(super) struct Chords {
    /// A box around all A × B, object frame, where a tilted surface has no wider a box than one that is not.
    across: [Interval; 3],
    object_from_world: Transform,
}

impl Chords {
    pub fn new(tape: &Tape, world_from_object: &Transform) -> Self {
        let evaluator = Evaluator::new(tape.clone(), &Transform::identity());
        let mut velocities: Option<[[Interval; 3]; 2]> = None;
        let side = 1.0 / f64::from(CELLS);
        for (i, j) in (0..CELLS).flat_map(|i| (0..CELLS).map(move |j| (f64::from(i), f64::from(j))))
        {
            let cell = Cell::spanning([i * side, (i + 1.0) * side], [j * side, (j + 1.0) * side]);
            let b = evaluator.jet_box(cell.intervals());
            let known = velocities.get_or_insert([b.xs, b.xt]);
            for (known, new) in known.iter_mut().zip([b.xs, b.xt]) {
                for (known, new) in known.iter_mut().zip(new) {
                    // An empty interval, or one of numbers that are none, says that nothing is known.
                    *known = if new.is_bounded() && known.is_bounded() {
                        Interval { lo: known.lo.min(new.lo), hi: known.hi.max(new.hi) }
                    } else {
                        Interval { lo: f64::NEG_INFINITY, hi: f64::INFINITY }
                    };
                }
            }
        }
        let [a, b] = velocities.unwrap_or([[Interval::point(0.0); 3]; 2]);
        let across = std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            a[j] * b[k] - a[k] * b[j]
        });
        Self { across, object_from_world: world_from_object.inverse() }
    }

    /// +1 or −1 if no line in the (world's) direction `d` holds a chord, the same for all directions between
    /// two that have it; 0 if that is not proved.
    pub fn side(&self, d: &Vector3) -> i32 {
        let d = self.object_from_world.vector(d);
        let (mut low, mut high, mut size) = (0.0, 0.0, 0.0);
        for (n, d) in self.across.iter().zip(d.iter()) {
            let (p, q) = (n.lo * d, n.hi * d);
            low += p.min(q);
            high += p.max(q);
            size += n.magnitude() * d.abs();
        }
        // A few roundings; not a number where a bound is infinite, which proves nothing.
        let slack = 8.0 * f64::EPSILON * size;
        if low > slack {
            1
        } else if high < -slack {
            -1
        } else {
            0
        }
    }
}
