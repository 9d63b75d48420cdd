//! What the patches of one layer have shot, and where it goes.

use std::ops::AddAssign;

use rayon::prelude::*;

use super::layer::Layer;
use super::transport::{Fate, Patch, Transport};
use crate::geometry::Rgb;

/// How light leaves a patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Way {
    /// To diffuse surfaces.
    Straight,
    /// To specular surfaces, and on from there.
    Specular,
}

impl Fate {
    /// The part of the flux that goes one way.
    pub fn share(&self, way: Way) -> Rgb {
        match way {
            Way::Straight => self.straight,
            Way::Specular => Rgb::WHITE - self.straight,
        }
    }
}

/// What patches send one way, and what vertices receive of it by their rows [W].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Balance {
    /// All light that patches reflect now, whether it was shot or waits.
    sent: Rgb,
    received: Rgb,
    /// What of it waits.
    waiting: Rgb,
}

impl AddAssign for Balance {
    fn add_assign(&mut self, other: Self) {
        self.sent += other.sent;
        self.received += other.received;
        self.waiting += other.waiting;
    }
}

impl Balance {
    /// The factor on what is received that makes it what is sent, and what earlier shots `owe` [W]. Rows are integrated
    /// each on its own, and meshes have their errors: a few tenths of a percent are lost or won at each bounce, and in a
    /// bright room that adds up. How much is sent is known.
    ///
    /// All light counts, not only what is about to shoot: of some patches rows see too little, and too much of others.
    /// A row as a whole is right, so that a vertex receives what it should if all patches have the same factor. One
    /// for each group that shoots together made corners, which see their neighbours more than the rest, 2 % too dark on
    /// coarse meshes.
    pub fn factor(&self, owed: Rgb) -> Rgb {
        Rgb(std::array::from_fn(|i| {
            let ratio = self.sent[i] / self.received[i];
            let repaid = owed[i] / self.waiting[i];
            // Where nothing is sent or waits, or rounding is all there is, nothing is to be mended.
            let repaid = if repaid.is_finite() { repaid.clamp(-MOST_OWED, MOST_OWED) } else { 0.0 };
            let factor = ratio * (1.0 + repaid);
            if factor.is_finite() && factor > 0.0 {
                factor.clamp(1.0 / MOST_CORRECTED, MOST_CORRECTED)
            } else {
                1.0
            }
        }))
    }
}

/// The patches of one layer as they shoot.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub transport: Transport,
    /// By way, patch and corner: radiosity that was shot [W/m²].
    pub shot: [Vec<[Rgb; 3]>; 2],
    /// By way, patch and corner: flux that vertices receive of a radiosity of 1 there, by their rows [m²].
    reach: [Vec<[Rgb; 3]>; 2],
    /// By way: factor on what is received.
    pub factors: [Rgb; 2],
}

/// Rows may be wrong by this factor before what they lose is no longer made up for.
const MOST_CORRECTED: f64 = 2.0;

/// What earlier shots owe counts up to this part of what waits: what groups of patches owe each other evens out by
/// itself, and is more than that.
const MOST_OWED: f64 = 0.02;

impl Source {
    /// Patches that have not shot; `area` by vertex that receives [m²].
    pub fn new(transport: Transport, patches: usize, area: &[f64]) -> Self {
        let none = vec![[Rgb::BLACK; 3]; patches];
        let mut reach = [none.clone(), none.clone()];
        for p in 0..patches {
            for entry in transport.straight(p as Patch) {
                for c in 0..3 {
                    let flux = f64::from(entry.weights[c]) * area[entry.vertex as usize];
                    reach[0][p][c] += Rgb::grey(flux);
                }
            }
            for entry in transport.specular(p as Patch) {
                for c in 0..3 {
                    let weight = Rgb(entry.weights[c].map(f64::from));
                    reach[1][p][c] += weight * area[entry.vertex as usize];
                }
            }
        }
        Self { transport, shot: [none.clone(), none], reach, factors: [Rgb::WHITE; 2] }
    }

    /// Factor on what is received by one way.
    pub fn factor(&self, way: Way) -> Rgb {
        self.factors[way as usize]
    }

    /// What patches have to send one way.
    pub fn balance(&self, layer: &Layer<'_>, way: Way) -> Balance {
        let of = |p: usize| {
            let mut balance = Balance::default();
            let (corners, all) = (&layer.patches[p], layer.corners(p));
            let shot = &self.shot[way as usize][p];
            for c in 0..3 {
                let fate = &self.transport.fates[corners.vertices[c] as usize];
                let arrives = fate.share(way) - fate.losses[way as usize].sum();
                balance.sent += all[c] * arrives * corners.weights[c];
                balance.received += all[c] * self.reach[way as usize][p][c];
                balance.waiting += (all[c] - shot[c]) * arrives * corners.weights[c];
            }
            balance
        };
        // Summed in the order of the patches, whatever the number of threads.
        let each: Vec<Balance> = (0..layer.patches.len()).into_par_iter().map(of).collect();
        each.into_iter().fold(Balance::default(), |mut sum, of| {
            sum += of;
            sum
        })
    }

    /// What waits at a patch's corners [W/m²].
    pub fn unshot(&self, layer: &Layer<'_>, patch: usize, way: Way) -> [Rgb; 3] {
        let (corners, shot) = (layer.corners(patch), &self.shot[way as usize][patch]);
        [0, 1, 2].map(|c| corners[c] - shot[c])
    }

    /// What waits, which is taken to be shot by now.
    pub fn take(&mut self, layer: &Layer<'_>, patch: usize, way: Way) -> [Rgb; 3] {
        let unshot = self.unshot(layer, patch, way);
        self.shot[way as usize][patch] = layer.corners(patch);
        unshot
    }

    /// Flux that waits at a patch, by the way that it will go, luminances [W].
    pub fn waiting(&self, layer: &Layer<'_>, patch: usize) -> [f64; 2] {
        let (corners, all) = (&layer.patches[patch], layer.corners(patch));
        let fates = corners.vertices.map(|v| &self.transport.fates[v as usize]);
        [Way::Straight, Way::Specular].map(|way| {
            let shot = &self.shot[way as usize][patch];
            let flux = |c: usize| (all[c] - shot[c]) * fates[c].share(way) * corners.weights[c];
            (flux(0) + flux(1) + flux(2)).luminance()
        })
    }
}
