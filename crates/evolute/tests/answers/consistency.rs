//! The ball of glass and the mirror ring again: with the lamp moved, with n = 1.3, against a quadrature
//! of the tests' own; and scaled, shifted and turned, against themselves.

use rayon::prelude::*;

use evolute::geometry::{Point3, Transform, UnitVector3, Vector3};
use evolute::scene::{Scene, Shape};
use evolute::surface::{Cylinder, Rectangle, Sphere, Surface};
use evolute::trace::Tracer;
use evolute::transfer::{Receiver, ReceiverLight, Transfer};

use crate::cases;
use crate::common::{SPECULAR, receiver};
use crate::reference::{BALL_WORDS, Ball, Fineness, Lamp, Ring, by_ring, through_ball};

/// Accuracies asked for.
const ACCURACIES: [f64; 2] = [1e-2, 1e-3];
/// Lamps in a second place [m].
const BALL_LAMP: [&str; 3] = ["1.2", "1.9", "-0.8"];
const RING_LAMP: [&str; 3] = ["-4", "9", "5"];

fn with_lamp<'a>(lamp: [&'a str; 3], others: &[(&'a str, &'a str)]) -> Vec<(&'a str, &'a str)> {
    let names = ["lamp_x", "lamp_y", "lamp_z"];
    names.into_iter().zip(lamp).chain(others.iter().copied()).collect()
}

fn surface<'s>(scene: &'s Scene, id: &str) -> &'s Surface {
    &scene.shapes.iter().find(|s| s.id == id).unwrap().surface
}

/// The lamp's geometry, and its radiance.
pub fn lamp(scene: &Scene) -> (Lamp, f64) {
    let shape = scene.shapes.iter().find(|s| s.id == "lamp").unwrap();
    let Surface::Rectangle(r) = &shape.surface else { panic!("the lamp is a rectangle") };
    let mut corners = r.corners();
    let [p, q] = r.half_edges();
    if p.cross(&q).dot(&r.normal()) < 0.0 {
        corners.reverse();
    }
    (Lamp { corners }, shape.radiance[1])
}

/// Points of a square of half side `half` about the origin of the plane y = 0, and of two lines that
/// cross at `core`, closer near it, out to `reach`.
fn floor_points(half: f64, core: [f64; 2], reach: f64) -> Vec<[f64; 3]> {
    let n = 8;
    // Not the middles of the squares: the scenes have symmetries.
    let at = |k: u32, shift: f64| half * (2.0 * (f64::from(k) + shift) / f64::from(n) - 1.0);
    let mut points: Vec<[f64; 3]> =
        (0..n * n).map(|k| [at(k % n, 0.43), 0.0, at(k / n, 0.61)]).collect();
    for step in [0.0, 0.01, 0.03, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0] {
        for (x, z) in [(1.0, 0.2), (-1.0, -0.2), (-0.3, 1.0), (0.3, -1.0)] {
            let [x, z] = [core[0] + reach * step * x, core[1] + reach * step * z];
            points.push([x, 0.0, z]);
        }
    }
    // The crossing itself once.
    points.drain(64..67);
    points
}

/// Where the line from the lamp's middle through the ball's meets the floor.
fn ball_core(scene: &Scene) -> [f64; 2] {
    let Surface::Sphere(ball) = surface(scene, "ball") else { panic!("the ball is a sphere") };
    let (lamp, _) = lamp(scene);
    let middle = nalgebra::center(&lamp.corners[0], &lamp.corners[2]);
    let along = ball.centre() - middle;
    let core = ball.centre() - along * (ball.centre().y / along.y);
    [core.x, core.z]
}

fn ball_points(scene: &Scene) -> Vec<[f64; 3]> {
    floor_points(2.0, ball_core(scene), 0.5)
}

pub fn ring_of(scene: &Scene) -> Ring {
    let Surface::Cylinder(c) = surface(scene, "ring") else { panic!("the ring is a cylinder") };
    Ring { radius: c.radius(), height: c.length() }
}

