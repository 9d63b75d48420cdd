//! Scenes of one kind of surface each.

use super::{Random, SURFACES, WAVE, bumpy_ball, motion, smooth_ball, surface};
use evolute::geometry::{Point3, Rgb, Transform, Vector3};
use evolute::scene::{Material, Scene, Shape, SideMaterial};
use evolute::surface::{Cylinder, Disk, Mesh, Rectangle, Sphere, Surface};

/// A scene of surfaces only.
pub fn scene_of(surfaces: Vec<Surface>) -> Scene {
    let side = SideMaterial::default();
    let shapes = surfaces
        .into_iter()
        .enumerate()
        .map(|(i, surface)| Shape {
            id: format!("shape {i}"),
            surface,
            material: Material { front: side, back: side, dielectric: None },
            radiance: Rgb::BLACK,
        })
        .collect();
    Scene { name: String::new(), shapes, sensors: vec![], max_depth: None }
}

/// Scenes of one kind of surface each, under motions with the given scale and shift of the whole.
pub fn scenes(seed: u64, scale: f64, shift: Vector3) -> Vec<(&'static str, Scene)> {
    let mut r = Random(seed);
    let whole =
        Transform::translation(shift).after(&Transform::scaling(Vector3::repeat(scale)).unwrap());
    let mut many = |make: &mut dyn FnMut(&mut Random, &Transform) -> Surface, stretch: bool| {
        let surfaces = (0..6)
            .map(|_| {
                let s = if stretch {
                    Vector3::from_fn(|_, _| r.between(0.2, 2.0))
                } else {
                    Vector3::repeat(r.between(0.5, 1.5))
                };
                let m = motion(&mut r, 3.0, s);
                make(&mut r, &whole.after(&m))
            })
            .collect();
        scene_of(surfaces)
    };
    let up = Vector3::z();
    let mut scenes = vec![
        (
            "rectangle",
            many(&mut |_, m| Surface::Rectangle(Rectangle::new(*m, false).unwrap()), true),
        ),
        ("disk", many(&mut |_, m| Surface::Disk(Disk::new(*m, false).unwrap()), true)),
        (
            "sphere",
            many(
                &mut |_, m| Surface::Sphere(Sphere::new(Point3::origin(), 1.0, *m, false).unwrap()),
                false,
            ),
        ),
        (
            "cylinder",
            many(
                &mut |r, m| {
                    let top = Point3::from(up * r.between(0.2, 3.0));
                    Surface::Cylinder(
                        Cylinder::new(Point3::origin(), top, r.between(0.1, 1.0), *m, false)
                            .unwrap(),
                    )
                },
                false,
            ),
        ),
        ("mesh", many(&mut |r, m| Surface::Mesh(bumpy_ball(r, 8, m)), true)),
        (
            "smooth mesh",
            // Gently uneven: no edge turns by the 60° of a crease, which the slow search knows not.
            many(
                &mut |_, m| {
                    let uneven = Transform::scaling(Vector3::new(1.0, 0.8, 0.6)).unwrap();
                    Surface::Mesh(smooth_ball(12, &m.after(&uneven)))
                },
                false,
            ),
        ),
        ("cube", many(&mut |_, m| Surface::Mesh(Mesh::cube(*m, false).unwrap()), true)),
    ];
    let formulas = SURFACES.iter().map(|(_, f)| {
        // The wave is a hundred metres wide, the others two or more.
        let size = if *f == WAVE { 0.02 } else { 1.0 };
        let stretch = Vector3::from_fn(|_, _| size * r.between(0.5, 1.5));
        let m = motion(&mut r, 3.0, stretch);
        Surface::Parametric(surface(*f, whole.after(&m)))
    });
    scenes.push(("parametric", scene_of(formulas.collect())));
    scenes
}
