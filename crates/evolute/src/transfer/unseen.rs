//! What a receiver's light lacks when it is given up early, and what that can be worth at most.
//!
//! Nothing passive makes a lamp brighter than it is, but for the ratio of n² between the media at both
//! ends: whatever was not looked at is worth no more than the brightest lamp over the directions in
//! question.

use std::cell::Cell;
use std::f64::consts::PI;

use super::Transfer;
use super::diffuse::{lambert, polygons};
use super::settings::{Receiver, Stop};
use super::word::WordId;
use crate::geometry::Aabb;
use crate::scene::ShapeId;

/// Divisions between two questions whether to stop: some ten thousand rays at most, and the clock is
/// read for a small share of the work.
const DIVISIONS: u32 = 16;

/// Asks whether to stop, and never again once the answer was yes: every *yes* leaves something out.
pub struct Brake<'c> {
    stop: Stop<'c>,
    pulled: Cell<bool>,
    divisions: Cell<u32>,
}

impl<'c> Brake<'c> {
    /// Nothing was asked yet.
    pub fn new(stop: Stop<'c>) -> Self {
        Self { stop, pulled: Cell::new(false), divisions: Cell::new(0) }
    }

    /// Whether to stop, asked before a word or a term.
    pub fn asked(&self) -> bool {
        if !self.pulled.get() {
            self.pulled.set((self.stop)());
        }
        self.pulled.get()
    }

    /// Whether to stop, asked before a division; passes on every [`DIVISIONS`]-th question.
    pub fn asked_at_division(&self) -> bool {
        let count = self.divisions.get() + 1;
        self.divisions.set(count % DIVISIONS);
        if count == DIVISIONS { self.asked() } else { self.pulled.get() }
    }

    /// Whether anything was left out because the answer was yes.
    pub fn was_pulled(&self) -> bool {
        self.pulled.get()
    }
}

/// A part of the light that was not looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unseen {
    /// What a lamp sends directly.
    Lamp(ShapeId),
    /// What comes by chains that meet a surface first.
    First(ShapeId),
    /// What comes by a word and by all that continue it.
    Through(WordId),
}

/// All parts that were not looked at, each with what it can be worth at most [W/m²].
pub struct UnseenParts {
    parts: Vec<(Unseen, f64)>,
    most: f64,
}

impl UnseenParts {
    /// None; together they will be worth no more than `most` [W/m²].
    pub fn up_to(most: f64) -> Self {
        Self { parts: Vec::new(), most }
    }

    /// Adds a part with its bound, unless it is there already.
    pub fn add(&mut self, part: Unseen, bound: impl FnOnce() -> f64) {
        if !self.parts.iter().any(|(p, _)| *p == part) {
            self.parts.push((part, bound()));
        }
    }

    /// What all of them can be worth.
    pub fn error(&self) -> f64 {
        self.parts.iter().map(|(_, bound)| bound).sum::<f64>().min(self.most)
    }
}

impl Transfer<'_> {
    /// Luminance of the brightest lamp [W/(m² sr)].
    pub(super) fn brightest(&self) -> f64 {
        self.lamps.iter().fold(0f64, |m, l| m.max(l.radiance.luminance()))
    }

    /// The most that a lamp can send directly [W/m²].
    pub(super) fn most_from(&self, receiver: &Receiver, lamp: ShapeId) -> f64 {
        let shape = self.scene.shape(lamp);
        let around = projected(receiver, &shape.surface.bounds());
        let seen = polygons(&shape.surface).map_or(around, |parts| {
            parts.iter().map(|corners| lambert(receiver, corners)).sum::<f64>().min(around)
        });
        shape.radiance.luminance() * seen
    }

    /// The most that can come by chains that meet a surface first [W/m²].
    pub(super) fn most_by(&self, receiver: &Receiver, first: ShapeId) -> f64 {
        self.most_radiance() * projected(receiver, &self.scene.shape(first).surface.bounds())
    }

    /// The most that can come at all [W/m²].
    pub(super) fn most(&self) -> f64 {
        PI * self.most_radiance()
    }

    /// The brightest lamp as it would look from inside the densest medium [W/(m² sr)].
    fn most_radiance(&self) -> f64 {
        let brighter = self
            .scene
            .shapes
            .iter()
            .filter_map(|s| s.material.dielectric)
            .map(|d| d.interior_ior / d.exterior_ior)
            .fold(1f64, |m, n| m.max(n * n).max(1.0 / (n * n)));
        self.brightest() * brighter
    }
}

/// The most of ∫ cos θ dω [sr] over whatever lies in a box: that of the ball around it, faced.
fn projected(receiver: &Receiver, bounds: &Aabb) -> f64 {
    let to = bounds.centre() - receiver.position;
    if bounds.corners().iter().all(|c| (c - receiver.position).dot(&receiver.normal) <= 0.0) {
        return 0.0;
    }
    let radius = 0.5 * bounds.diagonal();
    let sine_squared = radius * radius / to.norm_squared();
    if sine_squared < 1.0 { PI * sine_squared } else { PI }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicU32, Ordering};

    use super::*;
    use crate::geometry::{Point3, UnitVector3, Vector3};

    fn facing_up() -> Receiver {
        Receiver {
            position: Point3::origin(),
            normal: UnitVector3::new_normalize(Vector3::new(0.0, 0.0, 1.0)),
        }
    }

    fn cube(x: f64, y: f64, z: f64) -> Aabb {
        Aabb::around([
            Point3::new(x - 0.5, y - 0.5, z - 0.5),
            Point3::new(x + 0.5, y + 0.5, z + 0.5),
        ])
    }

    #[test]
    fn boxes_before_beside_around_and_behind() {
        // The ball around a unit cube has the radius √3/2.
        assert!((projected(&facing_up(), &cube(0.0, 0.0, 3.0)) - PI * 0.75 / 9.0).abs() < 1e-15);
        assert!((projected(&facing_up(), &cube(3.0, 0.0, 0.0)) - PI * 0.75 / 9.0).abs() < 1e-15);
        assert_eq!(projected(&facing_up(), &cube(0.0, 0.0, 0.0)), PI);
        assert_eq!(projected(&facing_up(), &cube(0.0, 0.0, -0.5)), 0.0);
        assert_eq!(projected(&facing_up(), &Aabb::around([Point3::origin()])), 0.0);
    }

    #[test]
    fn a_brake_asks_at_every_sixteenth_division_and_stays_pulled() {
        let asked = AtomicU32::new(0);
        let stop = || asked.fetch_add(1, Ordering::Relaxed) == 1;
        let brake = Brake::new(&stop);
        let before = (0..100).take_while(|_| !brake.asked_at_division()).count();
        assert_eq!(before, 31);
        assert!(brake.asked() && brake.asked_at_division() && brake.was_pulled());
        assert_eq!(asked.into_inner(), 2);
    }

    #[test]
    fn a_part_counts_once_and_all_no_more_than_all_there_is() {
        let mut parts = UnseenParts::up_to(2.75);
        parts.add(Unseen::First(ShapeId(1)), || 2.0);
        parts.add(Unseen::First(ShapeId(1)), || 3.0);
        parts.add(Unseen::Lamp(ShapeId(1)), || 0.5);
        assert_eq!(parts.error(), 2.5);
        parts.add(Unseen::Lamp(ShapeId(2)), || 0.5);
        assert_eq!(parts.error(), 2.75);
    }
}
