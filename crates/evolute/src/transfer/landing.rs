//! Landings: where traced chains of a word went next, kept in the order of the domain.
//!
//! A cell whose corners see nothing may hold light all the same: the region from which a curved mirror
//! is met a second time is an island with no smooth border function around it. What is known inside
//! such a cell are the chains that other cells, other lamps and bisections traced there. One of them
//! that went where the cell says nothing goes contradicts it.

use std::collections::{BTreeSet, HashMap};
use std::ops::Bound::{Excluded, Unbounded};

use arrayvec::ArrayVec;

use super::grid::{GRID_BITS, GridHasher, GridPoint};
use super::quadrature::LAST_LEVEL;
use crate::scene::ShapeId;

/// What a chain met: a letter that may follow, or a lamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Target {
    /// The surface.
    pub shape: ShapeId,
    /// The facet or the lamp's triangle, where each counts on its own.
    pub primitive: Option<u32>,
    /// Whether it was met on its front.
    pub front: bool,
    /// Whether it was met as a lamp.
    pub lamp: bool,
}

/// A cell of a domain: least corner on the grid, divisions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Divisions of the domain, a side.
    pub level: u32,
    /// Least corner on the grid.
    pub i: u32,
    /// Least corner on the grid.
    pub j: u32,
}

impl Square {
    /// The cell of a level that holds a grid point (points on a lower border belong to it, those on
    /// an upper one do not).
    fn around(at: GridPoint, level: u32) -> Self {
        let inside = !((1u32 << (GRID_BITS - level)) - 1);
        Self { level, i: at.i & inside, j: at.j & inside }
    }

    /// The cell of a regular grid.
    pub fn nth(level: u32, i: u32, j: u32) -> Self {
        let side = 1u32 << (GRID_BITS - level);
        Self { level, i: i * side, j: j * side }
    }

    /// Its four quarters.
    pub fn children(self) -> [Self; 4] {
        let half = self.side() / 2;
        [(0, 0), (half, 0), (0, half), (half, half)].map(|(di, dj)| Self {
            level: self.level + 1,
            i: self.i + di,
            j: self.j + dj,
        })
    }

    /// Whether a grid point lies in it or on its border.
    pub fn touches(&self, at: GridPoint) -> bool {
        let within = |x: u32, from: u32| (from..=from + self.side()).contains(&x);
        within(at.i, self.i) && within(at.j, self.j)
    }

    /// Side on the grid.
    pub fn side(&self) -> u32 {
        1u32 << (GRID_BITS - self.level)
    }

    /// One number for all.
    pub fn key(&self) -> u64 {
        self.corner().key() | (u64::from(self.level) << 58)
    }

    /// The least corner.
    pub fn corner(&self) -> GridPoint {
        GridPoint { i: self.i, j: self.j }
    }

    /// Its corners, in order around it.
    pub fn corners(&self) -> [GridPoint; 4] {
        let (GridPoint { i, j }, side) = (self.corner(), self.side());
        [(0, 0), (side, 0), (side, side), (0, side)]
            .map(|(di, dj)| GridPoint { i: i + di, j: j + dj })
    }

    /// Side in the domain.
    pub fn size(&self) -> f64 {
        1.0 / f64::from(1u32 << self.level)
    }
}

/// Landings of one word's chains.
#[derive(Default)]
pub struct Landings {
    met: BTreeSet<(Target, u64)>,
    /// From where legal chains met neither a letter nor a lamp.
    nothing: BTreeSet<u64>,
}

impl Landings {
    /// Notes a landing.
    pub fn add(&mut self, target: Target, at: GridPoint) {
        self.met.insert((target, along_curve(at)));
    }

    /// Notes a legal chain that met neither a letter nor a lamp.
    pub fn add_nothing(&mut self, at: GridPoint) {
        self.nothing.insert(along_curve(at));
    }

    /// Whether a chain from inside the cell met the target.
    pub fn any(&self, target: Target, cell: Square) -> bool {
        self.inside(target, cell).next().is_some()
    }

    /// Up to `count` points, spread over the cell, from which the target was met.
    pub fn from(&self, target: Target, cell: Square, count: usize) -> Vec<GridPoint> {
        spread_over(self.inside(target, cell), count)
    }

