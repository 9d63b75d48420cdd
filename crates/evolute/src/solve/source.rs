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

/// What patches send, straight and to specular surfaces, and what vertices receive of it by their rows [W].
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Balance {
    /// All light that patches reflect now, whether it was shot or waits.
    reflected: Rgb,
    /// What of it comes to diffuse surfaces.
    sent: Rgb,
    received: Rgb,
}

impl AddAssign for Balance {
    fn add_assign(&mut self, other: Self) {
        self.reflected += other.reflected;
        self.sent += other.sent;
        self.received += other.received;
    }
}

impl Balance {
    /// The factor on what is received that makes it what is sent. Rows are integrated
    /// each on its own, and meshes have their errors: a few tenths of a percent are lost or won at each bounce, and in a
    /// bright room that adds up. How much is sent is known.
    ///
    /// There is one for all light, not only for what is about to shoot: of some patches rows see too little, and too much
    /// of others. A row as a whole is right, so that a vertex receives what it should if all patches have the same factor.
    /// One for each group that shoots together made corners, which see their neighbours more than the rest, 2 % too dark
    /// on coarse meshes; one for all specular light scaled by a sixth what was known to a percent, where rows, which are
    /// right to a part of all light, did not know well the little that came elsewhere.
    pub fn factor(&self) -> Rgb {
        Rgb(std::array::from_fn(|i| {
            let factor = self.sent[i] / self.received[i];
            // Where nothing is sent, or rounding is all there is, nothing is to be mended.
            if factor.is_finite() && factor > 0.0 {
                factor.clamp(1.0 / MOST_CORRECTED, MOST_CORRECTED)
            } else {
                1.0
            }
        }))
    }

    /// The part that does not come to diffuse surfaces, of the luminance.
    pub fn lost(&self) -> f64 {
        let all = self.reflected.luminance();
        if all > 0.0 { (1.0 - self.sent.luminance() / all).clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// The patches of one layer as they shoot.
#[derive(Clone, Debug)]
pub(super) struct Source {
    pub transport: Transport,
    /// By way, patch and corner: radiosity that was shot [W/m²].
    pub shot: [Vec<[Rgb; 3]>; 2],
    /// By patch and corner: flux that vertices receive of a radiosity of 1 there, by their rows [m²].
    reach: Vec<[Rgb; 3]>,
}

/// Rows may be wrong by this factor before what they lose is no longer made up for.
const MOST_CORRECTED: f64 = 2.0;

impl Source {
    /// Patches that have not shot; `area` by vertex that receives [m²].
    pub fn new(transport: Transport, patches: usize, area: &[f64]) -> Self {
        let none = vec![[Rgb::BLACK; 3]; patches];
        let mut reach = none.clone();
        for p in 0..patches {
            for entry in transport.straight(p as Patch) {
                for c in 0..3 {
                    let flux = f64::from(entry.weights[c]) * area[entry.vertex as usize];
                    reach[p][c] += Rgb::grey(flux);
                }
            }
            for entry in transport.specular(p as Patch) {
                for c in 0..3 {
                    let weight = Rgb(entry.weights[c].map(f64::from));
                    reach[p][c] += weight * area[entry.vertex as usize];
                }
            }
        }
        Self { transport, shot: [none.clone(), none], reach }
    }

    /// What patches have sent, or will.
    pub fn balance(&self, layer: &Layer<'_>) -> Balance {
        let of = |p: usize| {
            let mut balance = Balance::default();
            let (corners, all) = (&layer.patches[p], layer.corners(p));
            for c in 0..3 {
                let fate = &self.transport.fates[corners.vertices[c] as usize];
                let lost = fate.losses[0].sum() + fate.losses[1].sum();
                let flux = all[c] * corners.weights[c];
                balance.reflected += flux;
                balance.sent += flux * (Rgb::WHITE - lost);
                balance.received += all[c] * self.reach[p][c];
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
