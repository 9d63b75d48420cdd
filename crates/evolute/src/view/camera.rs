//! The pinhole camera, in Mitsuba 3's conventions.

use crate::geometry::{Point3, Ray, UnitVector3, Vector3, math};
use crate::scene::Sensor;

/// Rays through points of a film.
#[derive(Clone, Debug)]
pub(super) struct Camera {
    sensor: Sensor,
    /// Tangent of half the field of view across the width.
    tangent: f64,
    width: f64,
    height: f64,
}

/// A ray from the near plane on, and how far it goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CameraRay {
    pub origin: Point3,
    pub direction: UnitVector3,
    /// Distance from the pinhole to `origin` [m].
    pub travelled: f64,
    /// Length up to the far plane [m].
    pub length: f64,
}

impl Camera {
    /// The camera of a sensor, for a film of `width` × `height` pixels.
    pub fn new(sensor: &Sensor, width: u32, height: u32) -> Self {
        Self {
            sensor: sensor.clone(),
            tangent: math::tan(0.5 * sensor.fov_x),
            width: f64::from(width),
            height: f64::from(height),
        }
    }

    /// The ray through (x, y) of the film [pixels], (0, 0) being its upper left corner.
    pub fn ray(&self, x: f64, y: f64) -> CameraRay {
        let sensor = &self.sensor;
        let [shift_x, shift_y] = sensor.principal_point_offset;
        // +x of the camera is to the left, +y is up.
        let local = Vector3::new(
            self.tangent * (1.0 - 2.0 * (x / self.width + shift_x)),
            self.tangent * (self.height - 2.0 * (y + shift_y * self.height)) / self.width,
            1.0,
        );
        // One metre along z is so many along the ray.
        let stretch = local.norm();
        let direction = UnitVector3::new_normalize(sensor.world_from_camera.vector(&local));
        let pinhole = sensor.world_from_camera.point(&Point3::origin());
        let travelled = sensor.near_clip * stretch;
        CameraRay {
            origin: pinhole + direction.into_inner() * travelled,
            direction,
            travelled,
            length: (sensor.far_clip - sensor.near_clip) * stretch,
        }
    }
}

impl CameraRay {
    /// As a ray of the tracer.
    pub fn ray(&self) -> Ray {
        Ray::new(self.origin, self.direction.into_inner())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::Transform;
    use crate::scene::{Film, ReconstructionFilter};

    fn camera(offset: [f64; 2]) -> Camera {
        let sensor = Sensor {
            world_from_camera: Transform::translation(Vector3::new(1.0, 2.0, 3.0)),
            fov_x: std::f64::consts::FRAC_PI_2,
            near_clip: 0.5,
            far_clip: 10.0,
            principal_point_offset: offset,
            film: Film { width: 200, height: 100, filter: ReconstructionFilter::Box },
        };
        Camera::new(&sensor, 200, 100)
    }

    #[test]
    fn the_middle_looks_along_z_and_left_is_plus_x() {
        let c = camera([0.0; 2]);
        let middle = c.ray(100.0, 50.0);
        assert!((middle.direction.into_inner() - Vector3::z()).norm() < 1e-15);
        assert!((middle.origin - Point3::new(1.0, 2.0, 3.5)).norm() < 1e-15);
        assert_eq!(middle.length, 9.5);
        // Half of 90° to the left edge; the film is half as high as wide.
        let corner = c.ray(0.0, 0.0);
        let expected = Vector3::new(1.0, 0.5, 1.0);
        assert!((corner.direction.into_inner() - expected.normalize()).norm() < 1e-15);
        assert!((corner.origin - Point3::new(1.5, 2.25, 3.5)).norm() < 1e-15);
        assert!((corner.length - 9.5 * 1.5).abs() < 1e-14);
    }

    #[test]
    fn a_shifted_principal_point_shifts_the_picture() {
        let shifted = camera([0.25, -0.1]).ray(60.0, 40.0);
        let plain = camera([0.0; 2]).ray(110.0, 30.0);
        assert!((shifted.direction.into_inner() - plain.direction.into_inner()).norm() < 1e-15);
    }
}