    fn inside(&self, target: Target, cell: Square) -> impl Iterator<Item = GridPoint> + Clone + '_ {
        let from = along_curve(cell.corner());
        let to = from + (1u64 << (2 * (GRID_BITS - cell.level)));
        self.met.range((target, from)..(target, to)).map(|(_, code)| point(*code))
    }

    /// Up to `count` points of a cell from which legal chains went wherever they went.
    pub fn legal_in(&self, cell: Square, count: usize) -> Vec<GridPoint> {
        let from = along_curve(cell.corner());
        let to = from + (1u64 << (2 * (GRID_BITS - cell.level)));
        let mut points: Vec<GridPoint> =
            self.nothing.range(from..to).map(|c| point(*c)).take(count).collect();
        let mut next = self.met.first().map(|(target, _)| *target);
        while let Some(target) = next.filter(|_| points.len() < count) {
            points.extend(self.inside(target, cell).take(count - points.len()));
            let after = (Excluded((target, u64::MAX)), Unbounded);
            next = self.met.range(after).next().map(|(target, _)| *target);
        }
        points
    }

    /// A point from which the target was met, of the two next to `at` along the curve the nearer.
    pub fn near(&self, target: Target, at: GridPoint) -> Option<GridPoint> {
        let code = along_curve(at);
        let before = self.met.range((target, 0)..=(target, code)).next_back();
        let after = self.met.range((target, code)..=(target, u64::MAX)).next();
        let far = |p: &GridPoint| p.i.abs_diff(at.i).max(p.j.abs_diff(at.j));
        [before, after].into_iter().flatten().map(|(_, code)| point(*code)).min_by_key(far)
    }

    /// Up to `count` points, spread over the domain, from which the target was met.
    pub fn some(&self, target: Target, count: usize) -> Vec<GridPoint> {
        spread_over(self.of(target), count)
    }

    /// Of how much of the domain points of the regular grid of a level stand for that met the target (a point
    /// on a border for half a cell, in a corner for a quarter), and which share of the legal chains met it.
    pub fn share(&self, target: Target, level: u32) -> (f64, f64) {
        let step = (1u32 << (GRID_BITS - level)) - 1;
        let width = |k: u32| if k == 0 || k == 1 << GRID_BITS { 0.5 } else { 1.0 };
        let (mut regular, mut all) = (0.0, 0);
        for at in self.of(target) {
            all += 1;
            if (at.i | at.j) & step == 0 {
                regular += width(at.i) * width(at.j);
            }
        }
        let cells = f64::from(1u32 << level).powi(2);
        (regular / cells, f64::from(all) / (self.met.len() + self.nothing.len()).max(1) as f64)
    }

    /// Of how much of the domain points of finer grids stand for that met the target: the most that any level says,
    /// of whose points only some were asked.
    pub fn fine_share(&self, target: Target, level: u32) -> f64 {
        const LEVELS: usize = 8;
        let mut counts = [0.0; LEVELS];
        for at in self.of(target) {
            let own = GRID_BITS - (at.i | at.j).trailing_zeros().min(GRID_BITS);
            for (k, count) in counts.iter_mut().enumerate() {
                if own <= level + 1 + k as u32 {
                    *count += 1.0;
                }
            }
        }
        let share =
            |(k, count): (usize, &f64)| count / f64::from(1u32 << (level + 1 + k as u32)).powi(2);
        counts.iter().enumerate().map(share).fold(0.0, f64::max)
    }

    /// From where the target was met.
    pub fn of(&self, target: Target) -> impl Iterator<Item = GridPoint> + Clone + '_ {
        self.met.range((target, 0)..=(target, u64::MAX)).map(|(_, code)| point(*code))
    }
}

/// Cells of one term that are held dark.
#[derive(Default)]
pub struct DarkCells {
    cells: HashMap<u64, Darkness, GridHasher>,
    /// A bit for each level that ever had a dark cell: most have none.
    levels: u32,
}

/// Why a cell is held dark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Darkness {
    /// The word's chains do not exist there, or are outside its borders.
    NoChain,
    /// They exist and miss the lamp, or are hidden from it.
    NoLight,
}

impl DarkCells {
    /// Notes a dark cell.
    pub fn add(&mut self, cell: Square, why: Darkness) {
        self.cells.insert(cell.key(), why);
        self.levels |= 1 << cell.level;
    }

    /// Takes out the dark cell that holds a grid point, if one does and is dark for a reason that a
    /// chain which met the letter (not the lamp) contradicts, or for any if it met the lamp.
    pub fn take(&mut self, at: GridPoint, first: u32, met_lamp: bool) -> Option<Square> {
        let found = self.around(at, first, |why| met_lamp || why == Darkness::NoChain)?;
        self.cells.remove(&found.key());
        Some(found)
    }

    /// The largest cell from a level on that holds a grid point and is dark for a reason that `counts`.
    fn around(
        &self,
        at: GridPoint,
        first: u32,
        counts: impl Fn(Darkness) -> bool,
    ) -> Option<Square> {
        let levels = (first..=LAST_LEVEL).filter(|level| self.levels & (1 << level) != 0);
        let mut cells = levels.map(|level| Square::around(at, level));
        cells.find(|cell| self.cells.get(&cell.key()).is_some_and(|why| counts(*why)))
    }

