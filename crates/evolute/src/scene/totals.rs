//! Sums over a scene.

use std::f64::consts::PI;

use super::{Scene, Shape};
use crate::geometry::Rgb;

impl Shape {
    /// The flux it emits [W]: π L A, as it shines evenly in all directions of its front.
    pub fn emitted_flux(&self) -> Rgb {
        self.radiance * (PI * self.surface.area())
    }
}

impl Scene {
    /// The flux that all lamps emit [W].
    pub fn emitted_flux(&self) -> Rgb {
        self.shapes.iter().fold(Rgb::BLACK, |sum, shape| sum + shape.emitted_flux())
    }

    /// The area of all surfaces, both sides counted [m²].
    pub fn surface_area(&self) -> f64 {
        self.shapes.iter().fold(0.0, |sum, shape| sum + 2.0 * shape.surface.area())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::Transform;
    use crate::scene::{Material, SideMaterial};
    use crate::surface::{Rectangle, Surface};

    #[test]
    fn flux_and_area_of_two_squares() {
        let square = |radiance| Shape {
            id: "square".into(),
            surface: Surface::Rectangle(Rectangle::new(Transform::identity(), false).unwrap()),
            material: Material {
                front: SideMaterial::default(),
                back: SideMaterial::default(),
                dielectric: None,
            },
            radiance,
        };
        let scene = Scene {
            name: "two".into(),
            shapes: vec![square(Rgb::BLACK), square(Rgb([1.0, 0.5, 0.0]))],
            sensors: Vec::new(),
            max_depth: None,
        };
        // [−1, 1]² has 4 m² on each of its two sides, and emits on one.
        assert_eq!(scene.surface_area(), 16.0);
        assert_eq!(scene.emitted_flux(), Rgb([4.0 * PI, 2.0 * PI, 0.0]));
    }
}
