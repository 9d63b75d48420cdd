//! Separate against joint specular iterations of the radiosity solution (Yu & Wu, 3.2), one thread:
//! `cargo bench -p evolute --bench schemes`.
//!
//! For each scene meshes and rows are made once; then each scheme runs its loop on them. Printed are the
//! processor time of the loop, its iterations, the links that its shots followed, and by how much the
//! indirect irradiance at the vertices differs from that of the first scheme, as a part of its mean.
//! `-- --only ward` takes one scene; `-- --printed` adds the scheme as printed, which looks for the brightest patch
//! before each shot.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use evolute::geometry::Rgb;
use evolute::scene::load_file;
use evolute::solve::{Component, Scheme, Solver, SolverSettings};
use evolute::trace::Tracer;
use evolute::transfer::{Control, TransferSettings};
use std::path::Path;
use std::time::Instant;

/// A scene of `cases/` and how finely it is meshed.
struct Case {
    name: &'static str,
    file: &'static str,
    definitions: &'static [(&'static str, &'static str)],
    accuracy: f64,
    /// First edges [m]: coarse, as making meshes and rows is not what is measured.
    edge: f64,
}

const CASES: [Case; 3] = [
    Case { name: "room", file: "room/scene.xml", definitions: &[], accuracy: 5e-2, edge: 0.5 },
    Case {
        name: "ward",
        file: "ward_room/scene.xml",
        definitions: &[("west", "mirror")],
        accuracy: 1e-2,
        edge: 0.5,
    },
    Case { name: "furnace", file: "furnace/room.xml", definitions: &[], accuracy: 1e-2, edge: 0.8 },
];

/// Processor time of this thread [s], so that other work on the machine counts less; the clock's where
/// the system has no such figure.
fn processor_time() -> f64 {
    static BEGINNING: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|s| s.split(' ').next()?.parse::<f64>().ok())
        .map_or_else(|| BEGINNING.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

/// Indirect irradiance at all vertices, luminances [W/m²].
fn indirect(solver: &Solver<'_>) -> Vec<f64> {
    let layer = solver.solution().layer(Component::Indirect);
    let of = |sheet| layer.irradiance(sheet).iter().map(Rgb::luminance);
    (0..layer.meshes().len()).flat_map(of).collect()
}

/// The largest and the root mean square of the differences, as parts of the mean of the first.
fn differences(a: &[f64], b: &[f64]) -> [f64; 2] {
    let n = a.len() as f64;
    let mean = a.iter().sum::<f64>() / n;
    let each = || a.iter().zip(b).map(|(a, b)| (a - b).abs() / mean);
    [each().fold(0.0, f64::max), (each().map(|d| d * d).sum::<f64>() / n).sqrt()]
}

fn measure(case: &Case, schemes: &[Scheme]) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases").join(case.file);
    let definitions: Vec<(String, String)> =
        case.definitions.iter().map(|(n, v)| ((*n).into(), (*v).into())).collect();
    let scene = load_file(&file, &definitions).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let settings = SolverSettings {
        transfer: TransferSettings {
            relative: case.accuracy,
            absolute: case.accuracy * 1e-3 * scene.emitted_flux().luminance()
                / scene.surface_area(),
            ..TransferSettings::default()
        },
        edge: Some(case.edge),
        ..SolverSettings::default()
    };
    let made = Solver::new(&scene, &tracer, &settings, &Control::GO).unwrap();
    let [straight, specular] = made.counts().links;
    println!(
        "{}: -a {}, {:?} patches, {:?} vertices, {straight} straight and {specular} specular links",
        case.name,
        case.accuracy,
        made.counts().patches,
        made.counts().vertices
    );
    let mut first: Option<Vec<f64>> = None;
    for &scheme in schemes {
        let mut solver = made.clone();
        solver.set_scheme(scheme);
        let start = processor_time();
        while solver.step().is_some() {}
        let seconds = processor_time() - start;
        let light = indirect(&solver);
        let [most, rms] = differences(first.as_ref().unwrap_or(&light), &light);
        let counts = solver.counts();
        println!(
            "{:10} {:8} {seconds:8.3} s  {:7} diffuse {:3} specular  {:12} straight {:11} specular replayed  differs by \
             {:.3} % at most, {:.3} % rms; correction {:.3} %",
            case.name,
            format!("{scheme:?}"),
            counts.diffuse,
            counts.specular,
            counts.replayed[0],
            counts.replayed[1],
            100.0 * most,
            100.0 * rms,
            100.0 * counts.correction,
        );
        first.get_or_insert(light);
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let only = arguments.iter().position(|a| a == "--only").and_then(|i| arguments.get(i + 1));
    let only = only.cloned().unwrap_or_default();
    let mut schemes = vec![Scheme::Flux, Scheme::Joint];
    if arguments.iter().any(|a| a == "--printed") {
        schemes.push(Scheme::Printed);
    }
    for case in CASES.iter().filter(|c| c.name.contains(&only)) {
        measure(case, &schemes);
    }
}
