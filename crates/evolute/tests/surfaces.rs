//! One suite over all surfaces, and their conventions against Mitsuba 3.
#![allow(clippy::unwrap_used)]

use evolute::geometry::{Matrix4, Point3, Transform, Vector3};
use evolute::surface::{Cylinder, Disk, Mesh, Rectangle, Sphere, Surface, SurfacePoint};

/// The shapes of `data/mitsuba_shapes.csv`.
fn mitsuba_shape(kind: &str, transform: Transform, flip: bool) -> Surface {
    match kind {
        "rectangle" => Surface::Rectangle(Rectangle::new(transform, flip).unwrap()),
        "disk" => Surface::Disk(Disk::new(transform, flip).unwrap()),
        "sphere" => {
            Surface::Sphere(Sphere::new(Point3::new(0.5, 0.0, 0.25), 1.5, transform, flip).unwrap())
        }
        "cylinder" => {
            let (p0, p1) = (Point3::new(0.1, 0.2, -0.5), Point3::new(0.3, 0.4, 1.2));
            Surface::Cylinder(Cylinder::new(p0, p1, 0.5, transform, flip).unwrap())
        }
        "cube" => Surface::Mesh(Mesh::cube(transform, flip).unwrap()),
        _ => panic!("{kind}"),
    }
}

/// The point of a surface next to `x`, which is single precision off.
fn near(surface: &Surface, x: &Point3, u: f64, v: f64) -> SurfacePoint {
    match surface {
        Surface::Mesh(m) => (0..m.triangles().len() as u32)
            .map(|t| m.nearest_on(t, x))
            .min_by(|a, b| (a.x - x).norm().total_cmp(&(b.x - x).norm()))
            .unwrap(),
        _ => surface.point(u, v).unwrap(),
    }
}

/// Texture coordinates, sides and tangents are Mitsuba's, under mirrored transforms and with flipped
/// normals too. Mitsuba computes in single precision.
#[test]
fn conventions_are_mitsubas() {
    let mut count = 0;
    for line in include_str!("data/mitsuba_shapes.csv").lines().filter(|l| !l.starts_with('#')) {
        let fields: Vec<&str> = line.split(',').collect();
        let n: Vec<f64> = fields[3..].iter().map(|f| f.parse().unwrap()).collect();
        let rows = [&n[0..12], &[0.0, 0.0, 0.0, 1.0]].concat();
        let transform = Transform::from_matrix(&Matrix4::from_row_slice(&rows)).unwrap();
        let vector = |i: usize| Vector3::new(n[i], n[i + 1], n[i + 2]);
        let (x, normal, u, v) = (Point3::from(vector(12)), vector(15), n[18], n[19]);
        let surface = mitsuba_shape(fields[0], transform, fields[2] == "1");
        let point = near(&surface, &x, u, v);
        assert!((point.x - x).norm() < 2e-5, "position: {line}: {}", point.x);
        let [pu, pv] = surface.uv(&point);
        assert!((pu - u).abs() < 1e-5 && (pv - v).abs() < 1e-5, "uv: {line}: {pu} {pv}");
        let local = surface.local(&point).unwrap();
        assert!(
            (local.n.into_inner() - normal).norm() < 1e-5,
            "normal: {line}: {}",
            local.n.into_inner()
        );
        let jet = match &surface {
            Surface::Mesh(m) => m.jet_at(&point).unwrap(),
            _ => surface.jet(u, v).unwrap(),
        };
        for (ours, theirs) in [(jet.xu, vector(20)), (jet.xv, vector(23))] {
            assert!((ours - theirs).norm() < 2e-4 * (1.0 + ours.norm()), "{line}: {ours} {theirs}");
        }
        count += 1;
    }
    assert_eq!(count, 288);
}
