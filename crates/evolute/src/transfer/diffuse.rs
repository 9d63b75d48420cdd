//! Light straight from polygons: Lambert's closed form.

use arrayvec::ArrayVec;

use super::settings::Receiver;
use super::shaft::MAX_CORNERS;
use crate::geometry::{Point3, Vector3, math};
use crate::surface::Surface;

/// The corners of the parts of a lamp that are flat convex polygons, in an order that is
/// counter-clockwise seen from the emitting side; `None` for a curved lamp.
pub fn polygons(surface: &Surface) -> Option<Vec<ArrayVec<Point3, MAX_CORNERS>>> {
    match surface {
        Surface::Rectangle(r) => {
            let [p, q] = r.half_edges();
            let c = r.centre();
            let mut corners: ArrayVec<Point3, MAX_CORNERS> =
                [c - p - q, c + p - q, c + p + q, c - p + q].into_iter().collect();
            if p.cross(&q).dot(&r.normal()) < 0.0 {
                corners.reverse();
            }
            Some(vec![corners])
        }
        Surface::Mesh(m) if !m.is_smooth() => Some(
            (0..m.triangles().len() as u32)
                .map(|t| {
                    let mut corners: ArrayVec<Point3, MAX_CORNERS> =
                        m.corners(t).into_iter().collect();
                    let [a, b, c] = m.corners(t);
                    // Vertex normals, where there are any, say which side is the front.
                    let middle = m.local(&m.at(t, 1.0 / 3.0, 1.0 / 3.0));
                    let front = middle.map_or_else(Vector3::zeros, |l| l.ng.into_inner());
                    if (b - a).cross(&(c - a)).dot(&front) < 0.0 {
                        corners.reverse();
                    }
                    corners
                })
                .collect(),
        ),
        _ => None,
    }
}

/// Irradiance per unit of radiance from a whole convex polygon, nothing in the way (Lambert 1760);
/// what lies below the receiver's horizon is clipped, and a receiver behind the polygon gets nothing.
/// Error: rounding.
pub fn lambert(receiver: &Receiver, corners: &[Point3]) -> f64 {
    let Some(first) = corners.first() else { return 0.0 };
    let area = (1..corners.len().saturating_sub(1)).fold(Vector3::zeros(), |sum, k| {
        sum + (corners[k] - first).cross(&(corners[k + 1] - first))
    });
    if (receiver.position - first).dot(&area) <= 0.0 {
        return 0.0;
    }
    let n = receiver.normal.into_inner();
    let mut above: ArrayVec<Vector3, { MAX_CORNERS + 2 }> = ArrayVec::new();
    for k in 0..corners.len() {
        let p = corners[k] - receiver.position;
        let q = corners[(k + 1) % corners.len()] - receiver.position;
        let (hp, hq) = (p.dot(&n), q.dot(&n));
        if hp >= 0.0 && !above.is_full() {
            above.push(p);
        }
        if (hp < 0.0) != (hq < 0.0) && !above.is_full() {
            above.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    let mut sum = 0.0;
    for k in 0..above.len() {
        let (p, q) = (above[k], above[(k + 1) % above.len()]);
        let normal = p.cross(&q);
        let sine = normal.norm();
        if sine > 0.0 {
            sum += math::atan2(sine, p.dot(&q)) * normal.dot(&n) / sine;
        }
    }
    // Seen from the receiver the corners run clockwise.
    (-0.5 * sum).max(0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::UnitVector3;

    fn square(half: f64, y: f64) -> Vec<Point3> {
        // Faces down: counter-clockwise seen from below.
        [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, z)| Point3::new(x * half, y, z * half))
            .to_vec()
    }

    /// Parallel square overhead, from the configuration factor of a quarter rectangle.
    #[test]
    fn overhead_square() {
        for (half, y) in [(0.5, 2.0), (3.0, 1.0)] {
            let receiver = Receiver {
                position: Point3::origin(),
                normal: UnitVector3::new_normalize(Vector3::y()),
            };
            let a = half / y;
            let r = (1.0f64 + a * a).sqrt();
            let exact = 4.0 * (a / r) * (a / r).atan();
            let got = lambert(&receiver, &square(half, y));
            assert!((got / exact - 1.0).abs() < 1e-13, "{got} {exact}");
            let flipped: Vec<_> = square(half, y).into_iter().rev().collect();
            assert!(lambert(&receiver, &flipped) == 0.0);
        }
    }

    /// The horizon cuts a square in half.
    #[test]
    fn horizon_clips() {
        let receiver =
            |n| Receiver { position: Point3::origin(), normal: UnitVector3::new_normalize(n) };
        let whole = lambert(&receiver(Vector3::new(1e-9, 1.0, 0.0)), &square(1.0, 1.0));
        let half = lambert(&receiver(Vector3::x()), &square(1.0, 1.0));
        assert!(whole > half && half > 0.0);
        // Exact by symmetry: the half in front alone.
        let front: Vec<_> = vec![
            Point3::new(0.0, 1.0, -1.0),
            Point3::new(1.0, 1.0, -1.0),
            Point3::new(1.0, 1.0, 1.0),
            Point3::new(0.0, 1.0, 1.0),
        ];
        let alone = lambert(&receiver(Vector3::x()), &front);
        assert!((half - alone).abs() < 1e-14);
    }
}
