//! From sights and the lattice to pixels.

use rayon::prelude::*;

use crate::geometry::Rgb;
use crate::trace::tree::{Leaf, Sight};
use crate::transfer::{Control, Counts, Order};

use super::filter::FilterTable;
use super::lattice::{Lattice, irradiance_of};
use super::receiver::{Allowance, Part};
use super::{Picture, View};

/// Samples of a pixel that needs more than one: a Hammersley set, in which every row, every column
/// and every aligned rectangle of 1/64 of the pixel holds one, so that an edge of any slope shows
/// about 64 shades.
const SAMPLES: u32 = 64;

/// Relative difference of distance between a pixel's corners and its centre above which a silhouette
/// may lie between.
const DEPTH_STEP: f64 = 0.05;

/// Cosine between normals at a pixel's corners and centre below which a crease may lie between (8°).
const CREASE: f64 = 0.99;

/// Rows of pixels that one thread does at a time.
const ROWS: u32 = 8;

/// The parts of a radiance.
#[derive(Clone, Copy, Default)]
struct Parts {
    /// By [`Part`].
    reflected: [Rgb; 3],
    emitted: Rgb,
}

impl Parts {
    fn add(&mut self, other: &Self, weight: f64) {
        for (own, more) in self.reflected.iter_mut().zip(other.reflected) {
            *own += more * weight;
        }
        self.emitted += other.emitted * weight;
    }
}

/// Weighted sums over a pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    parts: Parts,
    weight: f64,
}

impl Sums {
    fn add(&mut self, parts: &Parts, weight: f64) {
        self.parts.add(parts, weight);
        self.weight += weight;
    }

    fn merge(&mut self, other: &Self) {
        self.parts.add(&other.parts, 1.0);
        self.weight += other.weight;
    }
}

/// What a pixel shows at its centre.
#[derive(Clone, Copy, Default)]
struct Centre {
    distance: f64,
    normal: [f64; 3],
    irradiance: Rgb,
}

/// What one thread made of some rows.
#[derive(Default)]
struct Band {
    /// Sums of the rows and of those within the filter's reach.
    sums: Vec<Sums>,
    centres: Vec<Centre>,
    rays: u64,
    samples: u64,
    receivers: u64,
    unmet: u64,
    largest_error: f64,
    /// Whether light was needed that there was no time for.
    unfinished: bool,
    counts: Counts,
    cut: f64,
}

/// Makes the picture; `None` if told to abandon it.
pub(super) fn resolve(
    view: &View<'_>,
    lattices: &[Lattice],
    control: &Control<'_>,
) -> Option<Picture> {
    let filter = FilterTable::new(view.filter);
    let (width, height) = (view.width as usize, view.height as usize);
    let starts: Vec<u32> = (0..view.height).step_by(ROWS as usize).collect();
    let mut sums = vec![Sums::default(); width * height];
    let mut picture = Picture::new(width, height);
    picture.complete = true;
    for lattice in lattices {
        picture.nodes += lattice.len() as u64;
        picture.receivers += lattice.receivers;
        picture.unmet += lattice.unmet;
        picture.largest_error = picture.largest_error.max(lattice.largest_error);
        picture.counts += lattice.counts;
        picture.complete &= lattice.complete;
    }
    let mut cut = 0.0;
    // A few bands at a time, so that memory stays bounded; they are added up in order.
    for (i, some) in starts.chunks(16).enumerate() {
        if (control.order)() == Order::Abandon {
            return None;
        }
        (control.progress)("pixels", (i * 16) as u64, starts.len() as u64);
        let bands: Vec<Band> =
            some.par_iter().map(|y| band(view, lattices, &filter, *y, control)).collect();
        for (first, band) in some.iter().zip(bands) {
            let top = i64::from(*first) - filter.reach;
            for (row, line) in band.sums.chunks(width).enumerate() {
                let y = top + row as i64;
                if (0..height as i64).contains(&y) {
                    let at = y as usize * width;
                    sums[at..at + width].iter_mut().zip(line).for_each(|(s, o)| s.merge(o));
                }
            }
            for centre in &band.centres {
                picture.distance.push(centre.distance as f32);
                picture.normal.push(centre.normal.map(|x| x as f32));
                picture.irradiance.push(single(centre.irradiance));
            }
            picture.rays += band.rays;
            picture.samples += band.samples;
            picture.receivers += band.receivers;
            picture.unmet += band.unmet;
            picture.largest_error = picture.largest_error.max(band.largest_error);
            picture.complete &= !band.unfinished;
            picture.counts += band.counts;
            cut += band.cut;
        }
    }
    picture.cut = cut / picture.samples.max(1) as f64;
    for sum in &sums {
        let scale = if sum.weight > 0.0 { 1.0 / sum.weight } else { 0.0 };
        let [direct, indirect, specular] = sum.parts.reflected;
        picture.direct.push(single(direct * scale));
        picture.indirect.push(single(indirect * scale));
        picture.specular.push(single(specular * scale));
        picture.emitted.push(single(sum.parts.emitted * scale));
    }
    Some(picture)
}

