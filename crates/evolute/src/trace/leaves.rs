//! The triangles of the hierarchy's leaves, packed so that a ray waits for memory once a leaf.
//!
//! A leaf is a run of whole cache lines: a head, its triangles as indices, and its corners, each once.
//! Corners are sheared once a leaf, not once a triangle, which also makes the leaf's triangles meet
//! without gaps by construction.

use super::hierarchy::LEAF_SIZE;
use super::triangle::{Shear, Sheared, Triangle, TriangleCrossing};
use crate::geometry::Point3;
use arrayvec::ArrayVec;
use prefetch_index::prefetch_index;

/// Words of 64 bits in a cache line.
const LINE: usize = 8;
/// Words before the corners: the counts, and up to eight triangles of three one-byte indices.
const HEAD: usize = 4;
/// Lines asked for ahead: the size of a leaf of eight connected triangles, which have about eight
/// corners.
const AHEAD: usize = 4;

const MOST: usize = LEAF_SIZE as usize;

/// All leaves of triangles of a hierarchy.
#[derive(Clone, Debug)]
pub(super) struct TriangleLeaves {
    /// Head: number of triangles, number of corners << 8, first entry in `ids` << 32; triangles; then
    /// coordinates as bits.
    words: Vec<u64>,
    /// First word of line 0: such that lines are cache lines.
    base: usize,
    /// Shape and triangle.
    ids: Vec<(u32, u32)>,
}

impl TriangleLeaves {
    /// From the triangles of each leaf; and each leaf's first line.
    pub fn new<'t>(leaves: impl Iterator<Item = &'t [Triangle]>) -> (Self, Vec<u32>) {
        let (mut words, mut ids, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        for leaf in leaves {
            lines.push((words.len() / LINE) as u32);
            let mut corners: ArrayVec<Point3, { 3 * MOST }> = ArrayVec::new();
            let mut head = [0u64; HEAD];
            let first = ids.len() as u64;
            for (i, triangle) in leaf.iter().take(MOST).enumerate() {
                for (j, corner) in triangle.corners.iter().enumerate() {
                    // At most 24 different ones: every index fits a byte, and there is room.
                    let known = corners.iter().position(|c| c == corner);
                    let index = known.unwrap_or_else(|| {
                        corners.push(*corner);
                        corners.len() - 1
                    });
                    let byte = 3 * i + j;
                    head[1 + byte / 8] |= (index as u64) << (8 * (byte % 8));
                }
                ids.push((triangle.shape, triangle.primitive));
            }
            head[0] = leaf.len().min(MOST) as u64 | (corners.len() as u64) << 8 | first << 32;
            words.extend(head);
            words.extend(corners.iter().flat_map(|c| [c.x, c.y, c.z]).map(f64::to_bits));
            words.resize(words.len().next_multiple_of(LINE), 0);
        }
        // Moved so that line 0 begins where a cache line does.
        words.splice(0..0, [0; LINE]);
        let misplaced = (words.as_ptr().addr() / 8) % LINE;
        let base = LINE - misplaced;
        words.drain(base..LINE);
        (Self { words, base, ids }, lines)
    }

    /// Asks for a leaf's memory.
    #[inline(always)]
    pub fn prefetch(&self, line: usize) {
        for i in 0..AHEAD {
            prefetch_index(&self.words, self.base + LINE * (line + i));
        }
    }

    /// The leaf at a line: its first id, its triangles' indices and its corners' words.
    #[inline(always)]
    fn leaf(&self, line: usize) -> (&[(u32, u32)], [u64; 3], &[u64]) {
        let words = self.words.get(self.base + LINE * line..).unwrap_or_default();
        let Some((&[head, a, b, c], rest)) = words.split_first_chunk() else {
            return (&[], [0; 3], &[]);
        };
        let (count, corners, first) = (head & 0xff, (head >> 8) & 0xff, (head >> 32) as usize);
        let ids = self.ids.get(first..first + count as usize).unwrap_or_default();
        (ids, [a, b, c], rest.get(..3 * corners as usize).unwrap_or_default())
    }

    /// All triangles of a leaf.
    pub fn triangles(&self, line: usize) -> impl Iterator<Item = Triangle> {
        let (ids, indices, words) = self.leaf(line);
        ids.iter().enumerate().map(move |(i, &(shape, primitive))| Triangle {
            corners: corner_indices(&indices, i).map(|c| corner(words, c)),
            shape,
            primitive,
        })
    }

    /// Calls `found` for every triangle of a leaf that the ray's line meets, until it returns true;
    /// whether it did.
    #[inline(always)]
    pub fn crossings(
        &self,
        line: usize,
        shear: &Shear,
        mut found: impl FnMut(&Triangle, &TriangleCrossing) -> bool,
    ) -> bool {
        let (ids, indices, words) = self.leaf(line);
        let mut sheared = [Sheared::default(); 3 * MOST + 8];
        for (s, c) in sheared.iter_mut().zip(words.as_chunks::<3>().0) {
            *s = shear.apply(&c.map(f64::from_bits));
        }
        for (i, &(shape, primitive)) in ids.iter().enumerate() {
            let corners = corner_indices(&indices, i);
            // Indices are below 24; the mask says so to the compiler.
            if let Some(crossing) = shear.crossing(&corners.map(|c| sheared[c & 31])) {
                let corners = corners.map(|c| corner(words, c));
                if found(&Triangle { corners, shape, primitive }, &crossing) {
                    return true;
                }
            }
        }
        false
    }
}

#[inline(always)]
fn corner_indices(indices: &[u64; 3], triangle: usize) -> [usize; 3] {
    [0, 1, 2].map(|j| {
        let byte = 3 * triangle + j;
        (indices[(byte / 8) % 3] >> (8 * (byte % 8))) as usize & 0xff
    })
}

#[inline(always)]
fn corner(words: &[u64], i: usize) -> Point3 {
    match words.get(3 * i..3 * i + 3) {
        Some(&[x, y, z]) => Point3::from([x, y, z].map(f64::from_bits)),
        _ => Point3::origin(),
    }
}