/// The brightest place of a grid of 0.39 m, no point of which is on the ring.
fn ring_core(scene: &Scene) -> [f64; 2] {
    let (ring, (lamp, _)) = (ring_of(scene), lamp(scene));
    let look = Fineness { looks: 128, change: 1e-2 };
    let all: Vec<([f64; 2], f64)> = (0..41 * 41)
        .into_par_iter()
        .map(|k| [k % 41, k / 41].map(|k| 0.39 * f64::from(k - 20)))
        .map(|[x, z]| ([x, z], by_ring(&ring, &lamp, x, z, look)))
        .collect();
    all.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0
}

fn ring_points(scene: &Scene) -> Vec<[f64; 3]> {
    floor_points(13.0, ring_core(scene), 3.0)
}

fn lights(scene: &Scene, at: &[Receiver], accuracy: f64) -> Vec<ReceiverLight> {
    let tracer = Tracer::new(scene);
    let transfer = Transfer::new(scene, &tracer, cases::settings(scene, accuracy));
    at.par_iter().map(|r| transfer.light(r, SPECULAR)).collect()
}

/// Irradiance by length of the words, from one interaction on.
fn by_length<const W: usize>(scene: &Scene, at: &Receiver, accuracy: f64) -> [f64; W] {
    let tracer = Tracer::new(scene);
    let transfer = Transfer::new(scene, &tracer, cases::settings(scene, accuracy));
    let mut sums = [0.0; W];
    for word in transfer.light_by_word(at, SPECULAR).1 {
        sums[word.letters.len() - 1] += word.irradiance[1];
    }
    sums
}

fn mean_chains(lights: &[ReceiverLight]) -> f64 {
    lights.iter().map(|l| l.counts.chains as f64).sum::<f64>() / lights.len() as f64
}

/// Holds a scene's light at points of the floor against `reference`, which is asked twice, the second
/// time twice as finely, and answers by word. How often more than 5 % of the receivers are off by more than
/// the estimate, or one by more than three times the tolerance.
fn compare<const W: usize>(
    name: &str,
    scene: &Scene,
    points: &[[f64; 3]],
    fineness: Fineness,
    reference: impl Fn(&[f64; 3], Fineness) -> [f64; W] + Sync,
) -> usize {
    let finer = Fineness { looks: 2 * fineness.looks, change: 0.25 * fineness.change };
    let known: Vec<([f64; W], f64, f64)> = points
        .par_iter()
        .map(|p| {
            let (coarse, fine) = (reference(p, fineness), reference(p, finer));
            let off = (0..W).map(|k| (fine[k] - coarse[k]).abs()).sum();
            (fine, fine.iter().sum(), off)
        })
        .collect();
    let lit = known.iter().filter(|k| k.1 > 0.0).count();
    let own = known.iter().filter(|k| k.1 > 0.0).fold(0f64, |m, k| m.max(k.2 / k.1));
    let brightest = known.iter().fold(0f64, |m, k| m.max(k.1));
    println!(
        "{name}: {} receivers, {lit} with light, up to {brightest:.4}; the quadrature changes by at most {own:.0e} when twice as fine",
        points.len()
    );
    assert!(own < 1e-4);
    let at: Vec<Receiver> = points.iter().map(|p| receiver(*p, [0.0, 1.0, 0.0])).collect();
    let mut failures = 0;
    for accuracy in ACCURACIES {
        let lights = lights(scene, &at, accuracy);
        let absolute = cases::settings(scene, accuracy).absolute;
        let (mut held, mut relative, mut against_estimate, mut against_tolerance) =
            (0, 0f64, 0f64, 0f64);
        for ((r, light), (words, exact, own)) in at.iter().zip(&lights).zip(&known) {
            // Sums of the two programs differ by roundings, too.
            let own = own + 1e-12 * exact;
            let off = ((light.specular[1] - exact).abs() - own).max(0.0);
            let tolerance = (accuracy * exact).max(absolute);
            if *exact > 0.0 && tolerance > absolute {
                relative = relative.max(off / exact);
            }
            against_tolerance = against_tolerance.max(off / tolerance);
            if off > 0.0 {
                against_estimate = against_estimate.max(off / light.error);
            }
            held += usize::from(off <= light.error);
            if off > light.error || off > tolerance || !light.met {
                let got = by_length::<W>(scene, r, accuracy);
                let lacks: [String; W] = std::array::from_fn(|k| {
                    format!("{:+.1e} of {:.1e}", got[k] - words[k], words[k])
                });
                println!(
                    "  -a {accuracy} ({:.5}, {:.5}): {:.6e}, exact {exact:.6e}: off by {off:.1e}, {:.2} of the estimate, {:.2} of the tolerance, met {}, {} chains; by length {lacks:?}",
                    r.position.x,
                    r.position.z,
                    light.specular[1],
                    off / light.error,
                    off / tolerance,
                    light.met,
                    light.counts.chains
                );
            }
        }
        println!(
            "  -a {accuracy}: within the estimate {held} of {}; worst {:.1e} of the light, {against_estimate:.2} of the estimate, {against_tolerance:.2} of the tolerance; {:.0} chains",
            points.len(),
            relative,
            mean_chains(&lights)
        );
        failures += usize::from(held * 100 < points.len() * 95 || against_tolerance > 3.0);
    }
    failures
}

