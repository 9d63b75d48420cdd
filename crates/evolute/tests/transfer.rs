//! Known answers for light at a receiver.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod common;

use common::{BOTH, SPECULAR, black, glass, mirror, receiver, rectangle, scene, settings, shape};
use std::sync::atomic::{AtomicU32, Ordering};

use evolute::geometry::{Point3, Transform};
use evolute::surface::{Cylinder, Sphere, Surface};
use evolute::trace::Tracer;
use evolute::transfer::{LONGEST_CHAIN, ReceiverLight, Transfer, TransferSettings, lambert};

/// Design: square light (−12, 10, 8), open cylinder x² + z² = 100, 0 ≤ y ≤ 4, one reflection.
#[test]
fn mirror_ring() {
    let ring = Cylinder::new(
        Point3::origin(),
        Point3::new(0.0, 4.0, 0.0),
        10.0,
        Transform::identity(),
        false,
    )
    .unwrap();
    let lamp = rectangle([-12.0, 10.0, 8.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]);
    let scene = scene(vec![
        shape("ring", Surface::Cylinder(ring), mirror(), 0.0),
        shape("lamp", lamp, black(), 70000.0),
    ]);
    let tracer = Tracer::new(&scene);
    for accuracy in [1e-2, 1e-3, 1e-4] {
        let settings = TransferSettings { max_specular: 1, ..settings(accuracy) };
        let transfer = Transfer::new(&scene, &tracer, settings);
        for (x, z, expected) in [
            (0.0, 0.0, 0.404806),
            (3.0, -2.0, 15.898446),
            (5.0, -3.0, 2.278864),
            (8.0, 0.0, 1.677531),
            (6.0, -6.0, 1.155337),
            (5.0, 0.0, 0.323928),
        ] {
            let got = transfer.light(&receiver([x, 0.0, z], [0.0, 1.0, 0.0]), SPECULAR);
            let error = (got.specular[1] - expected).abs();
            println!(
                "{accuracy} ({x},{z}) {:.6} {expected} rel {:.1e} est {:.1e} {:?} met {}",
                got.specular[1],
                error / expected,
                got.error / expected,
                got.counts,
                got.met
            );
            assert!(error <= (accuracy * expected).max(1e-6), "{x} {z}");
        }
    }
}

/// A mirror sphere and a glass sphere in an evenly bright box: E = π L everywhere.
#[test]
fn white_furnace() {
    for (material, name) in [(mirror(), "mirror"), (glass(1.5), "glass")] {
        let ball =
            Sphere::new(Point3::new(0.2, 0.1, -0.3), 0.8, Transform::identity(), false).unwrap();
        let mut shapes = vec![shape("ball", Surface::Sphere(ball), material, 0.0)];
        let s = 3.0;
        for (k, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
            let mut c = [0.0; 3];
            c[k] = s * sign;
            let (mut p, mut q) = ([0.0; 3], [0.0; 3]);
            p[(k + 1) % 3] = s;
            q[(k + 2) % 3] = -s * sign;
            shapes.push(shape("wall", rectangle(c, p, q), black(), 1.0));
        }
        let scene = scene(shapes);
        let tracer = Tracer::new(&scene);
        let transfer = Transfer::new(&scene, &tracer, settings(1e-3));
        for (p, n) in [
            ([1.5, 0.2, 0.1], [-1.0, 0.2, 0.3]),
            ([-1.0, -2.0, 1.0], [0.0, 1.0, 0.0]),
            ([0.2, 1.0, -0.3], [0.3, -1.0, 0.0]),
        ] {
            let got = transfer.light(&receiver(p, n), BOTH);
            let e = got.direct[1] + got.specular[1];
            println!(
                "{name} {:.6} direct {:.4} est {:.1e} {:?} met {}",
                e / std::f64::consts::PI,
                got.direct[1],
                got.error,
                got.counts,
                got.met
            );
            assert!((e / std::f64::consts::PI - 1.0).abs() < 1e-3);
        }
    }
}

