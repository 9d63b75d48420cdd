//! Direct light: curved lamps and lamps partly hidden, against closed forms.

use std::f64::consts::PI;

use evolute::formula::Formula;
use evolute::geometry::{Point3, Transform, Vector3};
use evolute::scene::{Scene, Shape};
use evolute::surface::{Cylinder, Disk, Mesh, Parametric, Sphere, Surface};
use evolute::trace::Tracer;
use evolute::transfer::{Components, Receiver, Transfer};

use crate::common::{black, receiver, rectangle, scene, settings, shape};
use crate::polygon::{Polygon, irradiance};

const DIRECT: Components = Components { direct: true, specular: false };

/// Asserts the true error to be within the tolerance and the estimate at -a 1e-2 to 1e-4. `exact` is
/// good to `known` of itself.
fn check(name: &str, scene: &Scene, at: &Receiver, exact: f64, known: f64) {
    check_at(&[1e-2, 1e-3, 1e-4], name, scene, at, exact, known);
}

fn check_at(accuracies: &[f64], name: &str, scene: &Scene, at: &Receiver, exact: f64, known: f64) {
    let tracer = Tracer::new(scene);
    for &accuracy in accuracies {
        let light = Transfer::new(scene, &tracer, settings(accuracy)).light(at, DIRECT);
        let off = (light.direct[1] - exact).abs();
        println!(
            "{name} -a {accuracy}: {:.7}, exact {exact:.7}: off by {:.1e}, estimate {:.1e}, {} chains, met {}",
            light.direct[1],
            off / exact,
            light.error / exact,
            light.counts.chains,
            light.met
        );
        assert!(light.met, "{name}");
        assert!(off <= (accuracy + known) * exact, "{name}");
        assert!(off <= light.error + known.max(1e-12) * exact, "{name}: the estimate");
    }
}

fn ball(centre: [f64; 3], radius: f64) -> Surface {
    Surface::Sphere(
        Sphere::new(Point3::from(centre), radius, Transform::identity(), false).unwrap(),
    )
}

fn up() -> [f64; 3] {
    [0.0, 1.0, 0.0]
}

/// E = π L (R/d)² cos θ while the whole ball is above the horizon.
#[test]
fn sphere_lamp() {
    for (centre, r) in [([0.3, 2.0, -0.4], 0.7), ([1.0, 1.2, 0.5], 0.2), ([0.0, 1.001, 0.0], 1.0)] {
        let scene = scene(vec![shape("lamp", ball(centre, r), black(), 1.0)]);
        let d2: f64 = centre.iter().map(|c| c * c).sum();
        let exact = PI * r * r / d2 * centre[1] / d2.sqrt();
        check(&format!("sphere {r}"), &scene, &receiver([0.0; 3], up()), exact, 0.0);
    }
}

/// A parallel disk, off its axis: E = π L/2 (1 − (h² + e² − r²)/√((h² + e² + r²)² − 4 e² r²)).
#[test]
fn disk_lamp() {
    for (r, h, e) in [(0.5f64, 1.0f64, 0.0f64), (0.5, 1.0, 0.8), (2.0, 0.3, 1.9)] {
        // Facing down.
        let m = nalgebra::Matrix4::from_columns(&[
            Vector3::new(r, 0.0, 0.0).push(0.0),
            Vector3::new(0.0, 0.0, r).push(0.0),
            Vector3::new(0.0, -1.0, 0.0).push(0.0),
            Vector3::new(e, h, 0.0).push(1.0),
        ]);
        let disk = Disk::new(Transform::from_matrix(&m).unwrap(), false).unwrap();
        let scene = scene(vec![shape("lamp", Surface::Disk(disk), black(), 1.0)]);
        let s = h * h + e * e + r * r;
        let exact = 0.5 * PI * (1.0 - (s - 2.0 * r * r) / (s * s - 4.0 * e * e * r * r).sqrt());
        check(&format!("disk {r} {h} {e}"), &scene, &receiver([0.0; 3], up()), exact, 0.0);
    }
}

