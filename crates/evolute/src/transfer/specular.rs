//! One receiver's light: terms in order of depth, then the queue over all their cells.

use super::Transfer;
use super::chain::Departure;
use super::diffuse::{lambert, polygons};
use super::domain::Domain;
use super::fan::Fan;
use super::field::DirectField;
use super::grid::GridPoint;
use super::left::{Left, LeftWord, MAX_CHAINS, is_full};
use super::look::{WHISPER, grid, look};
use super::quadrature::{COARSE_LEVEL, FIRST_LEVEL, Quadrature, Term};
use super::scout::scout;
use super::settings::{Components, LONGEST_CHAIN, Receiver, ReceiverLight, Stop, WordShare};
use super::shaft::suspects;
use super::unseen::{Brake, Unseen};
use super::window::look_through;
use super::word::{WordId, Words};
use crate::geometry::Rgb;
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Share of the tolerance that a word may be worth to be left out; what is left out is added to the
/// error.
const CUT_WORD_SHARE: f64 = 0.01;
/// Words whose mean throughput falls below this share of the relative accuracy wait until the error
/// that they leave is the largest: what is seen through them would have to be ten times brighter than
/// all else to matter. It may be: orders of reflection in a ball are not monotone, and the error
/// takes the brightest lamp to fill the view.
const CUT_THROUGHPUT_SHARE: f64 = 0.1;
/// Below this throughput a coarse first grid does: what it could miss is worth as much less.
const COARSE_THROUGHPUT: f64 = 0.1;
/// The bound of a word's worth comes from samples; this covers what lies between them.
const SAMPLED_BOUND_MARGIN: f64 = 1.5;
/// Most primitives that are looked at one by one before a lamp; beyond, samples alone decide.
const MAX_SUSPECTS: usize = 64;
/// From so many reflections on it is asked where the chains leave the surface.
const FAN_RUN: usize = 4;
/// Share of the brightest lamp that chains are held to come to of which samples say that they do not.
const FAN_DOUBT: f64 = 0.01;

impl<'s> Transfer<'s> {
    pub(super) fn gather(
        &self,
        receiver: &Receiver,
        components: Components,
        stop: Stop<'_>,
    ) -> (ReceiverLight, Vec<WordShare>) {
        let brake = Brake::new(stop);
        let words = Words::new(self.scene, self.tracer, *receiver);
        let mut quadrature = Quadrature::new(words, &self.lamps, self.settings.criteria, &brake);
        let mut closed = Rgb::BLACK;
        let mut left = Left::up_to(self.most());
        if components.direct {
            self.begin_direct(receiver, &mut quadrature, &mut closed, &mut left);
        }
        let tolerance = |q: &Quadrature<'_, '_>, closed: &Rgb| {
            let luminance = (q.luminance() + closed.luminance()).max(0.0);
            (self.settings.relative * luminance).max(self.settings.absolute)
        };
        if components.specular && !self.lamps.is_empty() {
            let mut level: Vec<WordId> = Vec::new();
            for k in 0..self.scene.shapes.len() as u32 {
                let specular = self.scene.shape(ShapeId(k)).material.is_specular();
                if specular && brake.asked() {
                    let part = Unseen::First(ShapeId(k));
                    left.unseen.add(part, || self.most_by(receiver, ShapeId(k)));
                } else if specular && !self.is_hidden(receiver, ShapeId(k)) {
                    level.extend(quadrature.words.begin(ShapeId(k)));
                }
            }
            self.follow(&mut quadrature, level, &mut left, |q| tolerance(q, &closed));
        }
        let mut met = true;
        loop {
            let allowed = tolerance(&quadrature, &closed);
            let met_again = quadrature.open_dark(allowed);
            self.follow_met(&mut quadrature, &met_again, &mut left, |q| tolerance(q, &closed));
            let allowed = tolerance(&quadrature, &closed);
            if quadrature.error() + left.error() <= allowed
                || self.settings.criteria.quadrature.is_none()
            {
                break;
            }
            // When no further word may be followed, what was left out stays, and finer cells do not
            // help beyond their own share.
            let stuck = (quadrature.error() <= allowed
                && (is_full(&quadrature, &left) || left.unseen.error() > allowed))
                || (quadrature.error() > allowed && quadrature.is_settled());
            if stuck
                || quadrature.cell_count() >= self.settings.max_cells
                || quadrature.counts().chains >= MAX_CHAINS
                || brake.asked_at_division()
            {
                met = false;
                break;
            }
            // What was left out competes with the cells; once they are well within what is allowed, it is what
            // keeps the sum from it.
            let settled = quadrature.error() <= 0.5 * allowed && !left.words.is_empty();
            if !is_full(&quadrature, &left) && (settled || left.worst() > quadrature.worst()) {
                if let Some(word) = left.take_worst() {
                    self.enter(&mut quadrature, word, &mut left, |q| tolerance(q, &closed));
                }
                continue;
            }
            let Some(words) = quadrature.divide_worst(allowed) else {
                met = false;
                break;
            };
            for word in words {
                if quadrature.words.has_discoveries(word) {
                    let found = self.continued(&mut quadrature, word, &mut left);
                    self.follow(&mut quadrature, found, &mut left, |q| tolerance(q, &closed));
                }
            }
        }
        let (direct, specular, error) = quadrature.totals();
        let mut shares = quadrature.by_word();
        for word in &left.words {
            shares[word.word.0 as usize].error += word.error;
        }
        let most = self.most();
        let light = ReceiverLight {
            direct: possible(direct + closed, most),
            specular: possible(specular, most),
            error: (error + left.error()).min(most),
            met: met && !brake.was_pulled(),
            stopped: brake.was_pulled(),
            counts: quadrature.counts(),
        };
        (light, shares)
    }