/// Stopped after any number of questions, the light so far lies within its error of the light.
#[test]
fn a_stopped_receiver_says_what_it_may_lack() {
    let ball = |x, y, z, r| {
        Surface::Sphere(Sphere::new(Point3::new(x, y, z), r, Transform::identity(), false).unwrap())
    };
    // Two mirrors that nearly face each other, a glass ball, a square lamp and a round one.
    let scene = scene(vec![
        shape("left", rectangle([-2.0, 0.0, 1.0], [0.0, 1.5, 0.0], [0.1, 0.0, 1.5]), mirror(), 0.0),
        shape("right", rectangle([2.0, 0.0, 1.0], [0.0, 0.0, 1.5], [0.1, 1.5, 0.0]), mirror(), 0.0),
        shape("ball", ball(0.3, 1.4, 0.8, 0.4), glass(1.5), 0.0),
        shape(
            "lamp",
            rectangle([0.0, 0.0, 3.0], [0.5, 0.0, 0.0], [0.0, -0.5, 0.0]),
            black(),
            100.0,
        ),
        shape("bulb", ball(-1.0, -1.0, 1.5, 0.2), black(), 300.0),
    ]);
    let tracer = Tracer::new(&scene);
    let receiver = receiver([0.1, 0.0, 0.0], [0.1, 0.0, 1.0]);
    let with = |accuracy| TransferSettings { max_specular: 6, ..settings(accuracy) };
    // Its chains run out, which does not matter: what it reached is known.
    let fine = Transfer::new(&scene, &tracer, with(1e-4)).light(&receiver, BOTH);
    let transfer = Transfer::new(&scene, &tracer, with(1e-3));
    let whole = transfer.light(&receiver, BOTH);
    assert!(whole.met && !whole.stopped && fine.error < 0.25 * whole.error);
    // What the estimate misses when nothing stops it is not what this is about.
    let sum = |light: &ReceiverLight| (light.direct + light.specular).luminance();
    let missed = (sum(&fine) - sum(&whole)).abs();
    assert!(missed <= whole.error + fine.error, "{missed} {}", whole.error);
    let mut chains = 0;
    let mut stops = 0;
    for patience in (0..40).chain((40..400).step_by(20)) {
        let asked = AtomicU32::new(0);
        let stop = || asked.fetch_add(1, Ordering::Relaxed) >= patience;
        let got = transfer.light_until(&receiver, BOTH, 0.0, &stop);
        if !got.stopped {
            assert_eq!(got, whole);
            continue;
        }
        stops += 1;
        // Whoever said yes is not asked again.
        assert_eq!(asked.into_inner(), patience + 1);
        let lacks = (sum(&fine) - sum(&got)).abs();
        println!("{patience} {lacks:.3} {:.3} {:?}", got.error, got.counts);
        assert!(!got.met && lacks <= got.error + missed, "{patience}: {lacks} {}", got.error);
        assert!(got.counts.chains >= chains && got.counts.chains <= whole.counts.chains);
        chains = got.counts.chains;
    }
    assert!(stops > 40, "{stops}");
    // At once: nothing is traced, and the error is all that the lamps could give.
    let none = transfer.light_until(&receiver, BOTH, 0.0, &|| true);
    assert!(none.direct.is_black() && none.specular.is_black() && none.counts.chains == 0);
}

/// A lamp between two lossless mirrors: its images make a wall without end. Chains that are wanted
/// and longer than the longest that is followed count in the error; chains that are not wanted do not.
#[test]
fn chains_that_are_cut_count_in_the_error() {
    let (gap, far) = (0.1, 0.5);
    let scene = scene(vec![
        shape("floor", rectangle([0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]), mirror(), 0.0),
        shape("roof", rectangle([0.0, 0.0, gap], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]), mirror(), 0.0),
        shape(
            "lamp",
            rectangle([far, 0.0, 0.5 * gap], [0.0, 0.0, 0.5 * gap], [0.0, 0.5, 0.0]),
            black(),
            1.0,
        ),
    ]);
    let tracer = Tracer::new(&scene);
    let receiver = receiver([0.0, 0.0, 0.5 * gap], [0.0, 0.0, 1.0]);
    // The n-th image fills the wall from n to n + 1 gaps.
    let wall = |to: f64| {
        let corner = |y, z| Point3::new(far, y, gap * z);
        let corners = [corner(-0.5, 1.0), corner(-0.5, to), corner(0.5, to), corner(0.5, 1.0)];
        lambert(&receiver, &corners)
    };
    let light = |max_specular| {
        let settings = TransferSettings { max_specular, ..settings(0.01) };
        Transfer::new(&scene, &tracer, settings).light(&receiver, SPECULAR)
    };
    let short = light(4);
    println!("{} {:?}", wall(5.0), short);
    assert!(short.met && (short.specular[1] - wall(5.0)).abs() <= 0.01 * wall(5.0));
    let (wanted, cut) = (light(LONGEST_CHAIN), light(LONGEST_CHAIN + 1));
    println!("{} {:?} {:?}", wall(257.0), wanted, cut);
    // There are too many to follow each to the end; the estimate says what may be missing.
    assert!((wanted.specular[1] - wall(257.0)).abs() <= wanted.error);
    assert!(wanted.error < 0.1 * wall(257.0));
    // The same light, but what the mirrors still pass on is missing.
    assert_eq!(cut.specular, wanted.specular);
    assert!(!cut.met && cut.error - wanted.error >= wall(1e6) - wall(257.0));
}
