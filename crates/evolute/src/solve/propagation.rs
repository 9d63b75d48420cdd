//! How errors are passed on: a place that is lit by others is as uncertain as they are.
//!
//! To add up all errors without regard to sign would be a bound, but one that grows like 1/(1 − ρ), while shots are
//! scaled so that flux is conserved (`source.rs`): what all places together have too much or too little is known,
//! and taken out. What is left is of either sign. On one sheet it may well be of the same sign everywhere, as where
//! interpolation makes too much of a hollow function; from sheet to sheet there is no reason for that. So
//! errors are added up over each sheet, and by their squares over sheets.

use rayon::prelude::*;

use super::layer::Layer;
use super::source::Source;
use crate::geometry::Rgb;

/// Errors are passed on until they change by no more than this part of themselves, or so often.
const SETTLED: f64 = 0.01;
const MOST_ROUNDS: usize = 50;

/// Luminances that vertices of reflected light receive of the errors of one layer on one sheet [W/m²].
fn received(layer: &Layer<'_>, source: &Source, sheet: usize, vertices: usize) -> Vec<f64> {
    let mut received = vec![0.0; vertices];
    for patch in layer.patches_of(sheet) {
        let errors = [0, 1, 2].map(|c| {
            let v = layer.patches[patch].vertices[c] as usize;
            let alone = [0, 1, 2].map(|k| f64::from(u8::from(k == c)));
            // The colour of an error is not known: that which passes best.
            layer.error_in(patch, alone) * layer.reflectance[v].max()
        });
        if errors == [0.0; 3] {
            continue;
        }
        for entry in source.transport.straight(patch as u32) {
            let weights = entry.weights.map(f64::from);
            received[entry.vertex as usize] += (0..3).map(|c| errors[c] * weights[c]).sum::<f64>();
        }
        for entry in source.transport.specular(patch as u32) {
            let weights = entry.weights.map(|w| Rgb(w.map(f64::from)).max());
            received[entry.vertex as usize] += (0..3).map(|c| errors[c] * weights[c]).sum::<f64>();
        }
    }
    received
}

/// Finds what errors of all layers come to in the last one, at whose vertices reflected light is received.
pub(super) fn pass_on(layers: &mut [Layer<'_>; 3], sources: &[Source; 3]) {
    let vertices = layers[2].error.len();
    let sheets = layers[2].meshes().len();
    let of = |layers: &[Layer<'_>; 3], l: usize| -> Vec<Vec<f64>> {
        let each = (0..sheets).into_par_iter();
        each.map(|sheet| received(&layers[l], &sources[l], sheet, vertices)).collect()
    };
    let (direct, specular) = (of(layers, 0), of(layers, 1));
    for _ in 0..MOST_ROUNDS {
        let indirect = of(layers, 2);
        let mut change: f64 = 0.0;
        for (v, error) in layers[2].error.iter_mut().enumerate() {
            let of = |sheet: usize| direct[sheet][v] + specular[sheet][v] + indirect[sheet][v];
            let passed_on = (0..sheets).map(|s| of(s) * of(s)).sum::<f64>().sqrt();
            if passed_on > 0.0 {
                change = change.max((passed_on - error.passed_on).abs() / passed_on);
            }
            error.passed_on = passed_on;
        }
        if change <= SETTLED {
            break;
        }
    }
}
