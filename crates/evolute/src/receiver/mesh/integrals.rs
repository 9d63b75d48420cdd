//! What a corner of a triangle stands for: integrals of linear functions over pieces of curved surfaces.

use super::{Triangle, TriangleMesh};
use crate::geometry::math;
use crate::surface::{ChartPoint, Surface};

/// Accuracy of integrals over a triangle, as a part of its area: what they make of a flux is far below any
/// accuracy that is asked for.
pub(super) const INTEGRAL_ACCURACY: f64 = 1e-7;

impl TriangleMesh<'_> {
    /// ∫ φ dA of each corner's function [m²], to [`INTEGRAL_ACCURACY`] of the triangle's area.
    pub(super) fn integrals(&self, triangle: &Triangle) -> [f64; 3] {
        let whole = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let area = triangle.chart_area();
        let rough = self.cubature(triangle, whole);
        let tolerance = INTEGRAL_ACCURACY * rough.iter().sum::<f64>();
        let mut sums = self.refined(triangle, whole, rough, tolerance, 0).map(|s| s * area);
        if let Surface::Disk(_) = self.surface {
            // What lies between an edge on the rim and the rim belongs to the edge's ends.
            for edge in (0..3).filter(|&e| triangle.is_rim(e)) {
                let [p, q] = [triangle.corners[edge], triangle.corners[(edge + 1) % 3]];
                let half = 0.5 * math::hypot(p[0] - q[0], p[1] - q[1]);
                let angle = 2.0 * math::asin(half.min(1.0));
                let segment = 0.5 * (angle - math::sin(angle));
                let element = self.surface.area_element(&ChartPoint { chart: 0, at: p });
                sums[edge] += 0.5 * segment * element;
                sums[(edge + 1) % 3] += 0.5 * segment * element;
            }
        }
        sums
    }

    /// The same over a part of a triangle by the weights of its corners, as a fraction of the chart's area;
    /// `rough` is the cubature over it.
    fn refined(
        &self,
        triangle: &Triangle,
        [a, b, c]: [[f64; 3]; 3],
        rough: [f64; 3],
        tolerance: f64,
        depth: u32,
    ) -> [f64; 3] {
        // Halfway between two corners.
        let middle = |p: [f64; 3], q: [f64; 3]| [0, 1, 2].map(|i| 0.5 * (p[i] + q[i]));
        let [d, e, f] = [middle(a, b), middle(b, c), middle(c, a)];
        let quarters = [[a, d, f], [d, b, e], [f, e, c], [d, e, f]];
        let parts = quarters.map(|q| self.cubature(triangle, q).map(|x| 0.25 * x));
        let sum =
            |parts: &[[f64; 3]; 4]| [0, 1, 2].map(|i| parts.iter().map(|p| p[i]).sum::<f64>());
        let fine = sum(&parts);
        let change = (0..3).map(|i| (fine[i] - rough[i]).abs()).fold(0.0, f64::max);
        // Kinks and corners of formulas end at the sixth division: 4096 parts.
        if change <= tolerance || depth == 6 {
            return fine;
        }
        let refined = [0, 1, 2, 3].map(|k| {
            let rough = parts[k].map(|x| 4.0 * x);
            let part = self.refined(triangle, quarters[k], rough, tolerance, depth + 1);
            part.map(|x| 0.25 * x)
        });
        sum(&refined)
    }

    /// Mean of φ dA over a part of a triangle's chart, given by the weights of its corners.
    fn cubature(&self, triangle: &Triangle, part: [[f64; 3]; 3]) -> [f64; 3] {
        // Radon's seven points, exact to the fifth degree.
        let root = 15f64.sqrt();
        let (wa, wb) = ((155.0 - root) / 1200.0, (155.0 + root) / 1200.0);
        let mut sums = [0.0; 3];
        let mut add = |weight: f64, at: [f64; 3]| {
            let at = [0, 1, 2].map(|i| (0..3).map(|k| at[k] * part[k][i]).sum::<f64>());
            let point = ChartPoint { chart: triangle.chart, at: triangle.point(at) };
            let area = weight * self.surface.area_element(&point);
            for i in 0..3 {
                sums[i] += area * at[i];
            }
        };
        add(0.225, [1.0 / 3.0; 3]);
        for (w, x) in [(wa, (6.0 - root) / 21.0), (wb, (6.0 + root) / 21.0)] {
            for i in 0..3 {
                let mut at = [x; 3];
                at[i] = 1.0 - 2.0 * x;
                add(w, at);
            }
        }
        sums
    }
}
