//! Cones of normals over the dyadic cells of the parameters, each computed once.

use std::f64::consts::PI;
use std::fmt;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use super::Parametric;
use crate::formula::Interval;
use crate::geometry::{Vector3, math};

/// Cells down to this level are kept: 8 bytes each.
const LAST_KEPT: u32 = 7;

/// Half openings of the cells' cones, those that were asked for. They are functions of the surface alone, so that it
/// does not matter who computed them, and when.
#[derive(Default)]
pub(super) struct Cones([OnceLock<Box<[AtomicU64]>>; LAST_KEPT as usize + 1]);

/// What is kept is no property of the surface: a surface is the same one, and is written as the same (solution files know
/// their scenes by that), whatever it was asked for.
impl fmt::Debug for Cones {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Cones")
    }
}

/// Bits of no opening: a NaN.
const UNKNOWN: u64 = u64::MAX;

impl Parametric {
    /// Half the opening [rad] of a cone that certainly holds all normals of the (i, j)-th of the 4^`level` cells of
    /// parameters; π where none narrower than a half space is found. Intervals make it wider than it need be.
    pub fn normal_cone(&self, level: u32, [i, j]: [u32; 2]) -> f64 {
        let Some(kept) = self.cones.0.get(level as usize) else {
            return self.cone_over(level, [i, j]);
        };
        let kept = kept
            .get_or_init(|| (0..1usize << (2 * level)).map(|_| AtomicU64::new(UNKNOWN)).collect());
        let place = &kept[((i as usize) << level) + j as usize];
        match place.load(Ordering::Relaxed) {
            UNKNOWN => {
                let cone = self.cone_over(level, [i, j]);
                place.store(cone.to_bits(), Ordering::Relaxed);
                cone
            }
            known => f64::from_bits(known),
        }
    }

    fn cone_over(&self, level: u32, cell: [u32; 2]) -> f64 {
        let side = 1.0 / f64::from(1u32 << level);
        let [s, t] = cell.map(|k| f64::from(k) * side).map(|x| Interval::new(x, x + side));
        let [xs, xt] = self.evaluator.tangent_box([s, t]);
        let (mut centre, mut half) = (Vector3::zeros(), Vector3::zeros());
        for i in 0..3 {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let n = xs[j] * xt[k] - xs[k] * xt[j];
            if !n.is_bounded() {
                return PI;
            }
            centre[i] = 0.5 * (n.lo + n.hi);
            half[i] = 0.5 * n.width();
        }
        let sine = half.norm() / centre.norm();
        if sine < 1.0 { math::asin(sine) } else { PI }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::formula::Formula;
    use crate::geometry::Transform;

    /// On a tube, cells of half a turn and more have no cone, the next are as wide as they turn; kept or not, and asked
    /// for again.
    #[test]
    fn cones_of_a_tube() {
        let f = |text: &str| Formula::parse(text, &["s", "t"], &[]).unwrap();
        let tube = Parametric::new(
            f("cos(2*pi*s)"),
            f("sin(2*pi*s)"),
            f("t"),
            Transform::identity(),
            false,
        )
        .unwrap();
        let written = format!("{tube:?}");
        for level in 0..=LAST_KEPT + 2 {
            let last = (1u32 << level) - 1;
            let turn = 2.0 * PI / f64::from(1u32 << level);
            for i in [0, last / 2, last] {
                let cone = tube.normal_cone(level, [i, last]);
                assert_eq!(cone, tube.normal_cone(level, [i, last]));
                assert!(cone >= 0.5 * turn && cone <= PI, "{level} {i}: {cone}");
                assert!(level < 3 || cone < 1.5 * turn, "{level} {i}: {cone}");
            }
        }
        assert_eq!(format!("{tube:?}"), written);
    }
}
