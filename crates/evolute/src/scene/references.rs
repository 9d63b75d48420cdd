//! Ids, aliases, and the references to them.

use std::collections::BTreeMap;

use super::description::Object;
use super::message::{Checked, Complaint, nearest, quoted};
use super::source::Span;
use super::text::Text;
use super::xml::MAX_DEPTH;

/// What refers to what, collected while a scene is read: a reference may stand before its object.
#[derive(Debug, Default)]
pub(super) struct References {
    /// Objects by id, and where the id stands.
    ids: BTreeMap<String, (usize, Span)>,
    /// Owner, place among its children, id.
    waiting: Vec<(usize, usize, Text)>,
    /// New name, old name.
    aliases: Vec<(Text, Text)>,
}

impl References {
    /// Gives an object its id.
    ///
    /// # Errors
    /// When another has it.
    pub(super) fn name(&mut self, id: &Text, object: usize) -> Checked<()> {
        match self.ids.insert(id.value.clone(), (object, id.span)) {
            None => Ok(()),
            Some((_, before)) => {
                Err(Complaint::at(id.span, format!("the id {} is used twice", quoted(&id.value)))
                    .related(before, "the first time")
                    .help("give each object an id of its own, or none"))
            }
        }
    }

    /// Notes that child number `place` of an object is the object called `id`.
    pub(super) fn refer(&mut self, owner: usize, place: usize, id: Text) {
        self.waiting.push((owner, place, id));
    }

    /// Notes a second name for the object called `old`.
    pub(super) fn alias(&mut self, new: Text, old: Text) {
        self.aliases.push((new, old));
    }

    /// Puts the objects in place of the references to them.
    ///
    /// # Errors
    /// Unknown ids, objects inside themselves, nesting deeper than [`MAX_DEPTH`].
    pub(super) fn resolve(&mut self, objects: &mut [Object]) -> Checked<()> {
        for (new, old) in std::mem::take(&mut self.aliases) {
            let object = self.lookup(&old)?;
            self.name(&new, object)?;
        }
        for (owner, place, id) in std::mem::take(&mut self.waiting) {
            objects[owner].children[place].object = self.lookup(&id)?;
        }
        let mut heights = vec![Height::Unknown; objects.len()];
        for object in 0..objects.len() {
            height(objects, object, objects[object].span, 0, &mut heights)?;
        }
        Ok(())
    }

    fn lookup(&self, id: &Text) -> Checked<usize> {
        self.ids.get(&id.value).map(|(object, _)| *object).ok_or_else(|| {
            Complaint::at(id.span, format!("no object has the id {}", quoted(&id.value)))
                .maybe_meant(nearest(&id.value, self.ids.keys().map(String::as_str)))
                .help("give an object this id, or refer to one that is there")
        })
    }
}

/// What is known of an object's nesting.
#[derive(Clone, Copy)]
enum Height {
    Unknown,
    Open,
    Known(usize),
}

/// How deep objects are nested in an object, references followed.
fn height(
    objects: &[Object],
    object: usize,
    span: Span,
    depth: usize,
    heights: &mut [Height],
) -> Checked<usize> {
    match heights[object] {
        Height::Known(height) => return Ok(height),
        Height::Open => {
            return Err(Complaint::at(span, "an object refers to itself")
                .related(objects[object].span, "this object")
                .help("remove one of the references of the circle"));
        }
        Height::Unknown => heights[object] = Height::Open,
    }
    let mut highest = 0;
    for child in &objects[object].children {
        // `depth` bounds the recursion, `highest` what users of the tree will meet.
        let below = if depth < MAX_DEPTH {
            height(objects, child.object, child.span, depth + 1, heights)?
        } else {
            MAX_DEPTH
        };
        highest = highest.max(below + 1);
        if highest > MAX_DEPTH {
            return Err(Complaint::at(
                child.span,
                format!("objects are nested more than {MAX_DEPTH} deep"),
            )
            .help("shorten the chain of references"));
        }
    }
    heights[object] = Height::Known(highest);
    Ok(highest)
}

#[cfg(test)]
mod tests {
    use super::super::load_str;

    /// Chains of references are bounded whichever end is met first.
    #[test]
    fn long_chains_are_refused_without_running_out_of_stack() {
        let link = |i: usize| {
            format!("<bsdf type=\"twosided\" id=\"b{i}\"><ref id=\"b{}\"/></bsdf>", i + 1)
        };
        let end = |n: usize| format!("<bsdf type=\"diffuse\" id=\"b{n}\"/>");
        let load = |inside: String| {
            load_str("a.xml", &format!("<scene version=\"3.0.0\">{inside}</scene>"), &[])
        };
        for n in [30, 100, 50_000] {
            let forward: String = (0..n).map(link).chain([end(n)]).collect();
            let backward: String = std::iter::once(end(n)).chain((0..n).rev().map(link)).collect();
            for inside in [forward, backward] {
                match load(inside) {
                    Ok(_) => assert_eq!(n, 30),
                    Err(error) => assert!(n > 60 && error.message().contains("nested"), "{error}"),
                }
            }
        }
    }
}
