//! Light on the diffuse surfaces that the eye sees.

use crate::geometry::Rgb;
use crate::scene::Scene;
use crate::solve::{Component, Solution};
use crate::trace::Tracer;
use crate::trace::tree::{Leaf, Limits};
use crate::transfer::{
    Components, Counts, HemisphereSettings, LONGEST_CHAIN, Receiver, Stop, Transfer,
    TransferSettings,
};

/// The parts of the irradiance that are computed on their own: most edges are edges of one of them. What is dear
/// comes last: the more is known of a place, the less finely must the rest be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// From lamps directly.
    Direct,
    /// By way of other diffuse surfaces.
    Indirect,
    /// From lamps by specular chains.
    Specular,
}

impl Part {
    /// In the order in which they are computed.
    pub const ALL: [Self; 3] = [Self::Direct, Self::Indirect, Self::Specular];

    /// For people who wait for it.
    pub fn stage(self) -> &'static str {
        match self {
            Self::Direct => "direct light in the picture",
            Self::Indirect => "indirect light in the picture",
            Self::Specular => "specular light in the picture",
        }
    }
}

/// One part of the irradiance at one place.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PartLight {
    /// [W/m²]
    pub irradiance: Rgb,
    /// Estimated error of its luminance [W/m²].
    pub error: f64,
    /// Whether that is within the tolerance.
    pub met: bool,
    /// Whether it was given up.
    pub stopped: bool,
    pub counts: Counts,
}

/// What may be off in the light on the leaves of one place of the film: shared out half as they shine and half
/// evenly, so that what shows little of itself need not be known well.
pub(super) struct Allowance {
    /// Luminance of all that is known to show there, or what still counts as dark [W/(m² sr)].
    seen: f64,
    leaves: f64,
}

impl Allowance {
    /// For leaves of which `known` irradiance [W/m²] shows; radiance below `dark` [W/(m² sr)] does not count.
    pub fn new(leaves: &[Leaf], known: &[Rgb], dark: f64) -> Self {
        let seen: f64 = leaves.iter().zip(known).map(|(l, e)| l.radiance(*e).luminance()).sum();
        Self { seen: seen.max(dark), leaves: leaves.len() as f64 }
    }

    /// Irradiance of which a part may be off [W/m²], at a leaf that receives at least `known`.
    pub fn share(&self, leaf: &Leaf, known: Rgb) -> f64 {
        let even = self.seen / (self.leaves * leaf.radiance(Rgb::grey(1.0)).max());
        let shines = known.luminance();
        if even.is_finite() { 0.5 * (shines + even) } else { shines }
    }
}

/// Computes irradiance at leaves. A scene's `max_depth` limits the chain from the lamp together with
/// the chain to the eye, so there is one transfer for each length that may be left over.
pub(super) struct Lighting<'s> {
    /// By the longest chain allowed from the lamp; one only if nothing limits them jointly.
    transfers: Vec<Transfer<'s>>,
    /// `max_depth` − 1: most interactions of a whole path, the diffuse one included.
    interactions: Option<u32>,
    /// Whether any chain is allowed at all.
    specular: bool,
    indirect: Option<Indirect<'s>>,
}

/// Where indirect light comes from, and how finely it is gathered.
#[derive(Clone, Copy)]
pub(super) struct Indirect<'s> {
    pub tracer: &'s Tracer<'s>,
    pub solution: &'s Solution<'s>,
    pub limits: Limits,
    /// Relative accuracy of what is gathered, and the tolerance that it need not fall below [W/m²].
    pub relative: f64,
    pub absolute: f64,
}

/// Errors of interpolation on a mesh up to which it is read off, in tolerances: the largest estimated around a place. At
/// three, light at the feet of things was off by four hundredths; at one, a third more is gathered for nothing.
const READ: f64 = 2.0;

/// Most samples of a hemisphere.
const MAX_SAMPLES: usize = 20_000;

