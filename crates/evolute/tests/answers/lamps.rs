//! Curved lamps in a mirror: the same light as that of their images, seen directly.

use evolute::formula::Formula;
use evolute::geometry::{Point3, Transform};
use evolute::scene::Scene;
use evolute::surface::{Cylinder, Parametric, Surface};
use evolute::trace::Tracer;
use evolute::transfer::{Components, Transfer};

use crate::common::{SPECULAR, black, mirror, receiver, rectangle, scene, settings, shape};

const DIRECT: Components = Components { direct: true, specular: false };

/// Light by a large mirror in the plane y = 0 at a receiver that faces it, at the tolerance that is asked for.
fn check(name: &str, lamp: Surface, image: Surface, dark: bool) {
    let floor = rectangle([0.0; 3], [4.0, 0.0, 0.0], [0.0, 0.0, -4.0]);
    let mirrored: Scene =
        scene(vec![shape("mirror", floor, mirror(), 0.0), shape("lamp", lamp, black(), 100.0)]);
    let alone = scene(vec![shape("image", image, black(), 100.0)]);
    let (tracer, image_tracer) = (Tracer::new(&mirrored), Tracer::new(&alone));
    for x in [0.5, 0.8] {
        let at = receiver([x, 0.5, 0.1], [0.1, -1.0, 0.0]);
        let truth = Transfer::new(&alone, &image_tracer, settings(1e-4)).light(&at, DIRECT);
        assert!(truth.met && (truth.direct[1] == 0.0) == dark, "{name}: {:?}", truth.direct);
        for accuracy in [1e-2, 1e-3] {
            let light = Transfer::new(&mirrored, &tracer, settings(accuracy)).light(&at, SPECULAR);
            let off = (light.specular[1] - truth.direct[1]).abs();
            println!(
                "{name}, x = {x}, -a {accuracy}: {:.5} ± {:.1e}, its image {:.5} ± {:.1e}, {} chains, met {}",
                light.specular[1],
                light.error,
                truth.direct[1],
                truth.error,
                light.counts.chains,
                light.met
            );
            // The finest cells are half a millimetre wide on a mirror of eight metres.
            assert!(light.met || accuracy < 1e-2, "{name}");
            assert!(off <= light.error + truth.error, "{name}: off by {off}");
        }
    }
}

fn tube(ends: [[f64; 3]; 2], radius: f64, inwards: bool) -> Surface {
    let [p, q] = ends.map(Point3::from);
    Surface::Cylinder(Cylinder::new(p, q, radius, Transform::identity(), inwards).unwrap())
}

/// Half a pipe along z, open to below or, mirrored, to above.
fn half_pipe(sign: f64, front_inside: bool) -> Surface {
    let formula = |text: &str| Formula::parse(text, &["s", "t"], &[]).unwrap();
    let height = format!("{sign}*(0.6 + 0.1*sin(pi*s))");
    let pipe = Parametric::new(
        formula("0.1*cos(pi*s)"),
        formula(&height),
        formula("0.4*(t - 0.5)"),
        Transform::identity(),
        front_inside,
    );
    Surface::Parametric(pipe.unwrap())
}

#[test]
fn tubes_in_a_mirror() {
    let low = |ends: [[f64; 3]; 2]| ends.map(|[x, y, z]| [x, -y, z]);
    let upright = [[0.0, 0.3, 0.0], [0.0, 0.6, 0.0]];
    let ring = [[0.0, 0.3, 0.0], [0.0, 0.36, 0.0]];
    let lying = [[0.0, 0.6, -0.2], [0.0, 0.6, 0.2]];
    for (name, ends, radius, inwards, dark) in [
        ("upright", upright, 0.1, false, false),
        ("ring", ring, 0.12, false, false),
        ("lying", lying, 0.1, false, false),
        ("lying, lit inside", lying, 0.1, true, true),
        ("ring, lit inside", ring, 0.12, true, false),
    ] {
        check(name, tube(ends, radius, inwards), tube(low(ends), radius, inwards), dark);
    }
}

#[test]
fn half_pipes_in_a_mirror() {
    // A reflection turns the parameters' sense, and so the normal, round.
    for (name, inside) in [("half pipe", false), ("half pipe, lit inside", true)] {
        check(name, half_pipe(1.0, inside), half_pipe(-1.0, !inside), false);
    }
}
