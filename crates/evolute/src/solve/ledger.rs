//! Where the emitted flux is.

use serde::{Deserialize, Serialize};

use crate::geometry::Rgb;
use crate::trace::tree::Losses;

/// Fluxes [W]. What was emitted is the sum of all others at every step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    /// By lamps.
    pub emitted: Rgb,
    /// By diffuse surfaces where they received it, and by specular and black ones on its way.
    pub absorbed: Rgb,
    /// Into the open.
    pub escaped: Rgb,
    /// Waits on diffuse surfaces to be shot.
    pub unshot: Rgb,
    /// Was in branches that were cut.
    pub cut: Rgb,
    /// Shot and not received: what meshes and cubatures lose, or add.
    pub discretisation: Rgb,
}

impl Ledger {
    /// Emitted less all others: zero but for rounding.
    pub fn imbalance(&self) -> Rgb {
        let known = self.absorbed + self.escaped + self.unshot + self.cut + self.discretisation;
        self.emitted - known
    }

    /// Whether all are finite numbers.
    pub(super) fn is_finite(&self) -> bool {
        let Self { emitted, absorbed, escaped, unshot, cut, discretisation } = self;
        [emitted, absorbed, escaped, unshot, cut, discretisation].iter().all(|f| f.is_finite())
    }

    /// Enters a shot: `received` of it was, of which `absorbed` stayed and the rest waits.
    pub(super) fn shoot(&mut self, shot: Rgb, losses: &Losses, received: Rgb, absorbed: Rgb) {
        self.absorbed += losses.absorbed + absorbed;
        self.escaped += losses.escaped;
        self.cut += losses.cut;
        self.unshot += received - absorbed;
        self.discretisation += shot - losses.sum() - received;
    }
}
