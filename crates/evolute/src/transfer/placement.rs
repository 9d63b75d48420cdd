//! Receivers as tables have them: rounded to a few digits.

use super::Receiver;
use crate::geometry::Ray;
use crate::trace::Tracer;

/// How far behind a surface a receiver that faces as it does is taken to lie on it, as a part of the scene's diagonal: six
/// digits of a metre in a room.
const HAIR: f64 = 1e-6;

/// Least cosine between such a surface's normal and the receiver's.
const ALONG: f64 = 0.99;

impl Receiver {
    /// The receiver on the surface that it lies a hair behind, if there is one that faces as it does and lets no light
    /// through: rounding put it there, and it would be dark. Else the same.
    #[must_use]
    pub fn settled(&self, tracer: &Tracer<'_>) -> Self {
        let ray = Ray::new(self.position, self.normal.into_inner());
        let start = tracer.contacts(&self.position);
        let hit = tracer.nearest(&ray, HAIR * tracer.bounds().diagonal(), &start);
        let on = hit.filter(|hit| {
            let shape = tracer.scene().shape(hit.anchor.shape);
            let local = shape.surface.local(&hit.anchor.point);
            shape.material.dielectric.is_none()
                && local.is_some_and(|l| l.ng.dot(&self.normal).abs() > ALONG)
        });
        on.map_or(*self, |hit| Self { position: hit.anchor.point.x, ..*self })
    }

    /// Whether the receiver lies on a line where a surface stands on its own: half of what it could see is behind that.
    pub fn is_at_edge(&self, tracer: &Tracer<'_>) -> bool {
        tracer.contacts(&self.position).iter().any(|contact| {
            let local = tracer.scene().shape(contact.shape).surface.local(&contact.point);
            local.is_some_and(|l| l.ng.dot(&self.normal).abs() < ALONG)
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Point3, UnitVector3, Vector3, math};
    use crate::scene::load_str;

    /// A tilted square, one that is level, and a wall on that.
    const SCENE: &str = r#"<scene version="3.0.0">
        <shape type="rectangle"><transform name="to_world"><rotate z="1" angle="0"/><rotate x="1" angle="20"/></transform></shape>
        <shape type="rectangle"><transform name="to_world"><translate z="-2"/></transform></shape>
        <shape type="rectangle"><transform name="to_world"><rotate y="1" angle="90"/><translate x="-1" z="-1"/></transform></shape>
    </scene>"#;

    #[test]
    fn rounded_receivers_settle_on_their_surfaces() {
        let scene = load_str("tilted", SCENE, &[]).unwrap().scene;
        let tracer = Tracer::new(&scene);
        let (sin, cos) = (math::sin(20f64.to_radians()), math::cos(20f64.to_radians()));
        let front = Vector3::new(0.0, -sin, cos);
        let normal = UnitVector3::new_normalize(front);
        for k in 0..9 {
            let b = 0.1 * f64::from(k) - 0.4;
            let exact = Point3::new(0.3, b * cos, b * sin);
            for behind in [0.0, 1e-13, 1e-9, 1e-6] {
                let receiver = Receiver { position: exact - front * behind, normal };
                let settled = receiver.settled(&tracer);
                assert!((settled.position - exact).norm() < 1e-12, "{b} {behind}");
                assert!(!settled.is_at_edge(&tracer));
            }
            // In front, well behind, or facing elsewhere it stays where it is.
            for (off, normal) in [(1e-6, normal), (-1e-3, normal), (-1e-9, Vector3::x_axis())] {
                let position = exact + front * off;
                let receiver = Receiver { position, normal };
                assert_eq!(receiver.settled(&tracer), receiver);
            }
        }
        let level =
            |x: f64| Receiver { position: Point3::new(x, 0.2, -2.0), normal: Vector3::z_axis() };
        assert!(level(-1.0).is_at_edge(&tracer));
        assert!(!level(-0.999).is_at_edge(&tracer));
    }
}
