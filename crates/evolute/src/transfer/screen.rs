//! Flat opaque polygons that hide a body wholly from a receiver: what a desk top hides from the floor need not be
//! looked for.

use arrayvec::ArrayVec;

use super::extension::facet_of;
use crate::geometry::Point3;
use crate::scene::Scene;
use crate::surface::Surface;

/// Most polygons that are tried for each receiver and body; the largest are.
const MOST: usize = 128;

/// Meshes of more triangles are no furniture.
const MOST_TRIANGLES: usize = 256;

/// A convex polygon through which no light goes.
#[derive(Clone, Debug)]
struct Screen {
    corners: ArrayVec<Point3, 4>,
    area: f64,
}

/// Those of a scene.
#[derive(Clone, Debug)]
pub struct Screens(Vec<Screen>);

impl Screens {
    /// The largest rectangles and flat faces of meshes that are no boundary of a medium.
    pub fn of(scene: &Scene) -> Self {
        let mut screens = Vec::new();
        for shape in scene.shapes.iter().filter(|s| s.material.dielectric.is_none()) {
            match &shape.surface {
                Surface::Rectangle(r) => screens.push(r.corners().into_iter().collect()),
                Surface::Mesh(m) if !m.is_smooth() && m.triangles().len() <= MOST_TRIANGLES => {
                    for t in 0..m.triangles().len() as u32 {
                        let facet = facet_of(m, t);
                        let [e1, e2] = facet.edges;
                        if facet.id != t {
                            continue;
                        }
                        screens.push(if facet.quad {
                            let o = facet.origin;
                            [o, o + e1, o + e1 + e2, o + e2].into_iter().collect()
                        } else {
                            m.corners(t).into_iter().collect()
                        });
                    }
                }
                _ => {}
            }
        }
        let area = |c: &ArrayVec<Point3, 4>| {
            (1..c.len() - 1).map(|k| (c[k] - c[0]).cross(&(c[k + 1] - c[0])).norm()).sum::<f64>()
        };
        let mut screens: Vec<Screen> =
            screens.into_iter().map(|corners| Screen { area: area(&corners), corners }).collect();
        // The sort is stable: of equals the first.
        screens.sort_by(|a, b| b.area.total_cmp(&a.area));
        screens.truncate(MOST);
        Self(screens)
    }

    /// Whether one of them stands before all of a ball.
    pub fn hide(&self, from: &Point3, centre: &Point3, radius: f64) -> bool {
        self.0.iter().any(|s| s.hides(from, centre, radius))
    }
}

impl Screen {
    /// Whether every segment from a point to the ball goes through it: the ball lies beyond the plane, and inside the
    /// pyramid of the polygon.
    fn hides(&self, from: &Point3, centre: &Point3, radius: f64) -> bool {
        let c = &self.corners;
        let Some(normal) = (c[1] - c[0]).cross(&(c[2] - c[0])).try_normalize(0.0) else {
            return false;
        };
        let height = (from - c[0]).dot(&normal);
        // A receiver that lies in the plane is not hidden by it, nor is one that does but for rounding.
        let slack = 1e-9 * (from.coords.norm() + c[0].coords.norm());
        let side = height.signum();
        if height.abs() <= slack || (centre - c[0]).dot(&normal) * side > -radius {
            return false;
        }
        // Seen from before the polygon its corners run round one way.
        (0..c.len()).all(|k| {
            let (p, q) = (c[k] - from, c[(k + 1) % c.len()] - from);
            let face = q.cross(&p) * side;
            face.try_normalize(0.0).is_some_and(|n| n.dot(&(centre - from)) >= radius)
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_square_hides_what_lies_in_its_shadow() {
        let square = |z: f64, turned: bool| {
            let mut corners: ArrayVec<Point3, 4> =
                [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                    .map(|(x, y)| Point3::new(x, y, z))
                    .into_iter()
                    .collect();
            if turned {
                corners.reverse();
            }
            Screen { corners, area: 4.0 }
        };
        let eye = Point3::origin();
        for turned in [false, true] {
            let screen = square(1.0, turned);
            let hides = |x: f64, z: f64, r: f64| screen.hides(&eye, &Point3::new(x, 0.0, z), r);
            assert!(hides(0.0, 2.0, 0.9) && hides(0.0, 2.0, 0.99));
            // It pierces the plane; it is wider than the shadow; it stands beside it, before it, behind the eye.
            assert!(!hides(0.0, 2.0, 1.01) && !hides(0.0, 10.0, 7.1) && hides(0.0, 10.0, 7.0));
            assert!(!hides(1.9, 2.0, 0.1) && hides(1.8, 2.0, 0.1) && !hides(2.2, 2.0, 0.1));
            assert!(!hides(0.0, 0.5, 0.1) && !hides(0.0, -2.0, 0.1));
        }
        assert!(!square(0.0, false).hides(&eye, &Point3::new(0.0, 0.0, 1.0), 0.1));
    }
}
