//! Chains and receivers per second of the specular transfer, one thread:
//! `cargo bench -p evolute --bench chains`.
//!
//! Receivers stand on a grid over the floor of `cases/glass_ball` and over the receiver of
//! `cases/wave`, at one hundredth and one thousandth. `-- --only ball` (or `wave`) takes one scene,
//! `-- --accuracy 1e-3` one accuracy, `-- --side N` N × N receivers.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use evolute::geometry::{Point3, UnitVector3, Vector3};
use evolute::scene::load_file;
use evolute::trace::Tracer;
use evolute::transfer::{Components, Counts, Receiver, Transfer, TransferSettings};
use std::path::Path;
use std::time::Instant;

/// A scene of `cases/` and a horizontal square of receivers that look up.
struct Case {
    name: &'static str,
    height: f64,
    half: f64,
}

/// The ball's floor has its caustic within 1.2 m of the middle; the wave's receiver is 100 m wide.
const CASES: [Case; 2] = [
    Case { name: "glass_ball", height: 0.0, half: 1.2 },
    Case { name: "wave", height: -100.0, half: 50.0 },
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

/// The centres of `side` × `side` cells.
fn receivers(case: &Case, side: u32) -> Vec<Receiver> {
    let at = |k: u32| case.half * (f64::from(2 * k + 1) / f64::from(side) - 1.0);
    (0..side * side)
        .map(|k| Receiver {
            position: Point3::new(at(k % side), case.height, at(k / side)),
            normal: UnitVector3::new_unchecked(Vector3::y()),
        })
        .collect()
}

fn measure(case: &Case, accuracy: f64, side: u32) {
    let file =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases").join(case.name).join("scene.xml");
    let loaded = load_file(&file, &[]).unwrap();
    let scene = loaded.scene;
    let tracer = Tracer::new(&scene);
    let settings = TransferSettings {
        relative: accuracy,
        // As the program has it (interface of `--accuracy-abs`).
        absolute: accuracy * 1e-3 * scene.emitted_flux().luminance() / scene.surface_area(),
        ..TransferSettings::default()
    };
    let transfer = Transfer::new(&scene, &tracer, settings);
    let places = receivers(case, side);
    let (mut counts, mut unmet, mut sum) = (Counts::default(), 0, 0.0);
    let start = processor_time();
    for receiver in &places {
        let light = transfer.light(receiver, Components { direct: false, specular: true });
        counts += light.counts;
        unmet += usize::from(!light.met);
        sum += light.specular.luminance();
    }
    let seconds = processor_time() - start;
    let n = places.len() as f64;
    println!(
        "{:10} {accuracy:6.0e} {n:5} receivers  mean {:9.5} W/m²  {:6.0} chains {:5.0} cells {:6.0} \
         rays each  {:7.0} receivers/s {:9.0} chains/s {:6.2} µs a chain  {unmet} not met",
        case.name,
        sum / n,
        counts.chains as f64 / n,
        counts.cells as f64 / n,
        counts.rays as f64 / n,
        n / seconds,
        counts.chains as f64 / seconds,
        1e6 * seconds / counts.chains as f64,
    );
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |flag: &str| {
        arguments.iter().position(|a| a == flag).and_then(|i| arguments.get(i + 1).cloned())
    };
    let only = after("--only").unwrap_or_default();
    let accuracies = match after("--accuracy").and_then(|a| a.parse().ok()) {
        Some(accuracy) => vec![accuracy],
        None => vec![1e-2, 1e-3],
    };
    let side = after("--side").and_then(|n| n.parse().ok()).unwrap_or(24);
    for case in CASES.iter().filter(|c| c.name.contains(&only)) {
        for &accuracy in &accuracies {
            measure(case, accuracy, side);
        }
    }
}
