//! What the first pass leaves, with all that there is to say about it.

use super::{Component, Ledger, MOST_REFLECTED, Solution, Solver, SolverCounts, SolverSettings};

/// A solution, what was asked of it, and what it took.
#[derive(Clone, Debug)]
pub struct Outcome<'s> {
    /// What was asked.
    pub settings: SolverSettings,
    /// Meshes and light.
    pub solution: Solution<'s>,
    /// Where the flux is.
    pub ledger: Ledger,
    /// Work and sizes.
    pub counts: SolverCounts,
    /// Whether it is all that was asked for: meshes and rows are as fine, and what waits to be shot does not matter. A
    /// limit may have come first.
    pub is_complete: bool,
}

impl Outcome<'_> {
    /// What indirect light of some luminance is uncertain by because flux is missing [W/m²]: it was not shot, or was in
    /// branches that were cut, and would have been reflected on as all light is in the mean. It is taken to be missing in
    /// proportion to the light that there is, twice as much in one place as in the mean; of a solution that is not complete, for which flux of the lamps may be
    /// missing, too, at least as much as if it were spread evenly.
    pub fn missing(&self, light: f64) -> f64 {
        let Ledger { unshot, cut, discretisation, .. } = &self.ledger;
        let mut flux = unshot.luminance().abs() + cut.luminance().abs();
        let received: f64 =
            self.solution.layers.iter().map(|layer| layer.flux().0.luminance()).sum();
        let (area, reflected) = self.solution.layer(Component::Indirect).area_and_reflectance();
        let on = UNEVEN / (1.0 - reflected.min(MOST_REFLECTED));
        let of = |x: f64| if x.is_finite() { x } else { 0.0 };
        if self.is_complete {
            return of(flux * on * light / received);
        }
        flux += discretisation.luminance().abs();
        of(flux * on * light / received).max(of(flux * on / area))
    }
}

/// How much more of its light may be missing in one place than in the mean.
const UNEVEN: f64 = 2.0;

impl<'s> Solver<'s> {
    /// Makes the solution ready to be read. To be called after the last step.
    pub fn into_outcome(mut self) -> Outcome<'s> {
        self.finish();
        Outcome {
            settings: self.settings,
            ledger: self.ledger,
            counts: self.counts,
            is_complete: self.complete && self.rests,
            solution: self.solution,
        }
    }
}
