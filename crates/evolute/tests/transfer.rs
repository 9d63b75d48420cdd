//! Known answers for light at a receiver.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

mod common;

use common::{BOTH, SPECULAR, black, glass, mirror, receiver, rectangle, scene, settings, shape};
use evolute::geometry::{Point3, Transform};
use evolute::surface::{Cylinder, Sphere, Surface};
use evolute::trace::Tracer;
use evolute::transfer::{Transfer, TransferSettings};

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
