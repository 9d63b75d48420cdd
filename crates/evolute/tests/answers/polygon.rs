//! Irradiance from polygons seen through polygons, written independently of the library: clipping by
//! half-spaces through the receiver, then the contour integral of Lambert.

use evolute::geometry::{Point3, Vector3};
use evolute::transfer::Receiver;

/// Corners of a convex polygon, counter-clockwise seen from its front.
pub type Polygon = Vec<Point3>;

/// The part of a polygon (corners relative to the receiver) where n · x ≥ 0.
fn clip(corners: &[Vector3], n: &Vector3) -> Vec<Vector3> {
    let mut kept = Vec::with_capacity(corners.len() + 1);
    for (k, p) in corners.iter().enumerate() {
        let q = corners[(k + 1) % corners.len()];
        let (hp, hq) = (n.dot(p), n.dot(&q));
        if hp >= 0.0 {
            kept.push(*p);
        }
        if (hp >= 0.0) != (hq >= 0.0) {
            kept.push(p + (q - p) * (hp / (hp - hq)));
        }
    }
    kept
}

/// Half-spaces through the receiver that bound what is seen through a convex window.
fn sides(at: &Point3, window: &[Point3]) -> Vec<Vector3> {
    let middle = window.iter().fold(Vector3::zeros(), |s, c| s + (c - at)) / window.len() as f64;
    (0..window.len())
        .map(|k| {
            let n = (window[k] - at).cross(&(window[(k + 1) % window.len()] - at));
            if n.dot(&middle) < 0.0 { -n } else { n }
        })
        .collect()
}

/// Irradiance per unit of radiance from a polygon, through a convex window if there is one.
pub fn irradiance(at: &Receiver, polygon: &[Point3], window: Option<&[Point3]>) -> f64 {
    let n = at.normal.into_inner();
    let mut seen: Vec<Vector3> = polygon.iter().map(|c| c - at.position).collect();
    let area = (seen[1] - seen[0]).cross(&(seen[2] - seen[0]));
    if area.dot(&seen[0]) >= 0.0 {
        return 0.0;
    }
    seen = clip(&seen, &n);
    for side in window.map(|w| sides(&at.position, w)).unwrap_or_default() {
        seen = clip(&seen, &side);
    }
    let mut sum = 0.0;
    for (k, p) in seen.iter().enumerate() {
        let q = seen[(k + 1) % seen.len()];
        let across = p.cross(&q);
        if across.norm() > 0.0 {
            sum += across.norm().atan2(p.dot(&q)) * across.normalize().dot(&n);
        }
    }
    0.5 * sum.abs()
}
