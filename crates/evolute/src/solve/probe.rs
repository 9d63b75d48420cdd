//! All light at any receiver: that of lamps computed, that of diffuse surfaces gathered from a solution.

use super::{Outcome, limits};
use crate::geometry::Rgb;
use crate::scene::Scene;
use crate::trace::Tracer;
use crate::trace::tree::Limits;
use crate::transfer::{
    Components, Counts, Gathered, HemisphereSettings, Receiver, Stop, Transfer, TransferSettings,
};

/// What a receiver gets [W/m²], and how well it is known.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ProbeLight {
    /// From lamps directly.
    pub direct: Rgb,
    /// From lamps by specular chains.
    pub specular: Rgb,
    /// By way of diffuse surfaces.
    pub indirect: Rgb,
    /// Estimated absolute error of the luminance of the sum of what was asked for.
    pub error: f64,
    /// Whether that is within the tolerance.
    pub met: bool,
    /// Whether it was given up early because it was told to stop.
    pub stopped: bool,
    /// The work it took.
    pub counts: Counts,
}

impl ProbeLight {
    /// The sum of the parts.
    pub fn total(&self) -> Rgb {
        self.direct + self.specular + self.indirect
    }
}

/// Computes what receivers get. Each is on its own: its bits depend on the scene, the settings and the solution, not on
/// other receivers or threads.
pub struct Probe<'p> {
    tracer: &'p Tracer<'p>,
    settings: TransferSettings,
    lamps: Transfer<'p>,
    components: Components,
    indirect: Option<&'p Outcome<'p>>,
    limits: Limits,
}

/// Part of the tolerance that is for the light of lamps where indirect light is asked for, too.
const LAMPS: f64 = 0.5;

/// Part of the tolerance that is for gathering, however little the solution and the lamps leave of it: to know the one
/// far better than the others helps nobody.
const LEAST: f64 = 0.25;

/// Most samples of a hemisphere.
const MAX_SAMPLES: usize = 20_000;

impl<'p> Probe<'p> {
    /// For the parts of the lamps' own light that are asked for, and for indirect light if there is an outcome. The
    /// tolerance is the settings' for the sum.
    pub fn new(
        scene: &'p Scene,
        tracer: &'p Tracer<'p>,
        settings: &TransferSettings,
        components: Components,
        indirect: Option<&'p Outcome<'p>>,
    ) -> Self {
        let share = if indirect.is_some() { LAMPS } else { 1.0 };
        let of_lamps = TransferSettings {
            relative: share * settings.relative,
            absolute: share * settings.absolute,
            ..*settings
        };
        Self {
            tracer,
            settings: *settings,
            lamps: Transfer::new(scene, tracer, of_lamps),
            components,
            indirect,
            limits: limits(settings),
        }
    }

    /// The irradiance at a receiver, given up when `stop` says so: then what is known, not met and marked as stopped.
    ///
    /// The error is the sum of four: of the lamps' light, of the cubature over the hemisphere, of the light on the
    /// meshes where it is gathered from ([`super::Solution::uncertainty`]), and of flux that is missing on them
    /// ([`Outcome::missing`]). What a cubature's first samples miss altogether is in none of them.
    pub fn light(&self, receiver: &Receiver, stop: Stop<'_>) -> ProbeLight {
        let Some(outcome) = self.indirect else {
            let light = self.lamps.light_until(receiver, self.components, 0.0, stop);
            return ProbeLight {
                direct: light.direct,
                specular: light.specular,
                indirect: Rgb::BLACK,
                error: light.error,
                met: light.met,
                stopped: light.stopped,
                counts: light.counts,
            };
        };
        let solution = &outcome.solution;
        let gather = |tolerance| {
            let settings =
                HemisphereSettings { limits: self.limits, tolerance, max_samples: MAX_SAMPLES };
            solution.gather(self.tracer, receiver, &settings)
        };
        // The coarsest: lamps need not be known better than what comes otherwise demands.
        let mut gathered = gather(f64::INFINITY);
        let mut rays = gathered.rays;
        let beside = LAMPS * self.settings.relative * gathered.irradiance.luminance();
        let mut light = ProbeLight { met: true, ..ProbeLight::default() };
        if self.components.direct || self.components.specular {
            let lamps = self.lamps.light_until(receiver, self.components, beside, stop);
            light.direct = lamps.direct;
            light.specular = lamps.specular;
            light.error = lamps.error;
            light.stopped = lamps.stopped;
            light.counts = lamps.counts;
        }
        let of_lamps = light.direct + light.specular;
        let tolerance = |indirect: Rgb| {
            let sum = (of_lamps + indirect).luminance();
            (self.settings.relative * sum).max(self.settings.absolute)
        };
        let uncertainty = |gathered: &Gathered| {
            let light = gathered.irradiance.luminance();
            solution.uncertainty(&gathered.row) + outcome.missing(light)
        };
        if !light.stopped {
            let all = tolerance(gathered.irradiance);
            let left = (all - light.error - uncertainty(&gathered)).max(LEAST * all);
            if gathered.error > left {
                gathered = gather(left);
                rays += gathered.rays;
            }
        }
        light.indirect = gathered.irradiance;
        light.error += gathered.error + uncertainty(&gathered);
        light.met = !light.stopped && light.error <= tolerance(light.indirect);
        light.counts.rays += rays;
        light
    }
}
