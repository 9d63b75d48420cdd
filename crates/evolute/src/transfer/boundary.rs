//! The border of what sampling sees inside a cell: where an occluder begins, or a chain ceases to
//! exist.
//!
//! The crossings on the cell's sides are bisected; the border between them is a parabola through a
//! third bisected point on the normal of the chord. Error O(h⁴) for a smooth border.

use super::polynomial::Patch;
use crate::optics::Dual;

/// The part of a unit cell that is seen.
pub enum Border {
    /// All of it.
    Everything,
    /// Nothing.
    Nothing,
    /// Where this polynomial is positive; with the width of doubt times length, as a part of the cell.
    Cut(Box<Patch>, f64),
    /// More than one curve crosses the cell.
    Tangled,
}

/// Halvings of a side: the crossing is then known to 1/256 of it, below a parabola's own error.
const BISECTIONS: u32 = 8;

/// How far beside a border, in lengths of its chord, it is held against further samples.
const BESIDE: f64 = 0.1;

/// The border in a cell whose corners (0,0), (1,0), (0,1), (1,1) and centre are seen or not, by
/// asking `seen` at further points of the cell.
///
/// If it is `watched`, it is held against further points beside it.
pub fn border(
    corners: [bool; 4],
    centre: bool,
    watched: bool,
    mut seen: impl FnMut(f64, f64) -> bool,
) -> Border {
    let count = corners.iter().filter(|c| **c).count();
    if count == 4 || count == 0 {
        return match (count == 4, centre) {
            (true, true) => Border::Everything,
            (false, false) => Border::Nothing,
            _ => Border::Tangled,
        };
    }
    const AT: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let mut crossings: Vec<[f64; 2]> = Vec::with_capacity(4);
    for (p, q) in [(0, 1), (1, 3), (3, 2), (2, 0)] {
        if corners[p] != corners[q] {
            crossings.push(bisect(AT[p], AT[q], corners[p], &mut seen));
        }
    }
    let [p, q] = crossings.as_slice() else { return Border::Tangled };
    let chord = [q[0] - p[0], q[1] - p[1]];
    let length = (chord[0] * chord[0] + chord[1] * chord[1]).sqrt();
    let width = 1.0 / f64::from(1u32 << BISECTIONS);
    if length < 4.0 * width {
        // A corner is clipped by less than the bisection resolves.
        let share = 4.0 * width * width;
        let sign = if count >= 2 { 1.0 } else { -1.0 };
        return Border::Cut(Box::new(Patch([sign; 16])), share);
    }
    // Normal of the chord towards what is seen.
    let mut n = [-chord[1] / length, chord[0] / length];
    // Of the corners, the one farthest from the chord tells the side.
    let side = |c: &[f64; 2]| (c[0] - p[0]) * n[0] + (c[1] - p[1]) * n[1];
    let mut best = (0.0, true);
    for k in 0..4 {
        let s = side(&AT[k]);
        if s.abs() > f64::abs(best.0) {
            best = (s, corners[k]);
        }
    }
    if (best.0 > 0.0) != best.1 {
        n = [-n[0], -n[1]];
    }
    let middle = [0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1])];
    // How far the normal may be followed both ways inside the cell, at most a third of the chord.
    let reach = |d: [f64; 2]| {
        let mut r = length / 3.0;
        for k in 0..2 {
            if d[k] > 0.0 {
                r = r.min((1.0 - middle[k]) / d[k]);
            } else if d[k] < 0.0 {
                r = r.min(middle[k] / -d[k]);
            }
        }
        r.max(0.0)
    };
    let (up, down) = (reach(n), reach([-n[0], -n[1]]));
    let top = [middle[0] + n[0] * up, middle[1] + n[1] * up];
    let bottom = [middle[0] - n[0] * down, middle[1] - n[1] * down];
    let (at_top, at_bottom) = (seen(top[0], top[1]), seen(bottom[0], bottom[1]));
    let (sagitta, doubt) = if at_top && !at_bottom {
        let m = bisect(bottom, top, false, &mut seen);
        let s = (m[0] - middle[0]) * n[0] + (m[1] - middle[1]) * n[1];
        // A parabola is right to about a tenth of the sagitta squared over the chord; the
        // bisections' own widths come on top.
        (s, 0.15 * s.abs() + width * 0.5)
    } else if at_top && at_bottom {
        (-down, down + 0.1)
    } else if !at_top && !at_bottom {
        (up, up + 0.1)
    } else {
        return Border::Tangled;
    };
    let bow = |along: f64| 4.0 * sagitta * along * (1.0 - along);
    // Both borders of a strip may leave the cell by the same corner: then one near its ends is not as drawn.
    let mut is_as_drawn = || {
        [(0.15, 1.0), (0.15, -1.0), (0.85, 1.0), (0.85, -1.0)].iter().all(|(along, way)| {
            let off = bow(*along) + way * BESIDE * length;
            let [a, b] = [0, 1].map(|k| p[k] + along * chord[k] + off * n[k]);
            let inside = |x: f64| (0.0..=1.0).contains(&x);
            !inside(a) || !inside(b) || seen(a, b) == (*way > 0.0)
        })
    };
    if watched && !is_as_drawn() {
        return Border::Tangled;
    }
    let value = |a: f64, b: f64| {
        let (x, y) = (a - p[0], b - p[1]);
        let height = x * n[0] + y * n[1];
        let along = (x * chord[0] + y * chord[1]) / (length * length);
        let slope = -4.0 * sagitta * (1.0 - 2.0 * along) / (length * length);
        Dual::new(height - bow(along), n[0] + slope * chord[0], n[1] + slope * chord[1])
    };
    let patch = Patch::hermite(
        &[value(0.0, 0.0), value(1.0, 0.0), value(0.0, 1.0), value(1.0, 1.0)],
        1.0,
        1.0,
    );
    if (patch.value(0.5, 0.5) > 0.0) != centre && patch.value(0.5, 0.5).abs() > 0.1 {
        return Border::Tangled;
    }
    Border::Cut(Box::new(patch), doubt * length)
}

