//! One receiver's light: terms in order of depth, then the queue over all their cells.

use super::Transfer;
use super::chain::{Event, Visibility};
use super::diffuse::{lambert, polygons};
use super::domain::Domain;
use super::field::DirectField;
use super::quadrature::{FIRST_LEVEL, Quadrature, Term};
use super::settings::{Components, Receiver, ReceiverLight, WordShare};
use super::shaft::suspects;
use super::word::{GRID_BITS, GridPoint, WordId, Words};
use crate::geometry::Rgb;
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Share of the tolerance that a word may be worth to be left out; what is left out is added to the
/// error.
const CUT_WORD_SHARE: f64 = 0.01;
/// The bound of a word's worth comes from samples; this covers what lies between them.
const SAMPLED_BOUND_MARGIN: f64 = 1.5;
/// Most primitives that are looked at one by one before a lamp; beyond, samples alone decide.
const MAX_SUSPECTS: usize = 64;
/// Most words a receiver follows; what is beyond is added to the error.
const MAX_WORDS: usize = 4096;

impl<'s> Transfer<'s> {
    pub(super) fn gather(
        &self,
        receiver: &Receiver,
        components: Components,
    ) -> (ReceiverLight, Vec<WordShare>) {
        let words = Words::new(self.scene, self.tracer, *receiver);
        let mut quadrature = Quadrature::new(words, &self.lamps, self.settings.criteria);
        let mut closed = Rgb::BLACK;
        if components.direct {
            self.begin_direct(receiver, &mut quadrature, &mut closed);
        }
        let mut cut = 0.0;
        let tolerance = |q: &Quadrature<'_, '_>, closed: &Rgb| {
            let luminance = (q.luminance() + closed.luminance()).max(0.0);
            (self.settings.relative * luminance).max(self.settings.absolute)
        };
        if components.specular && !self.lamps.is_empty() {
            let mut level: Vec<WordId> = Vec::new();
            for k in 0..self.scene.shapes.len() as u32 {
                if self.scene.shape(ShapeId(k)).material.is_specular() {
                    level.extend(quadrature.words.begin(ShapeId(k)));
                }
            }
            self.follow(&mut quadrature, level, &mut cut, |q| tolerance(q, &closed));
        }
        let mut met = true;
        loop {
            let allowed = tolerance(&quadrature, &closed);
            // Half of what is cut has no cell to divide; the rest of the tolerance is the cells'.
            if quadrature.error() + cut <= allowed || self.settings.criteria.quadrature.is_none() {
                break;
            }
            if quadrature.cell_count() >= self.settings.max_cells {
                met = false;
                break;
            }
            let Some(word) = quadrature.divide_worst(allowed) else {
                met = false;
                break;
            };
            if let Some(word) = word {
                if quadrature.words.has_discoveries(word)
                    && quadrature.words.depth(word) < self.settings.max_specular
                {
                    let found = quadrature.words.continue_word(word);
                    self.follow(&mut quadrature, found, &mut cut, |q| tolerance(q, &closed));
                }
            }
        }
        let (direct, specular, error) = quadrature.totals();
        let shares = quadrature
            .by_word()
            .into_iter()
            .map(|(word, irradiance)| WordShare {
                letters: quadrature
                    .words
                    .letters(word)
                    .iter()
                    .map(|s| (s.shape, s.event))
                    .collect(),
                irradiance,
            })
            .collect();
        let light = ReceiverLight {
            direct: direct + closed,
            specular,
            error: error + cut,
            met,
            counts: quadrature.counts(),
        };
        (light, shares)
    }

    fn begin_direct(
        &self,
        receiver: &Receiver,
        quadrature: &mut Quadrature<'s, '_>,
        closed: &mut Rgb,
    ) {
        let contacts = self.tracer.contacts(&receiver.position);
        for id in self.scene.lamps() {
            let shape = self.scene.shape(id);
            let mut hidden_by = None;
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
                let field = DirectField::new(domain, id, *receiver, self.tracer, hidden_by.clone());
                quadrature.add(Term::Direct(Box::new(field), shape.radiance), 0.0);
            }
        }
    }

    /// Adds the terms of words and of all that follow, level by level, until what a word can be
    /// worth falls below its share of the tolerance.
    fn follow(
        &self,
        quadrature: &mut Quadrature<'s, '_>,
        mut level: Vec<WordId>,
        cut: &mut f64,
        tolerance: impl Fn(&Quadrature<'_, '_>) -> f64,
    ) {
        let brightest = self.lamps.iter().fold(0f64, |m, l| m.max(l.radiance.luminance()));
        let mut followed = 0;
        while !level.is_empty() {
            let mut next = Vec::new();
            for word in level {
                let allowed = tolerance(quadrature);
                let (worth, reaches) = look(&mut quadrature.words, word);
                let worth = worth * brightest * SAMPLED_BOUND_MARGIN;
                if worth == 0.0 {
                    continue;
                }
                followed += 1;
                if worth < CUT_WORD_SHARE * allowed || followed > MAX_WORDS {
                    *cut += worth;
                    continue;
                }
                if reaches {
                    for lamp in 0..self.lamps.len() {
                        if !self.shut_in(&quadrature.words, word, self.lamps[lamp].shape) {
                            quadrature.add(Term::Through(word, lamp), allowed);
                        }
                    }
                } else {
                    // The first grid still has to be traced, for what follows to be found.
                    grid(FIRST_LEVEL).for_each(|at| {
                        quadrature.words.departure(word, at);
                    });
                }
                if quadrature.words.depth(word) < self.settings.max_specular {
                    next.extend(quadrature.words.continue_word(word));
                }
            }
            level = next;
        }
    }
}

impl Transfer<'_> {
    /// Whether the last leg of a word runs inside a sphere that the lamp lies outside of.
    fn shut_in(&self, words: &Words<'_>, word: WordId, lamp: ShapeId) -> bool {
        let Some(last) = words.letters(word).last().copied() else { return false };
        let Surface::Sphere(sphere) = &self.scene.shape(last.shape).surface else { return false };
        let outside = last.front == sphere.faces_outward();
        let inward = outside == (last.event == Event::Transmit);
        inward && !sphere.bounds().overlaps(&self.scene.shape(lamp).surface.bounds())
    }
}

/// What a word could be worth at most per unit of radiance, from a coarse grid of samples, and
/// whether any of its last legs leads anywhere but to the next specular surface.
fn look(words: &mut Words<'_>, word: WordId) -> (f64, bool) {
    let (mut sum, mut count, mut reaches) = (0.0, 0.0, false);
    for at in grid(FIRST_LEVEL) {
        count += 1.0;
        let Some(departure) = words.departure(word, at) else { continue };
        let legal = departure.arrival.edges.iter().all(|e| e.v >= 0.0);
        if departure.arrival.visible == Visibility::Free && legal {
            let throughput = departure.throughput.iter().fold(0f64, |m, t| m.max(t.v));
            // Whatever follows cannot add radiance but for leaving the medium again.
            let most = throughput / departure.arrival.radiance_scale;
            sum += departure.arrival.weight.v.max(0.0) * most;
        }
        // A leg that runs into a specular surface everywhere meets no lamp.
        reaches |= departure.arrival.visible != Visibility::Blocked;
    }
    (sum / count, reaches)
}

/// The points of a regular grid.
fn grid(level: u32) -> impl Iterator<Item = GridPoint> {
    let n = 1u32 << level;
    let step = 1u32 << (GRID_BITS - level);
    (0..=n).flat_map(move |i| (0..=n).map(move |j| GridPoint { i: i * step, j: j * step }))
}
