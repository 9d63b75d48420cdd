//! Small bright places: a caustic on a table is brighter than the room and smaller than the first cells of a hemisphere.

use crate::geometry::{Point3, Rgb, UnitVector3};
use crate::trace::tree::Leaf;

use super::settings::Receiver;

/// A place that shines more than what is around it, or less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bright {
    /// Its middle, by flux [m].
    pub position: Point3,
    /// The side that shines.
    pub normal: UnitVector3,
    /// Root mean square distance of its flux from its middle [m].
    pub radius: f64,
    /// What it sends beyond what its surroundings would, without sign; luminance [W].
    pub flux: f64,
}

impl Bright {
    /// Irradiance that it brings to a receiver where nothing is in the way, luminance [W/m²]: as if it were a point, at no
    /// less than its radius.
    pub fn irradiance(&self, receiver: &Receiver) -> f64 {
        let away = self.position - receiver.position;
        let square = away.norm_squared();
        let cosines = receiver.normal.dot(&away) * -self.normal.dot(&away);
        if receiver.normal.dot(&away) <= 0.0 || cosines <= 0.0 {
            return 0.0;
        }
        let square = square.max(self.radius * self.radius);
        self.flux * cosines / (square * square * std::f64::consts::PI)
    }

    /// Solid angle that it fills there, if it is a disk: twice its mean square radius times π is its area.
    pub fn solid_angle(&self, receiver: &Receiver) -> f64 {
        let away = self.position - receiver.position;
        let cosine = (-self.normal.dot(&away) / away.norm()).max(0.0);
        std::f64::consts::TAU * self.radius * self.radius * cosine / away.norm_squared()
    }
}

/// What shines on receivers.
#[derive(Clone, Copy)]
pub struct Shining<'s> {
    /// Radiosity of a surface point [W/m²].
    pub radiosity: &'s (dyn Fn(&Leaf) -> Rgb + Sync),
    /// Where it is much more than around.
    pub bright: &'s [Bright],
}
