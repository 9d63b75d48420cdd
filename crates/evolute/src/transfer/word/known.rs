//! What is known of where a word's chains went: the letters that they met, and from which part of the domain.

use super::{WordId, Words};
use crate::geometry::Point3;
use crate::scene::ShapeId;
use crate::surface::Surface;
use crate::transfer::chain::{Event, Step, events};
use crate::transfer::grid::GridPoint;
use crate::transfer::landing::{Square, Target};

impl Words<'_> {
    /// The word of the first letter alone.
    pub fn first_letter(&self, word: WordId) -> WordId {
        self.parent(word).map_or(word, |parent| self.first_letter(parent))
    }

    /// Whether a legal chain of the word before meets the last letter at a grid point and is totally
    /// reflected there instead of transmitted.
    pub fn is_total(&mut self, word: WordId, at: GridPoint) -> bool {
        let Step { event: Event::Transmit, .. } = self.words[word.0 as usize].step else {
            return false;
        };
        let Some(parent) = self.parent(word) else { return false };
        if !self.is_legal(parent, at) || self.departure(word, at).is_some() {
            return false;
        }
        self.met(parent, at) == Some(self.letter(word))
    }

    /// Whether chains of the word were seen to meet further specular surfaces.
    pub fn has_discoveries(&self, word: WordId) -> bool {
        !self.words[word.0 as usize].discovered.is_empty()
    }

    /// Whether legal chains of the word that carry light were seen to meet a surface (or a facet of it) on every side on
    /// which it is specular; a ball shows but one to either medium. (At a ball's limb and at the middle of a disc chains
    /// carry nothing.)
    pub fn has_met(&self, word: WordId, (shape, primitive): (ShapeId, Option<u32>)) -> bool {
        let node = &self.words[word.0 as usize];
        let carries = |at: GridPoint| self.known(word, at).is_some_and(|d| d.weight.v > 0.0);
        let target = self.scene.shape(shape);
        let met = |front: bool| {
            let letter = Target { shape, primitive, front, lamp: false };
            node.landings.of(letter).any(carries)
        };
        match &target.surface {
            Surface::Sphere(_) => met(true) || met(false),
            _ => {
                [true, false].into_iter().all(|f| met(f) || events(&target.material, f).is_empty())
            }
        }
    }

    /// The landings that were not asked for before: word, what was met, from where.
    pub fn take_fresh(&mut self) -> Vec<(WordId, Target, GridPoint)> {
        std::mem::take(&mut self.fresh)
    }

    /// The words after `word` whose last letter is at the target.
    pub fn children_at(&self, word: WordId, target: Target) -> impl Iterator<Item = WordId> + '_ {
        let children = &self.words[word.0 as usize].children;
        children.iter().copied().filter(move |child| self.letter(*child) == target)
    }

    /// Whether a legal chain of the word before was seen to meet the word's last letter from inside
    /// the cell.
    pub fn is_met_from(&self, word: WordId, cell: Square) -> bool {
        self.parent(word).is_some_and(|parent| {
            self.words[parent.0 as usize].landings.any(self.letter(word), cell)
        })
    }

    /// A few points of the cell from which the word's last letter or the lamp was seen to be met.
    pub fn known_from(&self, word: WordId, lamp: Target, cell: Square) -> Vec<GridPoint> {
        const FEW: usize = 4;
        let mut points = self.words[word.0 as usize].landings.from(lamp, cell, FEW);
        if let Some(parent) = self.parent(word) {
            let landings = &self.words[parent.0 as usize].landings;
            points.extend(landings.from(self.letter(word), cell, FEW));
        }
        points
    }

    /// A few points of the cell from which legal chains of the word are known.
    pub fn legal_in(&self, word: WordId, cell: Square) -> Vec<GridPoint> {
        const FEW: usize = 4;
        self.words[word.0 as usize].landings.legal_in(cell, FEW)
    }

    /// Whether a legal chain of the word was seen to reach a lamp from inside the cell.
    pub fn reaches_from(&self, word: WordId, lamp: Target, cell: Square) -> bool {
        self.words[word.0 as usize].landings.any(lamp, cell)
    }

    /// Up to `count` points at which legal chains of the word before met the word's last letter.
    pub fn met_at(&self, word: WordId, count: usize) -> Vec<GridPoint> {
        self.parent(word).map_or_else(Vec::new, |parent| {
            self.words[parent.0 as usize].landings.some(self.letter(word), count)
        })
    }

    /// Supposes that chains of a word meet a plane piece of a surface, `x` on it, as the word shows it to an eye.
    pub fn suppose(
        &mut self,
        word: WordId,
        shape: ShapeId,
        primitive: Option<u32>,
        x: Point3,
        eye: &Point3,
    ) {
        let surface = &self.scene.shape(shape).surface;
        let Some(point) = surface.locate(&x) else { return };
        let Some(local) = surface.local(&point) else { return };
        let front = (x - eye).dot(&local.ng) < 0.0;
        for event in events(&self.scene.shape(shape).material, front) {
            let step = Step { shape, primitive, front, event, hint: point };
            let list = &mut self.words[word.0 as usize].discovered;
            if !list.iter().any(|s| s.same_letter(&step)) {
                list.push(step);
            }
        }
    }
}