/// A tube lamp seen from a point below its axis. The cone of directions that meet an endless tube lies
/// between two planes through the receiver; its caps are open, so what is seen past the ends' rims is
/// the inside, which is dark. Quadrature over the azimuth of the near wall, in closed form along it.
#[test]
fn cylinder_lamp() {
    for (h, r, z0, z1) in [(1.0f64, 0.2f64, -0.5f64, 0.7f64), (1.0, 0.6, 0.1, 2.0)] {
        let tube = Cylinder::new(
            Point3::new(0.0, h, z0),
            Point3::new(0.0, h, z1),
            r,
            Transform::identity(),
            false,
        )
        .unwrap();
        let scene = scene(vec![shape("lamp", Surface::Cylinder(tube), black(), 1.0)]);
        // Points (r sin t, h − r cos t, z) with the outward normal (sin t, −cos t, 0), seen while
        // h cos t > r. With ρ² the squared distance from the axis' parallel through the receiver,
        // E = ∫ y (h cos t − r) r dt ∫ dz/(ρ² + z²)².
        let along = |rho2: f64, z: f64| {
            let rho = rho2.sqrt();
            0.5 * (z / (rho2 * (rho2 + z * z)) + (z / rho).atan() / (rho2 * rho))
        };
        let limit = (r / h).acos();
        let n = 20_000;
        let step = 2.0 * limit / f64::from(n);
        let exact: f64 = (0..n)
            .map(|k| {
                let t = -limit + (f64::from(k) + 0.5) * step;
                let (x, y) = (r * t.sin(), h - r * t.cos());
                let rho2 = x * x + y * y;
                y * (h * t.cos() - r) * r * (along(rho2, z1) - along(rho2, z0)) * step
            })
            .sum();
        check(&format!("cylinder {r}"), &scene, &receiver([0.0; 3], up()), exact, 1e-7);
    }
}

/// The faces of a cube that a receiver sees, each in Lambert's closed form.
#[test]
fn cube_lamp() {
    let m = Transform::from_matrix(&nalgebra::Matrix4::new(
        0.3, 0.0, 0.0, 0.4, 0.0, 0.2, 0.0, 1.5, 0.0, 0.0, 0.25, -0.2, 0.0, 0.0, 0.0, 1.0,
    ))
    .unwrap();
    let cube = Mesh::cube(m, false).unwrap();
    let at = receiver([0.0; 3], [0.2, 1.0, 0.1]);
    let exact: f64 = (0..12).map(|t| irradiance(&at, &cube.corners(t), None)).sum();
    let scene = scene(vec![shape("lamp", Surface::Mesh(cube), black(), 1.0)]);
    check("cube", &scene, &at, exact, 0.0);
}

/// A square lamp facing down, one metre a side, 2 m above.
fn lamp() -> (Shape, Polygon) {
    let surface = rectangle([0.0, 2.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.0, 0.5]);
    let corners = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
        .map(|(x, z)| Point3::new(x, 2.0, z))
        .to_vec();
    (shape("lamp", surface, black(), 1.0), corners)
}

/// The lamp less what is seen of it through the hiding rectangle.
#[test]
fn hidden_by_a_rectangle() {
    for (centre, p, q) in [
        ([0.2, 1.0, 0.1], [0.3, 0.0, 0.1], [0.0, 0.1, 0.2]),
        ([0.1, 1.5, -0.05], [0.02, 0.0, 0.0], [0.0, 0.01, 0.03]),
        ([0.13, 0.3, 0.0], [0.0, 0.2, 0.0], [0.01, 0.0, 0.4]),
    ] {
        let (lamp, corners) = lamp();
        let at = receiver([0.1, 0.0, 0.2], [0.1, 1.0, -0.2]);
        let (c, p3, q3) = (Point3::from(centre), Vector3::from(p), Vector3::from(q));
        let window = [c - p3 - q3, c + p3 - q3, c + p3 + q3, c - p3 + q3];
        let exact = irradiance(&at, &corners, None) - irradiance(&at, &corners, Some(&window));
        let scene = scene(vec![lamp, shape("screen", rectangle(centre, p, q), black(), 0.0)]);
        check(&format!("screen {centre:?}"), &scene, &at, exact, 0.0);
    }
}

/// Plane formulas across an axis: boxes of no thickness.
#[test]
fn hidden_by_a_flat_formula() {
    for (x, y, z, window) in [
        (
            "0.3*s - 0.1",
            "1",
            "0.4*t - 0.1",
            [[-0.1, 1.0, -0.1], [0.2, 1.0, -0.1], [0.2, 1.0, 0.3], [-0.1, 1.0, 0.3]],
        ),
        (
            "0.05",
            "0.2 + s",
            "0.4*t - 0.1",
            [[0.05, 0.2, -0.1], [0.05, 1.2, -0.1], [0.05, 1.2, 0.3], [0.05, 0.2, 0.3]],
        ),
        (
            "0.3*s - 0.1",
            "1 + 0.5*t",
            "0.1",
            [[-0.1, 1.0, 0.1], [0.2, 1.0, 0.1], [0.2, 1.5, 0.1], [-0.1, 1.5, 0.1]],
        ),
    ] {
        let (lamp, corners) = lamp();
        let at = receiver([0.1, 0.0, 0.2], [0.1, 1.0, -0.2]);
        let window = window.map(Point3::from);
        let exact = irradiance(&at, &corners, None) - irradiance(&at, &corners, Some(&window));
        assert!(exact < 0.99 * irradiance(&at, &corners, None), "it hides nothing");
        let [x3, y3, z3] = [x, y, z].map(|f| Formula::parse(f, &["s", "t"], &[]).unwrap());
        let screen = Parametric::new(x3, y3, z3, Transform::identity(), false).unwrap();
        let scene = scene(vec![lamp, shape("screen", Surface::Parametric(screen), black(), 0.0)]);
        check(&format!("formula {x}, {y}, {z}"), &scene, &at, exact, 0.0);
    }
}

