//! What a word need not be asked for: lamps that its last leg cannot show, letters that are known without a search.

use super::Transfer;
use super::chain::Event;
use super::lamp::Lamp;
use super::window::is_plane;
use super::word::{WordId, Words};
use crate::scene::ShapeId;
use crate::surface::Surface;

impl Transfer<'_> {
    /// Whether a word has a window, and all that it may show is known without a search.
    pub(super) fn shows_all(&self, words: &Words<'_>, word: WordId) -> bool {
        let found = |k: u32| {
            let shape = self.scene.shape(ShapeId(k));
            !shape.material.is_specular() || is_plane(&shape.surface)
        };
        words.window(word).is_some() && (0..self.scene.shapes.len() as u32).all(found)
    }

    /// Whether the last leg of a word leaves the very lamp, which is flat or a ball that shines outwards: none of
    /// these sees its own front.
    pub(super) fn is_left_behind(&self, words: &Words<'_>, word: WordId, lamp: &Lamp) -> bool {
        let last = words.letter(word);
        lamp.has_outline() && last.shape == lamp.shape && last.primitive == lamp.primitive
    }

    /// Whether the last leg of a word runs inside a sphere that the lamp lies outside of.
    pub(super) fn shut_in(&self, words: &Words<'_>, word: WordId, lamp: ShapeId) -> bool {
        let Some(last) = words.letters(word).last().copied() else { return false };
        let Surface::Sphere(sphere) = &self.scene.shape(last.shape).surface else { return false };
        let outside = last.front == sphere.faces_outward();
        let inward = outside == (last.event == Event::Transmit);
        inward && !sphere.bounds().overlaps(&self.scene.shape(lamp).surface.bounds())
    }
}
