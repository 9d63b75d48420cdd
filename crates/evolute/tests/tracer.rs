//! The tracer against a slow search, at borders, and far from the origin.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod brute;

use brute::{compare, scenes};
use evolute::geometry::Vector3;

/// `undecided` is the share of rays that may be beyond double precision.
fn agree(scale: f64, shift: Vector3, rays: usize, undecided: f64) {
    for (kind, scene) in scenes(7, scale, shift) {
        let tally = compare(&scene, 1, rays);
        println!(
            "{kind}: {} rays, {} hits, {} undecided, {} disagreements, {:.1e} off the ray",
            tally.rays,
            tally.hits,
            tally.undecided,
            tally.disagreements.len(),
            tally.off_ray
        );
        for d in tally.disagreements.iter().take(5) {
            println!("  {d}");
        }
        assert!(tally.disagreements.is_empty(), "{kind}");
        assert!(tally.undecided as f64 <= undecided * tally.rays as f64, "{kind}");
        assert!(tally.hits * 5 > tally.rays, "{kind}");
    }
}

#[test]
fn no_ray_is_missed() {
    agree(1.0, Vector3::zeros(), 10_000, 0.001);
}

#[test]
fn no_ray_is_missed_far_from_the_origin() {
    // Grazing depths of 1e-12 and 1 m are beyond coordinates of 1,000 m.
    agree(1.0, Vector3::new(1000.0, -1000.0, 1000.0), 3_000, 0.03);
}

#[test]
fn no_ray_is_missed_in_large_and_small_scenes() {
    agree(1e6, Vector3::zeros(), 2_000, 0.001);
    agree(1e-6, Vector3::zeros(), 2_000, 0.001);
}