impl Indirect<'_> {
    /// What a part may be off by, if it is as the meshes say and the other light there lets it be off by `others`,
    /// luminance [W/m²].
    fn tolerance(&self, irradiance: Rgb, others: f64) -> f64 {
        (self.relative * irradiance.luminance() + others).max(self.absolute)
    }

    /// What the meshes say of a part, if interpolation is good enough there, where the other light there lets it be off by
    /// `absolute` [W/m²]. What they hold at their vertices was computed as accurately as it would be here.
    fn of_mesh(&self, leaf: &Leaf, part: Part, absolute: f64) -> Option<PartLight> {
        let component = match part {
            Part::Direct => return None,
            Part::Specular => Component::Specular,
            Part::Indirect => Component::Indirect,
        };
        let (irradiance, error) =
            self.solution.component_at(self.tracer.scene(), leaf, component)?;
        let tolerance = self.tolerance(irradiance, absolute);
        let read = PartLight { irradiance, error, met: true, ..PartLight::default() };
        (error <= READ * tolerance).then_some(read)
    }

    /// What comes to a leaf by way of other diffuse surfaces, where the other light there lets it be off by `absolute`
    /// [W/m²].
    fn light(&self, leaf: &Leaf, absolute: f64) -> PartLight {
        let receiver = Receiver { position: leaf.anchor.point.x, normal: leaf.normal };
        let of_mesh = self.solution.component_at(self.tracer.scene(), leaf, Component::Indirect);
        let tolerance = self.tolerance(of_mesh.map_or(Rgb::BLACK, |m| m.0), absolute);
        if let Some(known) = self.of_mesh(leaf, Part::Indirect, absolute) {
            return known;
        }
        let settings =
            HemisphereSettings { limits: self.limits, tolerance, max_samples: MAX_SAMPLES };
        let gathered = self.solution.gather(self.tracer, &receiver, &settings);
        PartLight {
            irradiance: gathered.irradiance,
            error: gathered.error,
            met: gathered.met,
            stopped: false,
            counts: Counts { rays: gathered.rays, ..Counts::default() },
        }
    }
}

impl<'s> Lighting<'s> {
    pub fn new(
        scene: &'s Scene,
        tracer: &'s Tracer<'s>,
        settings: &TransferSettings,
        indirect: Option<Indirect<'s>>,
    ) -> Self {
        let with = |max_specular| {
            Transfer::new(scene, tracer, TransferSettings { max_specular, ..*settings })
        };
        let interactions = scene.max_depth.map(|d| d.saturating_sub(1));
        let transfers = match interactions {
            // The diffuse interaction takes one.
            Some(n) if n.saturating_sub(1) < settings.max_specular.min(LONGEST_CHAIN) => {
                (0..=n.saturating_sub(1)).map(with).collect()
            }
            _ => vec![with(settings.max_specular)],
        };
        Self { transfers, interactions, specular: settings.max_specular > 0, indirect }
    }

    /// Longest chain to the eye that ends on a lamp [interactions].
    pub fn longest_sight(&self, max_specular: u32) -> u32 {
        self.interactions.map_or(max_specular, |n| n.min(max_specular)).min(LONGEST_CHAIN)
    }

    /// Whether anything can come by specular chains.
    pub fn is_specular(&self, scene: &Scene) -> bool {
        self.specular && scene.shapes.iter().any(|s| s.material.is_specular())
    }

    /// One part of the irradiance at a leaf, with a tolerance not below `absolute` [W/m²], given up
    /// when told to stop.
    pub fn light(&self, leaf: &Leaf, part: Part, absolute: f64, stop: Stop<'_>) -> PartLight {
        let nothing = PartLight { met: true, ..PartLight::default() };
        // What the chain to the eye and the diffuse interaction leave for the chain from the lamp.
        let left = match self.interactions {
            None => u32::MAX,
            Some(n) if n <= leaf.depth => return nothing,
            Some(n) => n - leaf.depth - 1,
        };
        let components = match part {
            Part::Direct => Components { direct: true, specular: false },
            Part::Specular if left == 0 || !self.specular => return nothing,
            Part::Specular => Components { direct: false, specular: true },
            Part::Indirect => {
                return self.indirect.map_or(nothing, |indirect| indirect.light(leaf, absolute));
            }
        };
        if part == Part::Specular
            && let Some(indirect) = &self.indirect
            && let Some(known) = indirect.of_mesh(leaf, part, absolute)
        {
            return known;
        }
        let receiver = Receiver { position: leaf.anchor.point.x, normal: leaf.normal };
        let longest = self.transfers.len() - 1;
        let transfer = &self.transfers[longest.min(usize::try_from(left).unwrap_or(longest))];
        let light = transfer.light_until(&receiver, components, absolute, stop);
        PartLight {
            irradiance: light.direct + light.specular,
            error: light.error,
            met: light.met,
            stopped: light.stopped,
            counts: light.counts,
        }
    }
}