    /// Whether something flat stands before all of a shape.
    fn is_hidden(&self, receiver: &Receiver, shape: ShapeId) -> bool {
        let surface = &self.scene.shape(shape).surface;
        let (centre, radius) = match surface {
            Surface::Sphere(s) => (s.centre(), s.radius()),
            _ => (surface.bounds().centre(), 0.5 * surface.bounds().diagonal()),
        };
        self.screens.hide(&receiver.position, &centre, radius)
    }

    fn begin_direct(
        &self,
        receiver: &Receiver,
        quadrature: &mut Quadrature<'s, '_>,
        closed: &mut Rgb,
        left: &mut Left,
    ) {
        let contacts = self.tracer.contacts(&receiver.position);
        for id in self.scene.lamps() {
            let shape = self.scene.shape(id);
            let mut hidden_by = None;
            if quadrature.brake.asked() {
                left.unseen.add(Unseen::Lamp(id), || self.most_from(receiver, id));
                continue;
            }
            if let Some(parts) = polygons(&shape.surface) {
                let mut all = Some(Vec::new());
                for corners in parts.iter().filter(|c| lambert(receiver, c) > 0.0) {
                    let found = suspects(
                        self.scene,
                        self.tracer,
                        &receiver.position,
                        id,
                        corners,
                        MAX_SUSPECTS,
                    );
                    match (found, &mut all) {
                        (Some(found), Some(all)) => all.extend(found),
                        _ => all = None,
                    }
                }
                if all.as_ref().is_some_and(Vec::is_empty) {
                    for corners in &parts {
                        *closed += shape.radiance * lambert(receiver, corners);
                    }
                    continue;
                }
                hidden_by = all;
            }
            let on_surface = contacts.iter().any(|c| c.shape == id);
            for domain in Domain::of(&shape.surface, &receiver.position, on_surface) {
                if quadrature.brake.asked() {
                    left.unseen.add(Unseen::Lamp(id), || self.most_from(receiver, id));
                    break;
                }
                let field = DirectField::new(domain, id, *receiver, self.tracer, hidden_by.clone());
                quadrature.add(Term::Direct(Box::new(field), shape.radiance), FIRST_LEVEL, 0.0);
            }
        }
    }

