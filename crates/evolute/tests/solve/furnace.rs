//! White furnace: a room whose walls all glow and reflect, with a curved mirror and a ball of glass in it
//! (`cases/furnace/room.xml`). Its radiosity is M/(1 − ρ) everywhere, whatever stands where.

use std::f64::consts::PI;

use evolute::geometry::Rgb;
use evolute::scene::load_file;
use evolute::solve::{Component, Solver};
use evolute::trace::Tracer;

use crate::cases::path;
use crate::{settings, solved};

/// By how much the radiosity is off at all vertices of all three layers, as a part of it, whether that is within what is
/// estimated, with a line on each: the light of the vertex's own layer is its own, that of the others is read from
/// their meshes.
fn deviations(solver: &Solver<'_>, exitance: f64, reflectance: f64) -> Vec<(f64, bool, String)> {
    let solution = solver.solution();
    let expected = exitance / (1.0 - reflectance);
    let mut all = Vec::new();
    for own in Component::ALL {
        for (sheet, mesh) in solution.layer(own).meshes().iter().enumerate() {
            for (v, vertex) in mesh.vertices().iter().enumerate() {
                let light = Component::ALL.map(|component| {
                    let layer = solution.layer(component);
                    if component == own {
                        layer.irradiance(sheet)[v]
                    } else {
                        layer.at(sheet, &vertex.site)
                    }
                });
                let received = light.iter().copied().fold(Rgb::BLACK, |sum, e| sum + e).luminance();
                let off = (exitance + reflectance * received) / expected - 1.0;
                let parts = light.map(|e| e.luminance() / exitance);
                let at = vertex.position;
                let estimate = solution.error_at(sheet, &vertex.site);
                let is_within = (off * expected).abs() <= reflectance * estimate;
                all.push((off, is_within, format!("{own:?} vertex at {at:.4}: {parts:.4?} of M")));
            }
        }
    }
    all
}

fn check(reflectance: f64) {
    let parameters = [("rho".to_string(), reflectance.to_string())];
    let scene = load_file(path("furnace", "room.xml"), &parameters).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let solver = solved(&scene, &tracer, &settings(ACCURACY, Some(EDGE)));
    assert!(solver.ledger().escaped.is_black());
    let all = deviations(&solver, PI, reflectance);
    let squares: f64 = all.iter().map(|(off, ..)| off * off).sum();
    let within = all.iter().filter(|a| a.1).count() as f64 / all.len() as f64;
    let (worst, _, place) = all.iter().max_by(|a, b| a.0.abs().total_cmp(&b.0.abs())).unwrap();
    let accuracy = solver.solution().accuracy(ACCURACY, 0.0);
    println!(
        "rho {reflectance}: {} vertices, {:.2} % within the estimate, {accuracy:.4?}; rms {:.3} %, worst {:+.3} %: {place}",
        all.len(),
        100.0 * within,
        100.0 * (squares / all.len() as f64).sqrt(),
        100.0 * worst
    );
    assert!(worst.abs() <= 0.003);
    assert!(within >= 0.99, "{within}");
}

/// What .3 % everywhere takes.
const ACCURACY: f64 = 1e-2;
const EDGE: f64 = 0.35;

#[test]
fn white_furnace_of_medium_walls() {
    check(0.5);
}

#[test]
fn white_furnace_of_bright_walls() {
    check(0.8);
}
