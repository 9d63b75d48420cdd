//! The folders of `cases/` and what is in them.

use std::path::PathBuf;

use evolute::scene::{Scene, load_file};
use evolute::transfer::TransferSettings;

/// A file of a case.
pub fn path(case: &str, file: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../cases").join(case).join(file)
}

/// The scene of a case, with values for its `$name`s.
pub fn load(case: &str, parameters: &[(&str, &str)]) -> Scene {
    let parameters: Vec<_> =
        parameters.iter().map(|(n, v)| ((*n).to_string(), (*v).to_string())).collect();
    load_file(path(case, "scene.xml"), &parameters).unwrap().scene
}

/// What the program takes as settings at `-a accuracy`, the scene's `max_depth` in force.
pub fn settings(scene: &Scene, accuracy: f64) -> TransferSettings {
    let mean = scene.emitted_flux().luminance() / scene.surface_area();
    let default = TransferSettings::default();
    let depth = scene.max_depth.unwrap_or(u32::MAX);
    TransferSettings {
        relative: accuracy,
        absolute: accuracy * 1e-3 * mean,
        max_specular: default.max_specular.min(depth.saturating_sub(1)),
        ..default
    }
}

/// A table of numbers: rows by columns, comment lines and the header left out.
pub fn table(case: &str, file: &str) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path(case, file)).unwrap();
    text.lines()
        .filter(|l| !l.starts_with('#'))
        .skip(1)
        .map(|l| l.split(',').map(|f| f.parse().unwrap()).collect())
        .collect()
}