    /// Adds the terms of words and of all that follow, level by level, and leaves out what can be
    /// worth little.
    fn follow(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        mut level: Vec<WordId>,
        left: &mut Left,
        tolerance: impl Fn(&Quadrature<'_, '_>) -> f64,
    ) {
        while !level.is_empty() {
            let mut next = Vec::new();
            for word in level {
                if quadrature.brake.asked() {
                    self.leave_unseen(quadrature, word, left);
                    continue;
                }
                let look = look(&mut quadrature.words, word);
                if look.passed == 0.0 {
                    // A first surface of which the grid shows nothing may come close to the receiver
                    // between its points: the criteria say where to look. A surface that was met may
                    // let chains pass between those that it reflected totally.
                    let words = &quadrature.words;
                    let stopped = look.island && !words.met_at(word, 1).is_empty();
                    if words.parent(word).is_some() && !stopped {
                        left.unmet.insert(word);
                        continue;
                    }
                    if is_full(quadrature, left) {
                        self.leave_unseen(quadrature, word, left);
                    } else {
                        next.extend(self.add_word(quadrature, word, 1.0, left, &tolerance));
                    }
                    continue;
                }
                let reach = self.reach(&mut quadrature.words, word);
                let bound = look.passed * reach * SAMPLED_BOUND_MARGIN;
                let throughput = look.passed / look.offered;
                let small = bound < CUT_WORD_SHARE * tolerance(quadrature);
                let dim = throughput < CUT_THROUGHPUT_SHARE * self.settings.relative;
                // Whispering chains go on for hundreds of letters by ever the same few points.
                let whispers = quadrature.words.run(word) >= WHISPER || reach < self.brightest();
                let thin = (look.island || whispers) && bound < tolerance(quadrature);
                if small || dim || thin || is_full(quadrature, left) {
                    left.words.push(LeftWord { word, error: bound, throughput, whispers });
                    quadrature.words.forget(word);
                    continue;
                }
                next.extend(self.add_word(quadrature, word, throughput, left, &tolerance));
            }
            level = next;
        }
    }

    /// Luminance of the brightest that a word's chains and all that continue them may come to [W/(m² sr)]:
    /// less than the brightest lamp where they run along one mirror and seem to leave it away from that.
    fn reach(&self, words: &mut Words<'_>, word: WordId) -> f64 {
        if let Some(known) = words.reach(word) {
            return known;
        }
        let (brightest, run) = (self.brightest(), words.run(word));
        // Twice as many reflections leave a quarter of the fan.
        if run < FAN_RUN || !run.is_power_of_two() {
            return brightest;
        }
        let Some(fan) = Fan::of(words, word) else { return brightest };
        let own = words.letter(word).shape;
        let met = |id: ShapeId| fan.may_meet(&self.scene.shape(id).surface.bounds());
        let others = (0..self.scene.shapes.len() as u32).map(ShapeId).filter(|id| *id != own);
        if others.into_iter().any(|id| self.scene.shape(id).material.is_specular() && met(id)) {
            return brightest;
        }
        let lamps = self.scene.lamps().filter(|id| met(*id));
        let lamps = lamps.map(|id| self.scene.shape(id).radiance.luminance());
        let reach = lamps.fold(FAN_DOUBT * brightest, f64::max);
        words.set_reach(word, reach);
        reach
    }

    /// Follows the words of which the grid showed nothing and whose last letter was met since by a chain
    /// that carries light there.
    fn follow_met(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        met: &[(WordId, GridPoint)],
        left: &mut Left,
        tolerance: impl Fn(&Quadrature<'_, '_>) -> f64,
    ) {
        for &(word, at) in met {
            let carries = |departure: &Departure| departure.weight.v > 0.0 && departure.is_legal();
            if left.unmet.contains(&word)
                && quadrature.words.departure(word, at).is_some_and(carries)
            {
                left.unmet.remove(&word);
                self.follow(quadrature, vec![word], left, &tolerance);
            }
        }
    }

