//! Light on the diffuse surfaces that the eye sees.

use crate::geometry::Rgb;
use crate::scene::Scene;
use crate::trace::Tracer;
use crate::trace::tree::Leaf;
use crate::transfer::{
    Components, LONGEST_CHAIN, Receiver, ReceiverLight, Stop, Transfer, TransferSettings,
};

/// The parts of the irradiance that are computed on their own: most edges are edges of one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    /// From lamps directly.
    Direct,
    /// From lamps by specular chains.
    Specular,
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
}

impl<'s> Lighting<'s> {
    pub fn new(scene: &'s Scene, tracer: &'s Tracer<'s>, settings: &TransferSettings) -> Self {
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
        Self { transfers, interactions, specular: settings.max_specular > 0 }
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
    pub fn light(&self, leaf: &Leaf, part: Part, absolute: f64, stop: Stop<'_>) -> ReceiverLight {
        let nothing = ReceiverLight { met: true, ..ReceiverLight::default() };
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
        };
        let receiver = Receiver { position: leaf.anchor.point.x, normal: leaf.normal };
        let longest = self.transfers.len() - 1;
        let transfer = &self.transfers[longest.min(usize::try_from(left).unwrap_or(longest))];
        transfer.light_until(&receiver, components, absolute, stop)
    }
}
