//! Rows that conserve flux: what a patch sends and what the vertices receive of it made the same.
//!
//! Rows are integrated each on its own. So each sees exactly as much as there is to see, but what all of
//! them together receive of one patch differs from what it sends, by a fraction of a percent; in a bright
//! room that adds up over all bounces. Both are known: what a vertex sees is the sum of its row, what a
//! patch sends is what its corners do not lose. Alternate scaling of columns and rows finds the nearest
//! transport (in relative entropy) that has both (Sinkhorn and Knopp 1967). How much it takes is a measure of
//! the error of rows and meshes, and is told.

use super::solution::PatchCorners;
use super::transport::{BoundRow, Fate};

/// Changes of factors below this end the scaling: less than any accuracy that is asked for.
const SETTLED: f64 = 1e-7;
const MOST_ROUNDS: usize = 200;

/// Scales rows; the mean over all flux of |1 − factor|.
pub(super) fn balance(
    rows: &mut [BoundRow],
    fates: &[Fate],
    patches: &[PatchCorners],
    area: &[f64],
) -> f64 {
    // Straight links are the same in all channels.
    let target: Vec<[f64; 3]> = patches
        .iter()
        .map(|p| {
            [0, 1, 2].map(|c| {
                let fate = &fates[p.vertices[c] as usize];
                p.weights[c] * (fate.straight - fate.losses[0].sum())[0]
            })
        })
        .collect();
    let sums: Vec<f64> =
        rows.iter().map(|r| r.straight.iter().flat_map(|e| e.1).sum::<f64>()).collect();
    let before: Vec<Vec<[f64; 3]>> =
        rows.iter().map(|r| r.straight.iter().map(|e| e.1).collect()).collect();
    for _ in 0..MOST_ROUNDS {
        let mut received = vec![[0.0; 3]; patches.len()];
        for (row, a) in rows.iter().zip(area) {
            for (p, w) in &row.straight {
                for c in 0..3 {
                    received[*p as usize][c] += a * w[c];
                }
            }
        }
        let factor = |p: usize, c: usize| {
            if received[p][c] > 0.0 { target[p][c] / received[p][c] } else { 1.0 }
        };
        let mut change: f64 = 0.0;
        for (row, sum) in rows.iter_mut().zip(&sums) {
            let mut scaled = 0.0;
            for (p, w) in &mut row.straight {
                for c in 0..3 {
                    w[c] *= factor(*p as usize, c);
                    scaled += w[c];
                }
            }
            if scaled > 0.0 {
                let factor = sum / scaled;
                change = change.max((factor - 1.0).abs());
                row.straight.iter_mut().for_each(|e| e.1 = e.1.map(|w| w * factor));
            }
        }
        if change < SETTLED {
            break;
        }
    }
    let (mut changed, mut all) = (0.0, 0.0);
    for ((row, before), a) in rows.iter().zip(&before).zip(area) {
        for (after, before) in row.straight.iter().zip(before) {
            for c in 0..3 {
                changed += a * (after.1[c] - before[c]).abs();
                all += a * before[c];
            }
        }
    }
    if all > 0.0 { changed / all } else { 0.0 }
}
