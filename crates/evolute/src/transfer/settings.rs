//! What is asked of a transfer and what it answers.

use serde::{Deserialize, Serialize};

use super::chain::Event;
use super::criteria::Criteria;
use crate::geometry::{Point3, Rgb, UnitVector3};
use crate::scene::ShapeId;

/// An ideal cosine receiver: it occludes nothing and may lie on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Receiver {
    /// Where [m].
    pub position: Point3,
    /// Where it faces.
    pub normal: UnitVector3,
}

/// Which parts of the irradiance are asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Components {
    /// From lamps with no surface in between.
    pub direct: bool,
    /// From lamps by one or more ideal specular interactions.
    pub specular: bool,
}

/// Asked at intervals of some milliseconds whether to give up: `true` stops.
pub type Stop<'c> = &'c (dyn Fn() -> bool + Sync);

/// Longest specular chain that is followed [interactions]: a chain that has lost a twentieth of its
/// light at each of them is down to two millionths.
pub const LONGEST_CHAIN: u32 = 256;

/// How accurate, and where to stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransferSettings {
    /// Tolerance as a fraction of the luminance of the sum of the components asked for.
    pub relative: f64,
    /// Tolerance below which the relative one does not fall [W/m²].
    pub absolute: f64,
    /// Longest specular chain that is asked for [interactions]: what is longer is not wanted. Chains
    /// longer than [`LONGEST_CHAIN`] are not followed even if wanted, and count in the error.
    pub max_specular: u32,
    /// What makes cells be divided.
    pub criteria: Criteria,
    /// Most cells of one receiver; a receiver that needs more is reported as not met.
    pub max_cells: usize,
}

impl Default for TransferSettings {
    fn default() -> Self {
        Self {
            relative: 1e-2,
            absolute: 0.0,
            max_specular: u32::MAX,
            criteria: Criteria::default(),
            // Some hundred times what an ordinary receiver takes at 1e-3.
            max_cells: 40_000,
        }
    }
}

/// What a receiver gets [W/m²], and how well it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReceiverLight {
    /// From lamps directly.
    pub direct: Rgb,
    /// From lamps by specular chains.
    pub specular: Rgb,
    /// Estimated absolute error of the luminance of the sum of what was asked for.
    pub error: f64,
    /// Whether `error` is within the tolerance.
    pub met: bool,
    /// Whether it was given up early because it was told to stop.
    pub stopped: bool,
    /// The work it took.
    pub counts: Counts,
}

/// Work done, in units that do not depend on the machine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Root-to-leaf paths of ray trees that were traced.
    pub chains: u64,
    /// Quadrature cells integrated.
    pub cells: u64,
    /// Rays sent through the tracer (nearest hit and occlusion).
    pub rays: u64,
}

impl std::ops::AddAssign for Counts {
    fn add_assign(&mut self, other: Self) {
        self.chains += other.chains;
        self.cells += other.cells;
        self.rays += other.rays;
    }
}

/// What one word brings to a receiver.
#[derive(Clone, Debug, PartialEq)]
pub struct WordShare {
    /// Surfaces and events from the receiver on.
    pub letters: Vec<(ShapeId, Event)>,
    /// Irradiance [W/m²].
    pub irradiance: Rgb,
    /// Share of the estimated error of the luminance [W/m²].
    pub error: f64,
    /// Chains traced for it and cells integrated, all lamps together.
    pub counts: Counts,
}
