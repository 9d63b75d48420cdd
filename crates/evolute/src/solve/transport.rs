//! Who shines on whom: for each triangle, the vertices that it lights and how strongly.
//!
//! Rows are gathered at vertices (what a vertex sees) and kept turned round, by the triangle that is seen:
//! that is what a shot of a triangle needs (Yu & Wu, 3.2). Straight links and those by specular chains are
//! kept apart, for diffuse and specular iterations.

use std::ops::AddAssign;

use crate::geometry::Rgb;
use crate::trace::tree::Losses;
use crate::transfer::Row;

/// A triangle, numbered through all sheets.
pub type Patch = u32;

/// Where a point of a surface lies: the patch, and the weights of its corners.
pub type Locate<'l> = dyn Fn(&crate::transfer::Link) -> Option<(Patch, [f64; 3])> + Sync + 'l;

/// How a patch's corners light a vertex: irradiance for a radiosity of 1 at each corner.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Straight {
    /// The vertex lit, numbered through all sheets.
    pub vertex: u32,
    /// By corner.
    pub weights: [f32; 3],
}

/// The same by specular chains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BySpecular {
    /// The vertex lit.
    pub vertex: u32,
    /// By corner and channel.
    pub weights: [[f32; 3]; 3],
}

/// A row by patches: what one vertex sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoundRow {
    pub(super) straight: Vec<(Patch, [f64; 3])>,
    pub(super) specular: Vec<(Patch, [Rgb; 3])>,
}

impl BoundRow {
    /// Finds the patches of a row's links. A link whose surface has no mesh (a lamp that is black itself)
    /// brings nothing.
    pub fn new(row: &Row, locate: &Locate<'_>) -> Self {
        let (mut straight, mut specular) = (Vec::new(), Vec::new());
        for link in &row.links {
            let Some((patch, corners)) = locate(link) else { continue };
            if link.depth == 0 {
                straight.push((patch, corners.map(|c| c * link.weight[0])));
            } else {
                specular.push((patch, corners.map(|c| link.weight * c)));
            }
        }
        Self { straight: merged(straight), specular: merged(specular) }
    }
}

/// Entries in the order of their patches, those of the same patch added up.
fn merged<W: Copy + AddAssign>(mut entries: Vec<(Patch, [W; 3])>) -> Vec<(Patch, [W; 3])> {
    entries.sort_by_key(|e| e.0);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1.iter_mut().zip(next.1).for_each(|(sum, w)| *sum += w);
        }
        same
    });
    entries
}

/// Where the flux of a vertex goes, as fractions: straight, and to specular surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Fate {
    /// What goes straight, whatever becomes of it; the rest goes to specular surfaces.
    pub straight: Rgb,
    /// Losses of either.
    pub losses: [Losses; 2],
}

impl Fate {
    /// Reads it off a row.
    pub fn new(row: &Row) -> Self {
        let direct = row.links.iter().filter(|l| l.depth == 0);
        let straight = direct.fold(row.losses[0].sum(), |sum, l| sum + l.flux);
        Self { straight, losses: row.losses }
    }
}

/// Columns: by patch, what it lights.
#[derive(Clone, Debug, Default)]
pub struct Transport {
    straight: Columns<Straight>,
    specular: Columns<BySpecular>,
    /// By vertex.
    pub fates: Vec<Fate>,
}

/// Lists of entries, one after the other.
#[derive(Clone, Debug, Default)]
struct Columns<E> {
    starts: Vec<usize>,
    entries: Vec<E>,
}

impl<E: Copy + Default> Columns<E> {
    /// By counting: `of` lists the entries of a vertex with their patches, in order.
    fn new<'r, R: 'r, I>(count: usize, rows: &'r [R], of: impl Fn(u32, &'r R) -> I) -> Self
    where
        I: Iterator<Item = (Patch, E)>,
    {
        let mut starts = vec![0; count + 1];
        for row in rows {
            for (patch, _) in of(0, row) {
                starts[patch as usize + 1] += 1;
            }
        }
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut entries = vec![E::default(); starts[count]];
        for (vertex, row) in (0u32..).zip(rows) {
            for (patch, entry) in of(vertex, row) {
                let slot = &mut next[patch as usize];
                entries[*slot] = entry;
                *slot += 1;
            }
        }
        Self { starts, entries }
    }

    fn of(&self, patch: Patch) -> &[E] {
        &self.entries[self.starts[patch as usize]..self.starts[patch as usize + 1]]
    }
}

impl Transport {
    /// Turns the rows of all vertices round.
    pub fn new(patches: usize, rows: &[BoundRow], fates: Vec<Fate>) -> Self {
        let straight = Columns::new(patches, rows, |vertex, row| {
            row.straight.iter().map(move |(patch, weights)| {
                (*patch, Straight { vertex, weights: weights.map(|w| w as f32) })
            })
        });
        let specular = Columns::new(patches, rows, |vertex, row| {
            row.specular.iter().map(move |(patch, weights)| {
                let weights = weights.map(|w| w.0.map(|x| x as f32));
                (*patch, BySpecular { vertex, weights })
            })
        });
        Self { straight, specular, fates }
    }

    /// Vertices that a patch lights straight.
    pub fn straight(&self, patch: Patch) -> &[Straight] {
        self.straight.of(patch)
    }

    /// Vertices that a patch lights by specular chains.
    pub fn specular(&self, patch: Patch) -> &[BySpecular] {
        self.specular.of(patch)
    }

    /// Entries of either kind.
    pub fn counts(&self) -> [usize; 2] {
        [self.straight.entries.len(), self.specular.entries.len()]
    }
}
