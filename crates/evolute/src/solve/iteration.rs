//! Iterations of the loop of Fig. 4: what shoots next, what it sends to whom, and that flux is conserved (Yu & Wu, 3.2).

use rayon::prelude::*;

use super::source::{Balance, Way};
use super::transport::{Fate, Patch};
use super::{Component, Iteration, MOST_REFLECTED, Scheme, Shooter, Solver};
use crate::geometry::Rgb;
use crate::trace::tree::Losses;

/// What to do next.
enum Plan {
    /// Nothing: what waits does not matter.
    Rest,
    /// Patches to shoot, the last first.
    Diffuse(Vec<Shooter>),
    Specular,
}

/// Part of the tolerance that is for what is never shot.
const UNSHOT: f64 = 0.05;

/// The same at any one place.
const UNSHOT_HERE: f64 = 0.1;

impl Solver<'_> {
    /// Flux that waits at all patches, straight and towards specular surfaces, luminances [W].
    fn waiting(&self) -> Vec<(Shooter, [f64; 2])> {
        let of = |l: usize| {
            let (source, layer) = (&self.sources[l], &self.solution.layers[l]);
            let patches = (0..layer.patches.len()).into_par_iter();
            patches.map(move |p| ((l, p as Patch), source.waiting(layer, p)))
        };
        of(0).chain(of(1)).chain(of(2)).collect()
    }

    /// One turn of the loop of Fig. 4; `None` when what waits no longer matters.
    pub fn step(&mut self) -> Option<Iteration> {
        if self.agenda.is_empty() {
            self.conserve();
            match self.plan() {
                Plan::Rest => {
                    self.rests = true;
                    return None;
                }
                Plan::Specular => {
                    let all = |l: usize| {
                        (0..self.solution.layers[l].patches.len()).map(move |p| (l, p as Patch))
                    };
                    let shooters: Vec<Shooter> = (0..3).flat_map(all).collect();
                    self.shoot(&shooters, Way::Specular);
                    self.counts.specular += 1;
                    return Some(Iteration::Specular);
                }
                Plan::Diffuse(shooters) => self.agenda = shooters,
            }
        }
        let shooter = self.agenda.pop()?;
        self.shoot(&[shooter], Way::Straight);
        if self.settings.scheme == Scheme::Joint {
            self.shoot(&[shooter], Way::Specular);
        }
        self.counts.diffuse += 1;
        Some(Iteration::Diffuse)
    }

    /// What all patches send.
    pub(super) fn balance(&self) -> Balance {
        let mut balance = Balance::default();
        for (source, layer) in self.sources.iter().zip(&self.solution.layers) {
            balance += source.balance(layer);
        }
        balance
    }

    /// Finds the factor by which flux is conserved, of all light as it is now, and brings all that was received so far to
    /// it: what a run ends with does not depend on the way there.
    fn conserve(&mut self) {
        let factor = self.balance().factor();
        let change = factor - self.factor;
        self.factor = factor;
        self.counts.correction = (factor - Rgb::WHITE).map(f64::abs).luminance();
        let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
        for (v, light) in self.received.iter().enumerate() {
            let (flux, kept) = self.solution.indirect_mut().receive(v, *light * change);
            received += flux;
            absorbed += kept;
        }
        self.ledger.shoot(Rgb::BLACK, &Losses::default(), received, absorbed);
    }

    /// What to do next. Looking for the next shooter costs as much as some shots, so that by flux all shoot
    /// that have at least half of the largest, the largest first.
    fn plan(&self) -> Plan {
        let waiting = self.waiting();
        let sums =
            waiting.iter().fold([0.0; 2], |sum, (_, w)| [sum[0] + w[0].abs(), sum[1] + w[1].abs()]);
        let scheme = self.settings.scheme;
        if sums[0] + sums[1] <= self.negligible() {
            return self.plan_places(&waiting);
        }
        if scheme != Scheme::Joint && sums[1] > sums[0] {
            return Plan::Specular;
        }
        let key = |(layer, patch): Shooter, waiting: [f64; 2]| match scheme {
            Scheme::Printed => {
                let source = &self.sources[layer];
                let unshot =
                    source.unshot(&self.solution.layers[layer], patch as usize, Way::Straight);
                unshot.iter().map(Rgb::luminance).sum::<f64>() / 3.0
            }
            // Where interpolation has overshot, less than nothing waits.
            Scheme::Flux => waiting[0].abs(),
            Scheme::Joint => (waiting[0] + waiting[1]).abs(),
        };
        let mut keys: Vec<(f64, Shooter)> =
            waiting.into_iter().map(|(s, w)| (key(s, w), s)).collect();
        // Taken from the end; of equals the lower number first.
        keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let largest = keys.last().map_or(0.0, |k| k.0);
        let first = match scheme {
            Scheme::Printed => keys.len().saturating_sub(1),
            _ => keys.partition_point(|k| k.0 < 0.5 * largest),
        };
        Plan::Diffuse(keys[first..].iter().map(|k| k.1).collect())
    }

    /// The same once what waits in all does not matter, given what waits at each patch: where it still matters.
    fn plan_places(&self, waiting: &[(Shooter, [f64; 2])]) -> Plan {
        let here = self.negligible_here();
        let matters = |(layer, patch): Shooter, flux: f64| {
            let weights = self.solution.layers[layer].patches[patch as usize].weights;
            flux.abs() > here * weights.iter().sum::<f64>()
        };
        let is_joint = self.settings.scheme == Scheme::Joint;
        let shoots = |(s, [straight, specular]): &(Shooter, [f64; 2])| {
            matters(*s, *straight) || (is_joint && matters(*s, *specular))
        };
        let shooters: Vec<Shooter> =
            waiting.iter().filter(|w| shoots(w)).map(|(s, _)| *s).collect();
        if !shooters.is_empty() {
            Plan::Diffuse(shooters)
        } else if !is_joint && waiting.iter().any(|(s, w)| matters(*s, w[1])) {
            Plan::Specular
        } else {
            Plan::Rest
        }
    }

    /// Flux that may be left waiting: what it could still bring, mean over all surfaces, is a small part of
    /// the accuracy, of the reflected light alone [W].
    fn negligible(&self) -> f64 {
        let solution = &self.solution;
        let indirect = solution.layer(Component::Indirect);
        let (_, reflected) = indirect.area_and_reflectance();
        let received = indirect.flux().0.luminance();
        UNSHOT * self.settings.transfer.relative * received * (1.0 - reflected.min(MOST_REFLECTED))
    }

    /// Radiosity that may be left waiting in any one patch, luminance [W/m²]: between two surfaces that stand close to each
    /// other there is little flux, and what waits of it may be most of the light.
    fn negligible_here(&self) -> f64 {
        let indirect = self.solution.layer(Component::Indirect);
        let (area, _) = indirect.area_and_reflectance();
        if area > 0.0 {
            UNSHOT_HERE * self.settings.transfer.relative * indirect.flux().0.luminance() / area
        } else {
            0.0
        }
    }

    /// What patches have to send one way goes to all that they light. All is taken before any is received: specular surfaces
    /// shoot together.
    fn shoot(&mut self, shooters: &[Shooter], way: Way) {
        let take = |&(layer, patch): &Shooter| {
            self.sources[layer].take(&self.solution.layers[layer], patch as usize, way)
        };
        let taken: Vec<[Rgb; 3]> = shooters.iter().map(take).collect();
        for (shooter, unshot) in shooters.iter().zip(taken) {
            self.send(*shooter, way, unshot);
        }
    }

    /// Sends so much of a patch's corners [W/m²].
    fn send(&mut self, (layer, patch): Shooter, way: Way, unshot: [Rgb; 3]) {
        let Self { solution, sources, received, factor, counts, .. } = self;
        let (mut arrived, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
        let mut receive = |vertex: u32, weight: [Rgb; 3]| {
            let light = unshot[0] * weight[0] + unshot[1] * weight[1] + unshot[2] * weight[2];
            received[vertex as usize] += light;
            let (flux, kept) = solution.indirect_mut().receive(vertex as usize, light * *factor);
            arrived += flux;
            absorbed += kept;
            counts.replayed[way as usize] += 1;
        };
        let transport = &sources[layer].transport;
        match way {
            Way::Straight => transport
                .straight(patch)
                .iter()
                .for_each(|e| receive(e.vertex, e.weights.map(|w| Rgb::grey(f64::from(w))))),
            Way::Specular => transport
                .specular(patch)
                .iter()
                .for_each(|e| receive(e.vertex, e.weights.map(|w| Rgb(w.map(f64::from))))),
        }
        self.enter((layer, patch), unshot, way, arrived, absorbed);
    }

    /// Enters a shot into the ledger.
    fn enter(
        &mut self,
        (layer, patch): Shooter,
        unshot: [Rgb; 3],
        way: Way,
        received: Rgb,
        absorbed: Rgb,
    ) {
        let corners = self.solution.layers[layer].patches[patch as usize];
        let (mut shot, mut losses) = (Rgb::BLACK, Losses::default());
        for c in 0..3 {
            let fate: &Fate = &self.sources[layer].transport.fates[corners.vertices[c] as usize];
            let flux = unshot[c] * corners.weights[c];
            shot += flux * fate.share(way);
            losses += fate.losses[way as usize] * flux;
        }
        self.ledger.unshot = self.ledger.unshot - shot;
        self.ledger.shoot(shot, &losses, received, absorbed);
    }
}