/// A ball wholly in front of the lamp takes away its own sphere's worth, π (R/d)² cos θ; down to a
/// thirtieth of the lamp's size.
#[test]
fn hidden_by_a_ball() {
    for (centre, r) in [
        ([0.05, 1.0, 0.02], 0.1),
        ([0.1, 1.7, 0.05], 1.0 / 60.0),
        ([-0.1, 1.8, -0.21], 1.0 / 60.0),
        ([0.31, 1.9, 0.17], 1.0 / 60.0),
    ] {
        let (lamp, corners) = lamp();
        let at = receiver([0.0; 3], up());
        let d2: f64 = centre.iter().map(|c| c * c).sum();
        let hidden = PI * r * r / d2 * centre[1] / d2.sqrt();
        let exact = irradiance(&at, &corners, None) - hidden;
        let scene = scene(vec![lamp, shape("ball", ball(centre, r), black(), 0.0)]);
        println!("ball {r:.4} hides {:.1e}", hidden / exact);
        check(&format!("ball {centre:?}"), &scene, &at, exact, 0.0);
    }
}

/// Four rectangles, or eight triangles, leave a window that is smaller than a cell of the lamp's first grid.
#[test]
fn small_window_in_a_wall() {
    let lamp = [[-0.2, 2.0, 0.25], [-0.25, 2.0, -0.2], [0.2, 2.0, -0.25], [0.25, 2.0, 0.2]];
    let corners: Polygon = lamp.map(Point3::from).to_vec();
    let (edge, diagonal) = (corners[1] - corners[0], corners[3] - corners[0]);
    let middle = Point3::from((corners[0].coords + corners[2].coords) * 0.5);
    let plate = |x: [f64; 2], z: [f64; 2]| {
        let centre = [0.5 * (x[0] + x[1]), 0.5, 0.5 * (z[0] + z[1])];
        rectangle(centre, [0.5 * (x[1] - x[0]), 0.0, 0.0], [0.0, 0.0, 0.5 * (z[1] - z[0])])
    };
    let half = 0.006;
    let walls = [
        plate([-1.0, -half], [-1.0, 1.0]),
        plate([half, 1.0], [-1.0, 1.0]),
        plate([-half, half], [-1.0, -half]),
        plate([-half, half], [half, 1.0]),
    ];
    let square =
        |h: f64| [[-h, 0.5, -h], [h, 0.5, -h], [h, 0.5, h], [-h, 0.5, h]].map(Point3::from);
    let frame = |k: u32| [[k, (k + 1) % 4, (k + 1) % 4 + 4], [k, (k + 1) % 4 + 4, k + 4]];
    let wall = Mesh::new(
        square(half).into_iter().chain(square(1.0)).collect(),
        (0..4).flat_map(frame).collect(),
        None,
        None,
    );
    let mesh = vec![Surface::Mesh(wall.unwrap())];
    let half_edges = |v: Vector3| [0.5 * v.x, 0.5 * v.y, 0.5 * v.z];
    let shining = || {
        let middle = [middle.x, middle.y, middle.z];
        shape("lamp", rectangle(middle, half_edges(edge), half_edges(diagonal)), black(), 300.0)
    };
    for (name, bodies) in [("plates", walls.to_vec()), ("mesh", mesh)] {
        let bodies = bodies.into_iter().map(|wall| shape("wall", wall, black(), 0.0));
        let scene = scene(bodies.chain([shining()]).collect());
        for (x, z) in [(-0.02, 0.02), (0.013, 0.021), (-0.037, -0.008), (0.001, -0.003)] {
            let at = receiver([x, 0.1, z], up());
            let exact = 300.0 * irradiance(&at, &corners, Some(&square(half)));
            assert!(exact > 0.01, "{exact}");
            // What a corner of the window shows of a cell whose samples a mesh hides all is not looked for for ever.
            let accuracies: &[f64] = if name == "mesh" { &[1e-2] } else { &[1e-2, 1e-3, 1e-4] };
            check_at(accuracies, &format!("{name} {x}, {z}"), &scene, &at, exact, 0.0);
        }
    }
}
