//! Newton's iteration for the one root of a ray in a certified cell, and beyond the border.

use super::Parametric;
use super::hit::{Certificate, Query};
use super::patch::Patch;
use crate::geometry::Vector3;

/// The step ((ds, dt), dτ) that takes the residual `r` = ray − surface to zero to first order.
pub(super) fn newton_step(
    r: &Vector3,
    xs: &Vector3,
    xt: &Vector3,
    direction: &Vector3,
) -> Option<([f64; 2], f64)> {
    let n = xs.cross(xt);
    let dtau = -n.dot(r) / n.dot(direction);
    let p = r + direction * dtau;
    let inverse = 1.0 / n.norm_squared();
    let (ds, dt) = (p.cross(xt).dot(&n) * inverse, xs.cross(&p).dot(&n) * inverse);
    (ds.is_finite() && dt.is_finite() && dtau.is_finite()).then_some(([ds, dt], dtau))
}

impl Query<'_> {
    /// Newton's iteration in a cell that holds at most one root: τ, parameters, and the sum of the
    /// row n/(n·w) that takes errors of positions to errors of τ.
    pub(super) fn newton(
        &self,
        surface: &Parametric,
        patch: &Patch,
        certificate: &Certificate,
    ) -> Option<(f64, [f64; 2], f64)> {
        let Certificate { guess, blur, border, contraction, tau_slope } = *certificate;
        let (o, w) = (&self.ray.origin, &self.ray.direction);
        let (c, h) = (patch.cell.centre, patch.cell.half);
        let j = &patch.jet;
        // Second order from the centre: saves a step.
        let d = [0, 1].map(|k: usize| guess[k].clamp(-h[k], h[k]));
        let bend = (j.xuu * (d[0] * d[0]) + j.xvv * (d[1] * d[1])) * 0.5 + j.xuv * (d[0] * d[1]);
        let inverse = 1.0 / patch.normal.dot(w);
        let bend = bend - w * (patch.normal.dot(&bend) * inverse);
        let mut p: [f64; 2] = std::array::from_fn(|k| {
            c[k] + (guess[k] - patch.dual[k].dot(&bend)).clamp(-h[k], h[k])
        });
        // The root is within `contraction`/(1 − `contraction`) of a simplified step, in units of that
        // step; below ½ that is less than one.
        let doubt = contraction / (1.0 - contraction);
        for count in 0..64 {
            let (x, xs, xt) = surface.evaluator.jet1(p[0], p[1]);
            let along = (x - o).dot(w) * self.inverse_square;
            let r = o + w * along - x;
            // The step with the derivatives at the centre: slower, but in the cell it halves the error
            // at least, and 50 of them leave nothing.
            let simple = || {
                let dtau = -patch.normal.dot(&r) * inverse;
                let q = r + w * dtau;
                ([0, 1].map(|k: usize| patch.dual[k].dot(&q)), dtau)
            };
            // Newton's own steps have nearly always ended after three.
            let newton = count < 12;
            let (step, dtau) = if newton { newton_step(&r, &xs, &xt, w)? } else { simple() };
            let size = (step[0].abs() / h[0]).max(step[1].abs() / h[1]);
            let inside = (0..2).all(|k| (p[k] + step[k] - c[k]).abs() <= h[k] + border[k]);
            // Quadratic convergence: the next error is below the contraction times the square of this
            // step, and that of τ below its slope times the same. 10⁻¹⁵ of a cell or of τ is nothing, and little
            // is gained below the bound of the rounding error: a few steps are tried, for the error
            // itself is mostly smaller.
            let next = size * size;
            let rounded = count >= 4 && (0..2).all(|k| step[k].abs() <= blur[k]);
            let last = (newton
                && (contraction * next <= 1e-15 || rounded)
                && tau_slope * next <= 1e-15 * (along.abs() + tau_slope))
                || (!newton && rounded);
            if last || !inside {
                if last && inside {
                    let at = |k: usize| {
                        let q = p[k] + step[k];
                        // What the border lets through beyond the domain is rounding.
                        if c[k] - h[k] >= 0.0 && c[k] + h[k] <= 1.0 { q.clamp(0.0, 1.0) } else { q }
                    };
                    let n = xs.cross(&xt);
                    let row = n.abs().sum() / n.dot(w).abs();
                    return Some((along + dtau, [at(0), at(1)], row));
                }
                // Outside by more than the simplified step's error: proved that there is no root.
                let (simple, _) = simple();
                let length = (simple[0].abs() / h[0]).max(simple[1].abs() / h[1]);
                let out = |k: usize| {
                    let beyond = (p[k] + simple[k] - c[k]).abs() - h[k] - border[k];
                    beyond > doubt * length * h[k]
                };
                if out(0) || out(1) || last {
                    return None;
                }
            }
            p = [0, 1].map(|k: usize| c[k] + (p[k] + step[k] - c[k]).clamp(-h[k], h[k]));
        }
        None
    }
}
