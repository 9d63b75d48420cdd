//! Light at a receiver: direct and specular irradiance with an error estimate (Yu & Wu (7) to (16)).
//!
//! Every receiver is on its own: what it gets depends on the scene and the settings, not on other
//! receivers or threads.

mod beam;
mod boundary;
mod bright;
mod chain;
mod control;
mod criteria;
mod cut;
mod diffuse;
mod domain;
mod doubt;
mod estimate;
mod extension;
mod fan;
mod field;
mod grid;
mod hemisphere;
mod interpolant;
mod lamp;
mod landing;
mod left;
mod look;
mod part;
mod placement;
mod polynomial;
mod quadrature;
mod scout;
mod screen;
mod settings;
mod shadow;
mod shaft;
mod spared;
mod specular;
mod store;
mod unseen;
mod window;
mod word;

pub use bright::{Bright, Shining};
pub use chain::{Event, Step};
pub use control::{Control, Order};
pub use criteria::{Criteria, MatchingTrees, NormalVariation, QuadratureAccuracy, SolidAngle};
pub use diffuse::lambert;
pub use hemisphere::{Gathered, HemisphereSettings, Link, Row, gather};
pub use settings::{
    Components, Counts, LONGEST_CHAIN, Receiver, ReceiverLight, Stop, TransferSettings, WordShare,
};

use std::sync::Arc;

use crate::scene::Scene;
use crate::trace::Tracer;
use lamp::Lamp;
use screen::Screens;

/// Computes what reaches receivers of one scene. Shared by threads; a result depends on nothing but
/// the scene, the settings and the receiver.
pub struct Transfer<'s> {
    scene: &'s Scene,
    tracer: &'s Tracer<'s>,
    settings: TransferSettings,
    lamps: Arc<[Lamp]>,
    screens: Arc<Screens>,
}

impl<'s> Transfer<'s> {
    /// Prepares what all receivers share.
    pub fn new(scene: &'s Scene, tracer: &'s Tracer<'s>, settings: TransferSettings) -> Self {
        let screens = Arc::new(Screens::of(scene));
        Self { scene, tracer, settings, lamps: Lamp::of(scene).into(), screens }
    }

    /// The irradiance at a receiver, in the parts asked for.
    pub fn light(&self, receiver: &Receiver, components: Components) -> ReceiverLight {
        self.gather(receiver, components, &|| false).0
    }

    /// The irradiance at a receiver, given up when `stop` says so: then the light so far, not met and
    /// marked as stopped, with an error that covers what was not looked at. The tolerance does not fall
    /// below `absolute` [W/m²]: for parts of a sum whose other parts are known.
    ///
    /// As long as `stop` says no, the bits are those of [`Self::light`].
    pub fn light_until(
        &self,
        receiver: &Receiver,
        components: Components,
        absolute: f64,
        stop: Stop<'_>,
    ) -> ReceiverLight {
        let absolute = self.settings.absolute.max(absolute);
        let settings = TransferSettings { absolute, ..self.settings };
        let (lamps, screens) = (self.lamps.clone(), self.screens.clone());
        Self { settings, lamps, screens, ..*self }.gather(receiver, components, stop).0
    }

    /// The irradiance at a receiver, and its specular part by word.
    pub fn light_by_word(
        &self,
        receiver: &Receiver,
        components: Components,
    ) -> (ReceiverLight, Vec<WordShare>) {
        self.gather(receiver, components, &|| false)
    }
}
