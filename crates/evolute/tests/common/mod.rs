//! Scenes made by hand, for tests.
#![allow(dead_code, clippy::unwrap_used, missing_docs)]

use evolute::geometry::{Point3, Rgb, Transform, UnitVector3, Vector3};
use evolute::scene::{Dielectric, Material, Mirror, Scene, Shape, SideMaterial};
use evolute::surface::{Rectangle, Surface};
use evolute::transfer::{Components, Receiver, TransferSettings};

pub const BOTH: Components = Components { direct: true, specular: true };
pub const SPECULAR: Components = Components { direct: false, specular: true };

pub fn black() -> Material {
    Material { front: SideMaterial::default(), back: SideMaterial::default(), dielectric: None }
}

pub fn mirror() -> Material {
    let side = SideMaterial {
        diffuse: Rgb::BLACK,
        mirror: Some(Mirror { weight: Rgb::WHITE, conductor: None }),
    };
    Material { front: side, back: side, dielectric: None }
}

pub fn glass(n: f64) -> Material {
    Material {
        dielectric: Some(Dielectric {
            interior_ior: n,
            exterior_ior: 1.0,
            reflectance: Rgb::WHITE,
            transmittance: Rgb::WHITE,
        }),
        ..black()
    }
}

pub fn shape(id: &str, surface: Surface, material: Material, radiance: f64) -> Shape {
    Shape { id: id.into(), surface, material, radiance: Rgb::grey(radiance) }
}

/// A rectangle with this centre and half edges, facing p × q.
pub fn rectangle(centre: [f64; 3], p: [f64; 3], q: [f64; 3]) -> Surface {
    let (c, p, q) = (Vector3::from(centre), Vector3::from(p), Vector3::from(q));
    let n = p.cross(&q).normalize();
    let m = nalgebra::Matrix4::from_columns(&[p.push(0.0), q.push(0.0), n.push(0.0), c.push(1.0)]);
    Surface::Rectangle(Rectangle::new(Transform::from_matrix(&m).unwrap(), false).unwrap())
}

pub fn scene(shapes: Vec<Shape>) -> Scene {
    Scene { name: "test".into(), shapes, sensors: Vec::new(), max_depth: None }
}

pub fn receiver(p: [f64; 3], n: [f64; 3]) -> Receiver {
    Receiver { position: Point3::from(p), normal: UnitVector3::new_normalize(Vector3::from(n)) }
}

pub fn settings(relative: f64) -> TransferSettings {
    TransferSettings { relative, ..TransferSettings::default() }
}