fn compare_ball(name: &str, parameters: &[(&str, &str)]) -> usize {
    let scene = cases::load("glass_ball", parameters);
    let shape = scene.shapes.iter().find(|s| s.id == "ball").unwrap();
    let Surface::Sphere(s) = &shape.surface else { panic!("the ball is a sphere") };
    let n = shape.material.dielectric.unwrap().interior_ior;
    let ball = Ball { centre: s.centre(), radius: s.radius(), n };
    let (lamp, radiance) = lamp(&scene);
    // As many interactions as the scene's max_depth allows.
    assert_eq!(scene.max_depth, Some(BALL_WORDS as u32 + 1));
    let fineness = Fineness { looks: 256, change: 1e-6 };
    compare(name, &scene, &ball_points(&scene), fineness, |p, fineness| {
        through_ball(&ball, &lamp, &Point3::from(*p), &Vector3::y(), fineness)
            .map(|word| word * radiance)
    })
}

#[test]
fn ball_against_quadrature() {
    let failures: usize = [
        ("ball", Vec::new()),
        ("ball, n = 1.3", vec![("n", "1.3")]),
        ("ball, lamp moved", with_lamp(BALL_LAMP, &[])),
        ("ball, lamp moved, n = 1.3", with_lamp(BALL_LAMP, &[("n", "1.3")])),
    ]
    .iter()
    .map(|(name, parameters)| compare_ball(name, parameters))
    .sum();
    assert_eq!(failures, 0);
}

#[test]
fn ring_against_quadrature() {
    let mut failures = 0;
    for (name, parameters) in
        [("ring", Vec::new()), ("ring, lamp moved", with_lamp(RING_LAMP, &[]))]
    {
        let scene = cases::load("mirror_ring", &parameters);
        let (ring, (lamp, radiance)) = (ring_of(&scene), lamp(&scene));
        let fineness = Fineness { looks: 2048, change: 1e-7 };
        failures += compare(name, &scene, &ring_points(&scene), fineness, |p, fineness| {
            [radiance * by_ring(&ring, &lamp, p[0], p[2], fineness)]
        });
    }
    assert_eq!(failures, 0);
}

/// The quadrature itself against the six figures of `cases/mirror_ring`.
#[test]
fn quadrature_of_the_ring() {
    let scene = cases::load("mirror_ring", &[]);
    let (ring, (lamp, radiance)) = (ring_of(&scene), lamp(&scene));
    for row in cases::table("mirror_ring", "points.csv") {
        let fineness = Fineness { looks: 2048, change: 1e-7 };
        let e = radiance * by_ring(&ring, &lamp, row[0], row[2], fineness);
        println!("({}, {}): {e:.7}, expected {:.6}", row[0], row[2], row[6]);
        assert!((e - row[6]).abs() < 1e-6 * row[6] + 5e-7);
    }
}