    /// Adds the terms of a word that had been left out.
    fn enter(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        out: LeftWord,
        left: &mut Left,
        tolerance: impl Fn(&Quadrature<'_, '_>) -> f64,
    ) {
        let next = self.add_word(quadrature, out.word, out.throughput, left, &tolerance);
        self.follow(quadrature, next, left, tolerance);
    }

    /// Adds the terms of one word; the words that follow it.
    fn add_word(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        word: WordId,
        throughput: f64,
        left: &mut Left,
        tolerance: &impl Fn(&Quadrature<'_, '_>) -> f64,
    ) -> Vec<WordId> {
        left.followed += 1;
        let look = look(&mut quadrature.words, word);
        // Chains that are known from elsewhere open the cells of an island.
        let coarse = throughput < COARSE_THROUGHPUT || look.island;
        let first = if coarse { COARSE_LEVEL } else { FIRST_LEVEL };
        quadrature.words.set_first_level(word, first);
        if look.reaches || look.passed == 0.0 {
            let allowed = tolerance(quadrature);
            for lamp in 0..self.lamps.len() {
                if quadrature.brake.asked() {
                    self.leave_through(quadrature, word, left);
                    break;
                }
                let shut = self.shut_in(&quadrature.words, word, self.lamps[lamp].shape)
                    || self.is_left_behind(&quadrature.words, word, &self.lamps[lamp]);
                if !shut {
                    quadrature.add(Term::Through(word, lamp), first, allowed);
                }
            }
        } else if !self.shows_all(&quadrature.words, word) {
            // The first grid still has to be traced, for what follows to be found.
            grid(first).for_each(|at| {
                quadrature.words.departure(word, at);
            });
        }
        look_through(&mut quadrature.words, word);
        if self.settings.criteria.matching_trees.is_some()
            && !self.shows_all(&quadrature.words, word)
        {
            scout(&mut quadrature.words, word, first, throughput >= COARSE_THROUGHPUT);
        }
        self.continued(quadrature, word, left)
    }

    /// The words that follow a word, as far as they are wanted; what is wanted but too long is left
    /// unseen.
    fn continued(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        word: WordId,
        left: &mut Left,
    ) -> Vec<WordId> {
        let depth = quadrature.words.depth(word);
        if depth < self.settings.max_specular.min(LONGEST_CHAIN) {
            return quadrature.words.continue_word(word);
        }
        if depth < self.settings.max_specular && quadrature.words.has_discoveries(word) {
            self.leave_through(quadrature, word, left);
        }
        Vec::new()
    }

    /// Leaves a word that was not looked at: it is part of what comes through the word before it, or by
    /// its first surface.
    fn leave_unseen(&self, quadrature: &mut Quadrature<'s, '_>, word: WordId, left: &mut Left) {
        if let Some(parent) = quadrature.words.parent(word) {
            self.leave_through(quadrature, parent, left);
        } else if let Some(first) = quadrature.words.letters(word).first() {
            let receiver = quadrature.words.receiver();
            let part = Unseen::First(first.shape);
            left.unseen.add(part, || self.most_by(&receiver, first.shape));
        }
    }

    /// Leaves what comes through a word and all that follow it, or some of it.
    fn leave_through(&self, quadrature: &mut Quadrature<'s, '_>, word: WordId, left: &mut Left) {
        left.unseen.add(Unseen::Through(word), || {
            look(&mut quadrature.words, word).passed * self.brightest() * SAMPLED_BOUND_MARGIN
        });
    }
}

/// The colour nearest to one that lamps can make: no channel is negative, and the luminance at most
/// `most` [W/m²]. Interpolation that has not settled yet may overshoot.
fn possible(irradiance: Rgb, most: f64) -> Rgb {
    let positive = irradiance.map(|v| v.max(0.0));
    let luminance = positive.luminance();
    if luminance > most { positive * (most / luminance) } else { positive }
}