/// In the precision of picture files.
fn single(rgb: Rgb) -> [f32; 3] {
    rgb.0.map(|x| x as f32)
}

/// The rows from `top` on, [`ROWS`] of them or what is left of the film.
fn band(
    view: &View<'_>,
    lattices: &[Lattice],
    filter: &FilterTable,
    top: u32,
    control: &Control<'_>,
) -> Band {
    let rows = ROWS.min(view.height - top);
    let width = view.width as usize;
    let mut band = Band::default();
    band.sums.resize(width * (rows as usize + 2 * filter.reach as usize), Sums::default());
    let may_compute = (control.order)() == Order::Go;
    let corners_of = |y: u32, band: &mut Band| -> Vec<Sight> {
        (0..=view.width)
            .map(|x| {
                let sight = view.sight(f64::from(x), f64::from(y));
                band.rays += sight.rays;
                sight
            })
            .collect()
    };
    let mut above = corners_of(top, &mut band);
    for row in 0..rows {
        let y = top + row;
        let below = corners_of(y + 1, &mut band);
        for x in 0..view.width {
            let mut pixel = Pixel { view, lattices, own: Vec::new(), may_compute, x, y };
            let i = x as usize;
            let corners = [&above[i], &above[i + 1], &below[i], &below[i + 1]];
            pixel.resolve(corners, filter, row, &mut band);
        }
        above = below;
    }
    band
}

/// One part of the irradiance of a surface in a part of a pixel.
struct Own {
    leaf: Leaf,
    /// Its part, by the number of the lattice.
    lattice: usize,
    /// Column and row among [`STRATA`].
    stratum: (u32, u32),
    irradiance: Rgb,
}

/// Columns and rows into which a pixel is divided where light is computed for it alone.
const STRATA: f64 = 2.0;

/// A pixel at work.
struct Pixel<'p, 's> {
    view: &'p View<'s>,
    lattices: &'p [Lattice],
    /// Irradiance that the lattices do not know: of surfaces that no node sees, and of all where light changes beside an
    /// outline.
    own: Vec<Own>,
    may_compute: bool,
    x: u32,
    y: u32,
}

impl Pixel<'_, '_> {
    fn resolve(&mut self, corners: [&Sight; 4], filter: &FilterTable, row: u32, band: &mut Band) {
        let (x, y) = (f64::from(self.x), f64::from(self.y));
        let centre = self.look(x + 0.5, y + 0.5, band);
        let parts = self.shade(&centre, x + 0.5, y + 0.5, band);
        let at_centre = self.centre(&centre, band);
        band.centres.push(at_centre);
        let finer = |lattice: &Lattice| lattice.finer_than_pixel(self.x, self.y);
        let plain =
            !self.lattices.iter().any(finer) && corners.iter().all(|corner| alike(&centre, corner));
        if plain {
            self.splat(&parts, row, band, filter.reach, |dx, dy| {
                filter.whole(dx) * filter.whole(dy)
            });
            return;
        }
        let share = 1.0 / f64::from(SAMPLES);
        for i in 0..SAMPLES {
            let (u, v) = hammersley(i);
            let sight = self.look(x + u, y + v, band);
            let parts = self.shade(&sight, x + u, y + v, band);
            self.splat(&parts, row, band, filter.reach, |dx, dy| {
                filter.point(-dx, u) * filter.point(-dy, v) * share
            });
        }
    }

