//! Tensors of a wave's transverse plane: what is wanted of 2×2 matrices.

use crate::geometry::{Matrix2, Vector2};

/// The inverse times the determinant.
pub(super) fn adjugate(m: &Matrix2) -> Matrix2 {
    Matrix2::new(m[(1, 1)], -m[(0, 1)], -m[(1, 0)], m[(0, 0)])
}

/// Eigenvalues of the symmetric part.
pub(super) fn symmetric_eigenvalues(m: &Matrix2) -> [f64; 2] {
    let mean = 0.5 * (m[(0, 0)] + m[(1, 1)]);
    let (half, off) = (0.5 * (m[(0, 0)] - m[(1, 1)]), 0.5 * (m[(0, 1)] + m[(1, 0)]));
    let radius = (half * half + off * off).sqrt();
    [mean + radius, mean - radius]
}

/// Condition number σ₁/σ₂ ≥ 1 of a 2×2 matrix; infinite for a singular one.
pub fn condition_number(m: &Matrix2) -> f64 {
    // σ₁ ± σ₂ are the lengths of the matrix's parts that keep and that flip orientation.
    let keep = Vector2::new(m[(0, 0)] + m[(1, 1)], m[(1, 0)] - m[(0, 1)]).norm();
    let flip = Vector2::new(m[(0, 0)] - m[(1, 1)], m[(1, 0)] + m[(0, 1)]).norm();
    let large = 0.5 * (keep + flip);
    // σ₁σ₂ = |det|, which does not cancel as ½|keep − flip| does.
    let square = large * large;
    let det = m.determinant().abs();
    if det > 0.0 { (square / det).max(1.0) } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::math;

    #[test]
    fn eigenvalues_of_a_symmetric_tensor() {
        let [a, b] = symmetric_eigenvalues(&Matrix2::new(2.0, 1.0, 1.0, 2.0));
        assert!((a - 3.0).abs() < 1e-15 && (b - 1.0).abs() < 1e-15);
        let m = Matrix2::new(0.3, -1.2, 0.7, 2.0);
        assert!((m * adjugate(&m) - Matrix2::identity() * m.determinant()).norm() < 1e-15);
    }

    #[test]
    fn condition_numbers() {
        assert!((condition_number(&Matrix2::new(3.0, 0.0, 0.0, -0.5)) - 6.0).abs() < 1e-14);
        assert!((condition_number(&Matrix2::new(0.6, -0.8, 0.8, 0.6)) - 1.0).abs() < 1e-15);
        let (s, c) = math::sin_cos(0.4);
        let turn = Matrix2::new(c, -s, s, c);
        let m = turn * Matrix2::new(1e7, 0.0, 0.0, 1.0) * turn;
        assert!((condition_number(&m) / 1e7 - 1.0).abs() < 1e-7);
        assert!(condition_number(&Matrix2::zeros()).is_infinite());
    }
}
