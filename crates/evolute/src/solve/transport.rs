//! Who shines on whom: for each triangle, the vertices that it lights and how strongly.
//!
//! Rows are gathered at vertices (what a vertex sees) and kept turned round, by the triangle that is seen:
//! that is what a shot of a triangle needs (Yu & Wu, 3.2). Straight links and those by specular chains are
//! kept apart, for diffuse and specular iterations.

use serde::{Deserialize, Serialize};

use crate::geometry::Rgb;
use crate::surface::ChartPoint;
use crate::trace::tree::Losses;
use crate::transfer::{Link, Row};

/// A triangle, numbered through all sheets of a layer.
pub type Patch = u32;

/// Tells the patch at a point of a sheet, and the weights of its corners.
pub type Locate<'l> = dyn Fn(usize, &ChartPoint) -> (Patch, [f64; 3]) + 'l;

/// A point that shines on a vertex, in single precision: surface, place, weight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct StoredLink<W> {
    sheet: u32,
    chart: u32,
    at: [f32; 2],
    /// Irradiance for a radiosity of 1.
    weight: W,
}

impl<W> StoredLink<W> {
    fn new(link: &Link, sheet: usize, weight: W) -> Self {
        Self {
            sheet: sheet as u32,
            chart: link.site.chart,
            at: link.site.at.map(|x| x as f32),
            weight,
        }
    }

    fn site(&self) -> ChartPoint {
        ChartPoint { chart: self.chart, at: self.at.map(f64::from) }
    }
}

/// What one vertex sees, by places: it outlives changes of all meshes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StoredRow {
    straight: Vec<StoredLink<f32>>,
    specular: Vec<StoredLink<[f32; 3]>>,
}

impl StoredRow {
    /// Keeps the links to sheets. A link whose surface has none (a lamp that is black itself) brings nothing.
    pub fn new(row: &Row, sheet_of: &dyn Fn(&Link) -> Option<usize>) -> Self {
        let mut stored = Self::default();
        for link in &row.links {
            let Some(sheet) = sheet_of(link) else { continue };
            if link.depth == 0 {
                stored.straight.push(StoredLink::new(link, sheet, link.weight[0] as f32));
            } else {
                let weight = link.weight.0.map(|x| x as f32);
                stored.specular.push(StoredLink::new(link, sheet, weight));
            }
        }
        stored
    }

    /// Sheets and charts of all links.
    pub fn places(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let straight = self.straight.iter().map(|l| (l.sheet, l.chart));
        straight.chain(self.specular.iter().map(|l| (l.sheet, l.chart)))
    }

    /// Whether all are finite numbers.
    pub fn is_finite(&self) -> bool {
        let all = |numbers: &[f32]| numbers.iter().all(|x| x.is_finite());
        self.straight.iter().all(|l| all(&l.at) && l.weight.is_finite())
            && self.specular.iter().all(|l| all(&l.at) && all(&l.weight))
    }
}

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

/// A row by the patches of one layer, by corner, in single precision as the links are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BoundRow {
    straight: Vec<(Patch, [f32; 3])>,
    specular: Vec<(Patch, [[f32; 3]; 3])>,
}

impl BoundRow {
    /// Finds the patches of a row's links.
    pub fn new(row: &StoredRow, locate: &Locate<'_>) -> Self {
        let straight = row.straight.iter().map(|link| {
            let (patch, corners) = locate(link.sheet as usize, &link.site());
            (patch, corners.map(|c| c as f32 * link.weight))
        });
        let specular = row.specular.iter().map(|link| {
            let (patch, corners) = locate(link.sheet as usize, &link.site());
            (patch, corners.map(|c| link.weight.map(|w| w * c as f32)))
        });
        let add = |sum: &mut [f32; 3], w: [f32; 3]| {
            sum.iter_mut().zip(w).for_each(|(sum, w)| *sum += w);
        };
        Self {
            straight: merged(straight.collect(), &add),
            specular: merged(specular.collect(), &|sum, w| {
                sum.iter_mut().zip(w).for_each(|(sum, w)| add(sum, w));
            }),
        }
    }
}

/// Entries in the order of their patches, those of the same patch added up.
fn merged<W: Copy>(mut entries: Vec<(Patch, W)>, add: &dyn Fn(&mut W, W)) -> Vec<(Patch, W)> {
    entries.sort_by_key(|e| e.0);
    entries.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            add(&mut kept.1, next.1);
        }
        same
    });
    entries.shrink_to_fit();
    entries
}

/// Where the flux of a vertex goes, as fractions: straight, and to specular surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Fate {
    /// What goes straight, whatever becomes of it; the rest goes to specular surfaces.
    pub straight: Rgb,
    /// Losses of either.
    pub losses: [Losses; 2],
}

impl Fate {
    /// Between those of three others, of the given weights.
    pub fn between(fates: [&Self; 3], weights: [f64; 3]) -> Self {
        let mut sum = Self::default();
        for (fate, w) in fates.into_iter().zip(weights) {
            sum.straight += fate.straight * w;
            for (own, losses) in sum.losses.iter_mut().zip(fate.losses) {
                *own += losses * Rgb::grey(w);
            }
        }
        sum
    }

    /// Whether all are finite numbers.
    pub fn is_finite(&self) -> bool {
        self.straight.is_finite() && self.losses.iter().all(|l| l.sum().is_finite())
    }

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
            let each = row.straight.iter();
            each.map(move |&(patch, weights)| (patch, Straight { vertex, weights }))
        });
        let specular = Columns::new(patches, rows, |vertex, row| {
            let each = row.specular.iter();
            each.map(move |&(patch, weights)| (patch, BySpecular { vertex, weights }))
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