/// A surface under a similarity that does not mirror.
fn moved(surface: &Surface, by: &Transform) -> Surface {
    match surface {
        Surface::Rectangle(r) => {
            let world = by.after(r.world_from_object());
            Surface::Rectangle(Rectangle::new(world, false).unwrap())
        }
        Surface::Sphere(s) => {
            Surface::Sphere(Sphere::new(s.centre(), s.radius(), *by, false).unwrap())
        }
        Surface::Cylinder(c) => {
            let [p0, p1] = c.ends();
            Surface::Cylinder(Cylinder::new(p0, p1, c.radius(), *by, false).unwrap())
        }
        _ => panic!("no such surface in these scenes"),
    }
}

/// Holds a scene that is scaled, shifted and turned against itself.
fn compare_moved(name: &str, scene: &Scene, points: &[[f64; 3]]) {
    let scaled = |by: f64| Transform::scaling(Vector3::from_element(by)).unwrap();
    let turned = Transform::rotation(Vector3::new(0.3, -0.8, 0.5), 1.0).unwrap();
    let motions = [
        ("x 100", scaled(100.0)),
        ("x 1/100", scaled(0.01)),
        ("shifted by (1000, -1000, 1000) m", {
            Transform::translation(Vector3::new(1000.0, -1000.0, 1000.0))
        }),
        ("turned", turned),
    ];
    let at: Vec<Receiver> = points.iter().map(|p| receiver(*p, [0.0, 1.0, 0.0])).collect();
    let mut failures = 0;
    for accuracy in ACCURACIES {
        let home = lights(scene, &at, accuracy);
        println!(
            "{name} -a {accuracy}: {} receivers, {:.0} chains",
            points.len(),
            mean_chains(&home)
        );
        for (how, by) in &motions {
            let shapes = scene
                .shapes
                .iter()
                .map(|s| Shape { surface: moved(&s.surface, by), ..s.clone() })
                .collect();
            let there = Scene { shapes, ..scene.clone() };
            let at: Vec<Receiver> = at
                .iter()
                .map(|r| Receiver {
                    position: by.point(&r.position),
                    normal: UnitVector3::new_normalize(by.normal(&r.normal)),
                })
                .collect();
            let away = lights(&there, &at, accuracy);
            let (mut relative, mut against_estimates, mut work) = (0f64, 0f64, 0);
            for ((a, b), p) in home.iter().zip(&away).zip(points) {
                let [one, two] = [a.specular[1], b.specular[1]];
                let off = (one - two).abs();
                if off > 0.0 {
                    relative = relative.max(off / one.max(two));
                    against_estimates = against_estimates.max(off / (a.error + b.error));
                }
                work += usize::from(a.counts.chains != b.counts.chains);
                if off > a.error + b.error {
                    failures += 1;
                    println!(
                        "  {how} ({:.5}, {:.5}): {one:.6e} and {two:.6e}, estimates {:.1e} and {:.1e}, {} and {} chains",
                        p[0], p[2], a.error, b.error, a.counts.chains, b.counts.chains
                    );
                }
            }
            println!(
                "  {how}: differs by at most {relative:.1e} of the light, {against_estimates:.1e} of the estimates; {:.0} chains, other than at home for {work}",
                mean_chains(&away)
            );
        }
    }
    assert_eq!(failures, 0, "{name}");
}

#[test]
fn ball_moved() {
    let scene = cases::load("glass_ball", &[]);
    compare_moved("ball", &scene, &ball_points(&scene));
}

#[test]
fn ring_moved() {
    let scene = cases::load("mirror_ring", &[]);
    compare_moved("ring", &scene, &ring_points(&scene));
}