    /// Takes out the cells held to have no chains on whose upper borders a grid point lies, but in none of their corners:
    /// `take` finds those that hold it.
    pub fn take_beside(&mut self, at: GridPoint, first: u32) -> ArrayVec<Square, 3> {
        let mut cells = ArrayVec::new();
        for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
            let (Some(i), Some(j)) = (at.i.checked_sub(di), at.j.checked_sub(dj)) else { continue };
            // Cells with the point on their upper borders are no larger than its place on the grid lets them be.
            let aligned = GRID_BITS - ((at.i * di) | (at.j * dj)).trailing_zeros().min(GRID_BITS);
            let below = GridPoint { i, j };
            let beside = self.around(below, first.max(aligned), |why| why == Darkness::NoChain);
            if let Some(cell) = beside.filter(|c| c.touches(at) && !c.corners().contains(&at)) {
                self.cells.remove(&cell.key());
                cells.push(cell);
            }
        }
        cells
    }
}

/// Up to `count` of some points, evenly spaced among them.
fn spread_over(points: impl Iterator<Item = GridPoint> + Clone, count: usize) -> Vec<GridPoint> {
    let stride = points.clone().count().div_ceil(count.max(1)).max(1);
    points.step_by(stride).collect()
}

/// Number of a grid point along a Z-shaped curve, which runs through each cell in one piece.
fn along_curve(at: GridPoint) -> u64 {
    spread(at.i) << 1 | spread(at.j)
}

fn point(code: u64) -> GridPoint {
    GridPoint { i: gather(code >> 1), j: gather(code) }
}

/// Puts a zero between bits.
fn spread(x: u32) -> u64 {
    let mut x = u64::from(x);
    x = (x | x << 16) & 0x0000_ffff_0000_ffff;
    x = (x | x << 8) & 0x00ff_00ff_00ff_00ff;
    x = (x | x << 4) & 0x0f0f_0f0f_0f0f_0f0f;
    x = (x | x << 2) & 0x3333_3333_3333_3333;
    (x | x << 1) & 0x5555_5555_5555_5555
}

fn gather(x: u64) -> u32 {
    let mut x = x & 0x5555_5555_5555_5555;
    x = (x | x >> 1) & 0x3333_3333_3333_3333;
    x = (x | x >> 2) & 0x0f0f_0f0f_0f0f_0f0f;
    x = (x | x >> 4) & 0x00ff_00ff_00ff_00ff;
    x = (x | x >> 8) & 0x0000_ffff_0000_ffff;
    ((x | x >> 16) & 0xffff_ffff) as u32
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const TARGET: Target = Target { shape: ShapeId(3), primitive: None, front: true, lamp: false };

    #[test]
    fn landings_are_found_in_the_cells_that_hold_them() {
        let mut landings = Landings::default();
        let mut dark = DarkCells::default();
        let points: Vec<GridPoint> = (0..200u32)
            .map(|k| GridPoint { i: k * 83_701 % (1 << 24), j: k * 5_915_587 % (1 << 24) })
            .collect();
        for at in &points {
            landings.add(TARGET, *at);
            for level in 3..=LAST_LEVEL {
                assert!(landings.any(TARGET, Square::around(*at, level)));
                assert!(!landings.any(Target { lamp: true, ..TARGET }, Square::around(*at, level)));
            }
        }
        let n = 1u32 << (GRID_BITS - 6);
        for (i, j) in (0..64).flat_map(|i| (0..64).map(move |j| (i * n, j * n))) {
            let cell = Square { level: 6, i, j };
            let inside =
                points.iter().any(|p| (i..i + n).contains(&p.i) && (j..j + n).contains(&p.j));
            assert_eq!(landings.any(TARGET, cell), inside);
        }
        landings.add(Target { lamp: true, ..TARGET }, points[0]);
        let spread = landings.some(TARGET, 10);
        assert!(spread.len() == 10 && spread.iter().all(|p| points.contains(p)));
        // The first of the points is the domain's corner, and on every grid.
        landings.add_nothing(points[0]);
        assert_eq!(landings.share(TARGET, 3), (0.25 / 64.0, 200.0 / 202.0));
        let cell = Square::around(points[7], 5);
        dark.add(cell, Darkness::NoLight);
        assert_eq!(dark.take(points[7], 3, false), None);
        assert_eq!(dark.take(points[7], 3, true), Some(cell));
        assert_eq!(dark.take(points[7], 3, true), None);
    }
}
