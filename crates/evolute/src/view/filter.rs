//! Reconstruction filters over the film, as in Mitsuba 3.

use crate::geometry::math;
use crate::scene::ReconstructionFilter;

impl ReconstructionFilter {
    /// Distance from which on the filter is zero [pixels].
    pub(super) fn radius(&self) -> f64 {
        match self {
            Self::Box => 0.5,
            Self::Tent { radius } => *radius,
            Self::Gaussian { stddev } => 4.0 * stddev,
        }
    }

    /// Weight of a sample at a distance `x` [pixels] along one axis; the filter is the product over
    /// both axes. Not normalised.
    pub(super) fn weight(&self, x: f64) -> f64 {
        let x = x.abs();
        if x > self.radius() {
            return 0.0;
        }
        match self {
            Self::Box => 1.0,
            Self::Tent { radius } => 1.0 - x / radius,
            Self::Gaussian { stddev } => {
                let of = |x: f64| math::exp(-x * x / (2.0 * stddev * stddev));
                (of(x) - of(self.radius())).max(0.0)
            }
        }
    }
}

/// What samples weigh in the pixels around theirs.
#[derive(Clone, Debug)]
pub(super) struct FilterTable {
    filter: ReconstructionFilter,
    /// Pixels to each side that a sample can reach.
    pub reach: i64,
    /// Mean of the weight over a pixel whose centre is 0, 1, 2 … pixels away.
    whole: Vec<f64>,
}

/// Points per axis to average the filter over a pixel: far below the rounding of the picture.
const POINTS: usize = 64;

impl FilterTable {
    pub fn new(filter: ReconstructionFilter) -> Self {
        // A sample half a pixel off its centre reaches as far as the radius allows.
        let reach = (filter.radius() + 0.5).ceil() as i64 - 1;
        let whole = (0..=reach)
            .map(|d| {
                let at = |i: usize| d as f64 + (i as f64 + 0.5) / POINTS as f64 - 0.5;
                (0..POINTS).map(|i| filter.weight(at(i))).sum::<f64>() / POINTS as f64
            })
            .collect();
        Self { filter, reach, whole }
    }

    /// Mean weight along one axis of a whole pixel that is `d` pixels away.
    pub fn whole(&self, d: i64) -> f64 {
        self.whole.get(d.unsigned_abs() as usize).copied().unwrap_or(0.0)
    }

    /// Weight along one axis of a sample at `at` ∈ [0, 1) of a pixel that is `d` pixels to the right
    /// of the one looked at.
    pub fn point(&self, d: i64, at: f64) -> f64 {
        self.filter.weight(d as f64 + at - 0.5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [ReconstructionFilter; 4] = [
        ReconstructionFilter::Box,
        ReconstructionFilter::Tent { radius: 1.0 },
        ReconstructionFilter::Gaussian { stddev: 0.5 },
        ReconstructionFilter::Gaussian { stddev: 1.3 },
    ];

    #[test]
    fn whole_pixels_add_up_to_the_filter() {
        for filter in ALL {
            let table = FilterTable::new(filter);
            let sum: f64 = (-table.reach..=table.reach).map(|d| table.whole(d)).sum();
            let r = filter.radius();
            let n = 100_000;
            let step = 2.0 * r / f64::from(n);
            let integral: f64 =
                (0..n).map(|i| filter.weight(-r + (f64::from(i) + 0.5) * step) * step).sum();
            assert!((sum - integral).abs() < 1e-3 * integral, "{filter:?} {sum} {integral}");
            assert_eq!(table.whole(table.reach + 1), 0.0);
        }
    }

    #[test]
    fn points_reach_no_further_than_stated() {
        for filter in ALL {
            let table = FilterTable::new(filter);
            for at in [0.01, 0.5, 0.99] {
                assert_eq!(table.point(table.reach + 1, at), 0.0, "{filter:?}");
                assert_eq!(table.point(-table.reach - 1, at), 0.0, "{filter:?}");
            }
        }
        let boxed = FilterTable::new(ReconstructionFilter::Box);
        assert_eq!(boxed.reach, 0);
        assert_eq!((boxed.point(0, 0.0), boxed.point(0, 0.99)), (1.0, 1.0));
    }
}