/// The crossing between two points, the first of which is seen or not.
fn bisect(
    from: [f64; 2],
    to: [f64; 2],
    at_from: bool,
    seen: &mut impl FnMut(f64, f64) -> bool,
) -> [f64; 2] {
    let (mut low, mut high) = (0.0, 1.0);
    let at = |t: f64| [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
    for _ in 0..BISECTIONS {
        let mid = 0.5 * (low + high);
        let [a, b] = at(mid);
        if seen(a, b) == at_from {
            low = mid;
        } else {
            high = mid;
        }
    }
    at(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::cut::{Weights, cut_integral};

    #[test]
    fn disc_through_cells() {
        let (mut area, mut doubt) = (0.0, 0.0);
        let n = 8;
        let h = 1.0 / n as f64;
        let seen = |a: f64, b: f64| a * a + b * b < 0.64;
        for i in 0..n {
            for j in 0..n {
                let (a0, b0) = (i as f64 * h, j as f64 * h);
                let at = |a: f64, b: f64| seen(a0 + a * h, b0 + b * h);
                let corners = [at(0.0, 0.0), at(1.0, 0.0), at(0.0, 1.0), at(1.0, 1.0)];
                match border(corners, at(0.5, 0.5), true, at) {
                    Border::Everything => area += h * h,
                    Border::Cut(p, d) => {
                        let one: Weights = [Patch([1.0; 16])].into_iter().collect();
                        area += h * h * cut_integral(&one, &[*p], 1e-9)[0];
                        doubt += h * h * d;
                    }
                    Border::Nothing => {}
                    Border::Tangled => doubt += h * h,
                }
            }
        }
        let exact = 0.16 * std::f64::consts::PI;
        assert!((area - exact).abs() < doubt, "{area} {exact} {doubt}");
        assert!((area - exact).abs() < 5e-4 && doubt < 5e-3, "{area} {exact} {doubt}");
    }
}
