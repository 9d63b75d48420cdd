//! The radiosity solution against known answers.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "solve/black.rs"]
mod black;
#[allow(dead_code, missing_docs)] // shared with the answers at receivers, which need more of it
#[path = "answers/cases.rs"]
mod cases;
mod common;
#[path = "solve/contacts.rs"]
mod contacts;
#[path = "solve/estimates.rs"]
mod estimates;
#[path = "solve/furnace.rs"]
mod furnace;
#[path = "solve/schemes.rs"]
mod schemes;
#[path = "solve/spot.rs"]
mod spot;
#[path = "solve/ward.rs"]
mod ward;

use std::f64::consts::PI;
use std::time::Instant;

use common::{rectangle, scene, shape};
use evolute::geometry::Rgb;
use evolute::scene::{Material, Scene, SideMaterial};
use evolute::solve::{Component, Scheme, Solver, SolverSettings};
use evolute::trace::Tracer;
use evolute::transfer::{Control, TransferSettings};

fn diffuse(reflectance: f64) -> Material {
    let side = SideMaterial { diffuse: Rgb::grey(reflectance), mirror: None };
    Material { front: side, back: SideMaterial::default(), dielectric: None }
}

/// A room [0, size] with a lamp in the middle of its ceiling, which is as black as `lamp` says or part of it.
fn room(
    size: [f64; 3],
    [floor, wall, ceiling, lamp]: [f64; 4],
    lamp_side: f64,
    radiance: f64,
) -> Scene {
    let [a, b, c] = size.map(|s| 0.5 * s);
    let sheet = |id: &str, c: [f64; 3], p: [f64; 3], q: [f64; 3], reflectance| {
        shape(id, rectangle(c, p, q), diffuse(reflectance), 0.0)
    };
    let (x, y, z) = ([a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]);
    let mut shapes = vec![
        sheet("floor", [a, b, 0.0], x, y, floor),
        sheet("wall", [0.0, b, c], y, z, wall),
        sheet("wall", [2.0 * a, b, c], z, y, wall),
        sheet("wall", [a, 0.0, c], z, x, wall),
        sheet("wall", [a, 2.0 * b, c], x, z, wall),
    ];
    let cuts = |half: f64| [0.0, half - 0.5 * lamp_side, half + 0.5 * lamp_side, 2.0 * half];
    let (along, across) = (cuts(a), cuts(b));
    for i in 0..3 {
        for j in 0..3 {
            let middle = |cuts: [f64; 4], k: usize| 0.5 * (cuts[k] + cuts[k + 1]);
            let half = |cuts: [f64; 4], k: usize| 0.5 * (cuts[k + 1] - cuts[k]);
            let surface = rectangle(
                [middle(along, i), middle(across, j), 2.0 * c],
                [0.0, half(across, j), 0.0],
                [half(along, i), 0.0, 0.0],
            );
            let is_lamp = i == 1 && j == 1;
            let reflectance = if is_lamp { lamp } else { ceiling };
            let radiance = if is_lamp { radiance } else { 0.0 };
            shapes.push(shape("ceiling", surface, diffuse(reflectance), radiance));
        }
    }
    scene(shapes)
}

fn settings(relative: f64, edge: Option<f64>) -> SolverSettings {
    SolverSettings {
        transfer: TransferSettings { relative, ..TransferSettings::default() },
        edge,
        scheme: Scheme::Flux,
        ..SolverSettings::default()
    }
}

/// Makes a solution; prints what it took.
fn solved<'s>(scene: &'s Scene, tracer: &Tracer<'_>, settings: &SolverSettings) -> Solver<'s> {
    let clock = Instant::now();
    let mut solver = Solver::new(scene, tracer, settings, &Control::GO).unwrap();
    let made = clock.elapsed().as_secs_f64();
    while solver.step().is_some() {}
    solver.finish();
    println!(
        "  made in {made:.2} s, solved by {:.2} s: {:?}",
        clock.elapsed().as_secs_f64(),
        solver.counts()
    );
    println!("  {:?}", solver.ledger());
    let ledger = solver.ledger();
    assert!(ledger.imbalance().max().abs() <= 1e-9 * ledger.emitted.max());
    solver
}

/// Mean of the indirect irradiance over all sheets, and their area.
fn mean_indirect(solver: &Solver<'_>) -> (f64, f64) {
    let reflected = solver.solution().layer(Component::Indirect);
    let areas = reflected.meshes().iter().map(|mesh| mesh.surface().area());
    let area = areas.sum();
    (reflected.flux().0.luminance() / area, area)
}

/// CIE 171:2006, 5.8. Shots conserve flux, so what is left is the light of the lamp, interpolated over the meshes.
#[test]
fn diffuse_cube() {
    for (reflectance, accuracy) in [(0.05, 1e-2), (0.5, 1e-2), (0.8, 1e-2), (0.95, 1e-2)] {
        let scene = room([4.0; 3], [reflectance; 4], 1.0, 10_000.0 / PI);
        let tracer = Tracer::new(&scene);
        let solver = solved(&scene, &tracer, &settings(accuracy, None));
        let (mean, area) = mean_indirect(&solver);
        let expected = reflectance * 10_000.0 / (96.0 * (1.0 - reflectance));
        let off = mean / expected - 1.0;
        let estimate = solver.solution().accuracy(accuracy, 0.0);
        println!(
            "rho {reflectance}, -a {accuracy}: {mean:.3} lx, {expected:.3} expected, {:+.3} %; {estimate:.4?}",
            100.0 * off
        );
        assert!((area - 96.0).abs() < 1e-9);
        assert!(off.abs() < 0.002);
        assert!(off.abs() < estimate.mean);
        assert!(solver.ledger().escaped.is_black());
    }
}
