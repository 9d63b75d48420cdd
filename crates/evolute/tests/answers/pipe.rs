//! Plane mirrors by the hundred orders: a light pipe shows a lattice of virtual images, all of them whole.

use evolute::geometry::{Point3, Vector3};
use evolute::trace::Tracer;
use evolute::transfer::Transfer;

use crate::cases;
use crate::common::{BOTH, receiver};
use crate::polygon::{Polygon, irradiance};

/// Widths of the pipe [m].
const WIDTHS: [f64; 2] = [1.0, 0.8];
/// Images are added up to this many reflections a direction: what is left is below 1e-7.
const ORDERS: i32 = 60;

/// Irradiance from the lamp and all its images in walls of reflectance `r`.
fn by_images(p: [f64; 3], n: [f64; 3], r: f64) -> f64 {
    let at = receiver(p, n);
    let lamp = [[0.0, 0.1], [0.2, 0.1], [0.2, -0.2], [0.0, -0.2]];
    // Across a wall the coordinate changes its sign about the middle of the pipe.
    let moved = |x: f64, order: i32, width: f64| {
        f64::from(order) * width + if order % 2 == 0 { x } else { -x }
    };
    let mut sum = 0.0;
    for (i, j) in (-ORDERS..=ORDERS).flat_map(|i| (-ORDERS..=ORDERS).map(move |j| (i, j))) {
        let corner =
            |[x, y]: [f64; 2]| Point3::new(moved(x, i, WIDTHS[0]), moved(y, j, WIDTHS[1]), 1.0);
        let mut image: Polygon = lamp.into_iter().map(corner).collect();
        let area: Vector3 = (image[1] - image[0]).cross(&(image[2] - image[0]));
        if area.z > 0.0 {
            image.reverse();
        }
        sum += r.powi(i.abs() + j.abs()) * 10.0 * irradiance(&at, &image, None);
    }
    sum
}

#[test]
fn light_pipe() {
    let places = [
        ([0.1, 0.05, 0.0], [0.0, 0.0, 1.0]),
        ([-0.4, 0.3, 0.0], [0.0, 0.0, 1.0]),
        ([0.45, -0.35, 0.5], [1.0, 0.3, 0.2]),
        ([-0.2, -0.1, 0.8], [-0.3, 1.0, 0.5]),
    ];
    let mut held = true;
    for (reflectance, accuracy) in [("0.5", 1e-2), ("0.9", 1e-2)] {
        let scene = cases::load("light_pipe", &[("r", reflectance)]);
        let tracer = Tracer::new(&scene);
        let transfer = Transfer::new(&scene, &tracer, cases::settings(&scene, accuracy));
        for (p, n) in places {
            let exact = by_images(p, n, reflectance.parse().unwrap());
            let light = transfer.light(&receiver(p, n), BOTH);
            let off = light.direct[1] + light.specular[1] - exact;
            println!(
                "reflectance {reflectance}, -a {accuracy}, {p:?}: images {exact:.6}, off by {:+.1e}, estimate {:.1e}, met {}, {} chains",
                off / exact,
                light.error / exact,
                light.met,
                light.counts.chains
            );
            held &= off.abs() <= light.error.min(accuracy * exact);
        }
    }
    assert!(held);
}