    /// Adds a sample to the pixels around: `weight` of (columns to the right, rows down).
    fn splat(
        &self,
        parts: &Parts,
        row: u32,
        band: &mut Band,
        reach: i64,
        weight: impl Fn(i64, i64) -> f64,
    ) {
        let width = i64::from(self.view.width);
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let column = i64::from(self.x) + dx;
                if (0..width).contains(&column) {
                    let line = i64::from(row) + reach + dy;
                    band.sums[(line * width + column) as usize].add(parts, weight(dx, dy));
                }
            }
        }
    }

    fn look(&self, x: f64, y: f64, band: &mut Band) -> Sight {
        let sight = self.view.sight(x, y);
        band.rays += sight.rays;
        band.samples += 1;
        band.cut += sight.cut;
        sight
    }

    /// Radiance of a sight at (x, y) of the film, in parts.
    fn shade(&mut self, sight: &Sight, x: f64, y: f64, band: &mut Band) -> Parts {
        let mut parts = Parts { emitted: sight.emitted, ..Parts::default() };
        for leaf in &sight.leaves {
            let irradiance = self.irradiance(leaf, sight, (x, y), band);
            for (sum, part) in parts.reflected.iter_mut().zip(irradiance) {
                *sum += leaf.radiance(part);
            }
        }
        parts
    }

    /// Irradiance of a leaf of a sight, by [`Part`] [W/m²].
    fn irradiance(
        &mut self,
        leaf: &Leaf,
        sight: &Sight,
        at: (f64, f64),
        band: &mut Band,
    ) -> [Rgb; 3] {
        if let Some(mesh) = self.view.mesh {
            return mesh(leaf);
        }
        let mut parts = [Rgb::BLACK; 3];
        let mut known = Rgb::BLACK;
        for i in 0..self.lattices.len() {
            let found = self.part(leaf, i, known, sight, at, band);
            parts[self.lattices[i].part() as usize] = found;
            known += found;
        }
        parts
    }

    /// One part of a leaf's irradiance [W/m²], by the number of its lattice; it receives `known` by those before.
    fn part(
        &mut self,
        leaf: &Leaf,
        lattice: usize,
        known: Rgb,
        sight: &Sight,
        (x, y): (f64, f64),
        band: &mut Band,
    ) -> Rgb {
        if !self.lattices[lattice].changes_in(self.x, self.y)
            && let Some(found) = self.lattices[lattice].irradiance(x, y, leaf)
        {
            return found;
        }
        let stratum = |at: f64, pixel: u32| (STRATA * (at - f64::from(pixel))) as u32;
        let stratum = (stratum(x, self.x), stratum(y, self.y));
        let is_same = |o: &&Own| o.lattice == lattice && o.stratum == stratum && o.leaf.same(leaf);
        if let Some(own) = self.own.iter().find(is_same) {
            return own.irradiance;
        }
        let mut found = Rgb::BLACK;
        let part = self.lattices[lattice].part();
        if let Some(hint) = self.view.hint.filter(|_| part != Part::Direct) {
            // What shows in a few pixels only may be as coarse as the meshes.
            found = hint(leaf)[part as usize];
        } else if self.may_compute {
            let known = known + self.view.foreknown(leaf, part);
            let share = self.view.relative * self.allowance(sight, x, y).share(leaf, known);
            let light = (self.view.light)(leaf, part, share);
            band.counts += light.counts;
            band.receivers += 1;
            band.unmet += u64::from(!light.met);
            band.largest_error = band.largest_error.max(light.error);
            band.unfinished |= light.stopped;
            found = light.irradiance;
        } else {
            band.unfinished = true;
        }
        self.own.push(Own { leaf: *leaf, lattice, stratum, irradiance: found });
        found
    }

    /// What may be off at (x, y) of the film, by what the lattices know of it.
    fn allowance(&self, sight: &Sight, x: f64, y: f64) -> Allowance {
        let of = |leaf: &Leaf| irradiance_of(self.lattices, x, y, leaf);
        let known: Vec<Rgb> = sight.leaves.iter().map(of).collect();
        let dark = self.lattices.last().map_or(0.0, |l| l.dark);
        Allowance::new(&sight.leaves, &known, dark)
    }

    /// Distance, normal and irradiance of the diffuse surface that shows most at the centre.
    fn centre(&mut self, sight: &Sight, band: &mut Band) -> Centre {
        let mut best: Option<&Leaf> = None;
        for leaf in &sight.leaves {
            if best.is_none_or(|b| leaf.throughput.luminance() > b.throughput.luminance()) {
                best = Some(leaf);
            }
        }
        let Some(leaf) = best else { return Centre::default() };
        let (x, y) = (f64::from(self.x) + 0.5, f64::from(self.y) + 0.5);
        let [a, b, c] = self.irradiance(leaf, sight, (x, y), band);
        Centre {
            distance: leaf.distance,
            normal: [leaf.normal.x, leaf.normal.y, leaf.normal.z],
            irradiance: a + b + c,
        }
    }
}

/// Whether two neighbouring sights show the same, without outline, silhouette or crease in between.
fn alike(a: &Sight, b: &Sight) -> bool {
    a.signature == b.signature
        && a.leaves.len() == b.leaves.len()
        && a.leaves.iter().zip(&b.leaves).all(|(l, m)| {
            l.path == m.path
                && l.normal.dot(&m.normal) > CREASE
                && (l.distance - m.distance).abs() < DEPTH_STEP * l.distance
        })
}

/// The i-th of [`SAMPLES`] points of the unit square.
fn hammersley(i: u32) -> (f64, f64) {
    let n = f64::from(SAMPLES);
    let reversed = i.reverse_bits() >> (32 - SAMPLES.trailing_zeros());
    ((f64::from(i) + 0.5) / n, (f64::from(reversed) + 0.5) / n)
}
