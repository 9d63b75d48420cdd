//! Convex parts of a domain, held against its cells.

use super::landing::Square;

/// How far beyond its sides a part is taken to reach: what rounding may move them by.
const SLACK: f64 = 1e-9;
/// A part whose extent is below this share of a cell's side is looked for in the cell's quarters.
const SMALL: f64 = 0.5;

/// A convex polygon in a domain.
#[derive(Clone, Debug)]
pub struct Part(Vec<[f64; 2]>);

impl Part {
    /// The polygon with these corners, in order around it.
    pub fn new(corners: Vec<[f64; 2]>) -> Self {
        Self(corners)
    }

    /// Share of the domain.
    pub fn area(&self) -> f64 {
        let next = self.0.iter().cycle().skip(1);
        let twice: f64 = self.0.iter().zip(next).map(|(p, q)| p[0] * q[1] - p[1] * q[0]).sum();
        0.5 * twice.abs()
    }

    /// Whether it may have a point in a cell.
    pub fn meets(&self, cell: Square) -> bool {
        let (a, b) = cell.corner().coordinates();
        let half = 0.5 * cell.size();
        let centre = [a + half, b + half];
        let apart = |n: [f64; 2]| {
            let along = |p: &[f64; 2]| n[0] * (p[0] - centre[0]) + n[1] * (p[1] - centre[1]);
            let (low, high) = extent(self.0.iter().map(along));
            let reach = (half + SLACK) * (n[0].abs() + n[1].abs());
            low > reach || high < -reach
        };
        let next = self.0.iter().cycle().skip(1);
        let mut sides = self.0.iter().zip(next).map(|(p, q)| [q[1] - p[1], p[0] - q[0]]);
        !(apart([1.0, 0.0]) || apart([0.0, 1.0]) || sides.any(apart))
    }

    /// Whether it is much smaller than a cell.
    pub fn is_small_in(&self, cell: Square) -> bool {
        let wide = |k: usize| {
            let (low, high) = extent(self.0.iter().map(|p| p[k]));
            high - low
        };
        wide(0).max(wide(1)) < SMALL * cell.size()
    }
}

fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangle_and_cells() {
        let part = Part::new(vec![[0.1, 0.1], [0.4, 0.1], [0.1, 0.4]]);
        assert!((part.area() - 0.045).abs() < 1e-15);
        let meets: Vec<(u32, u32)> = (0..4)
            .flat_map(|i| (0..4).map(move |j| (i, j)))
            .filter(|&(i, j)| part.meets(Square::nth(2, i, j)))
            .collect();
        // The long side touches the corner of the cell (1, 1).
        assert_eq!(meets, [(0, 0), (0, 1), (1, 0), (1, 1)]);
        assert!(!part.meets(Square::nth(3, 2, 3)) && part.meets(Square::nth(3, 1, 2)));
        assert!(part.is_small_in(Square::nth(0, 0, 0)));
        assert!(!part.is_small_in(Square::nth(1, 0, 0)));
    }
}
