//! Ray against triangle, in double precision and without gaps between neighbours.

use crate::geometry::{Point3, Ray, Vector3};
use arrayvec::ArrayVec;

/// A triangle, and whose it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Triangle {
    pub corners: [Point3; 3],
    pub shape: u32,
    pub primitive: u32,
}

/// Where a line meets a triangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct TriangleCrossing {
    pub t: f64,
    /// Weights of the second and third corner.
    pub p: f64,
    pub q: f64,
    /// How much of `t` cancelled when it was summed: a small fraction says that the start is near the
    /// triangle's plane.
    cancelled: bool,
}

/// A ray as the triangle test wants it: sheared so that it runs along one axis (Woop, Benthin & Wald,
/// "Watertight Ray/Triangle Intersection", JCGT 2013). Neighbours compute their common edge's function
/// with the same bits but for the sign, so that a line between them meets at least one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shear {
    origin: Point3,
    axes: [usize; 3],
    shear: Vector3,
}

/// A corner in a ray's sheared frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sheared {
    x: f64,
    y: f64,
    z: f64,
}

impl Shear {
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        let d = &ray.direction;
        let z = d.iamax();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let shear = Vector3::new(d[axes[0]] / d[z], d[axes[1]] / d[z], 1.0 / d[z]);
        Self { origin: ray.origin, axes, shear }
    }

    /// A corner relative to the ray: across it, and along it.
    #[inline(always)]
    pub fn apply(&self, corner: &[f64; 3]) -> Sheared {
        let [kx, ky, kz] = self.axes;
        let z = corner[kz] - self.origin[kz];
        Sheared {
            x: (corner[kx] - self.origin[kx]) - self.shear.x * z,
            y: (corner[ky] - self.origin[ky]) - self.shear.y * z,
            z,
        }
    }

    /// Where the line (t of either sign) meets the triangle; borders belong to it. `None` when they
    /// miss each other or the line lies in the plane.
    #[inline(always)]
    pub fn crossing(&self, corners: &[Sheared; 3]) -> Option<TriangleCrossing> {
        let [a, b, c] = corners;
        let u = c.x * b.y - c.y * b.x;
        let v = a.x * c.y - a.y * c.x;
        let w = b.x * a.y - b.y * a.x;
        let least = u.min(v).min(w);
        let most = u.max(v).max(w);
        if least < 0.0 && most > 0.0 {
            return None;
        }
        let area = u + v + w;
        if area == 0.0 {
            return None;
        }
        let (ta, tb, tc) = (u * a.z, v * b.z, w * c.z);
        let sum = ta + tb + tc;
        // The fraction is generous: it only decides whether the exact question is asked.
        let cancelled = sum.abs() <= 1e-6 * (ta.abs() + tb.abs() + tc.abs());
        Some(TriangleCrossing { t: sum * self.shear.z / area, p: v / area, q: w / area, cancelled })
    }
}

impl TriangleCrossing {
    /// Whether the crossing is the start itself, as far as rounding can tell.
    pub fn is_start(&self, corners: &[Point3; 3], origin: &Point3) -> bool {
        self.cancelled && in_plane(corners, origin)
    }
}

/// Whether `x` is in the triangle's plane as far as rounding can tell.
pub(super) fn in_plane(corners: &[Point3; 3], x: &Point3) -> bool {
    let [a, b, c] = corners;
    let (ab, ac, ax) = (b - a, c - a, x - a);
    let n = ab.cross(&ac);
    let height = n.dot(&ax);
    // Half an ulp of each coordinate in `ax` and in the edges, and the roundings of the products:
    // below 8ε of the sizes involved.
    let edges = (0..3).map(|i| n[i].abs() * (a[i].abs() + x[i].abs())).sum::<f64>();
    let doubt = 8.0 * f64::EPSILON * (edges + ab.norm() * ac.norm() * ax.norm());
    height.abs() <= doubt
}

/// Weights above this are never on a border: no triangle worth its name has corners that are 1e-6 of its
/// size off. Nearly all starts are decided by it.
const BORDER: f64 = 1e-6;

/// Whether [`border`] has to be asked.
#[inline(always)]
pub(super) fn may_be_border(p: f64, q: f64) -> bool {
    (1.0 - p - q).min(p).min(q) <= BORDER
}

/// The corners of the edge or vertex of a triangle on which its point of weights `p`, `q` lies as far
/// as rounding can tell, as indices: none (inside), one (a vertex) or two (an edge).
pub(super) fn border(corners: &[Point3; 3], p: f64, q: f64) -> ArrayVec<usize, 2> {
    let [a, b, c] = corners;
    let size = a.coords.amax().max(b.coords.amax()).max(c.coords.amax());
    let longest = (b - a).norm().max((c - b).norm()).max((a - c).norm());
    let height = (b - a).cross(&(c - a)).norm() / longest;
    // A point computed in world coordinates is up to 64 of their ulps off, as for contacts
    // (`contact_tolerance`), which is this much in weights.
    let slack = (64.0 * f64::EPSILON * (1.0 + size / height)).min(BORDER);
    let weights = [1.0 - p - q, p, q];
    (0..3)
        .filter(|&i| weights[i].abs() > slack)
        .try_fold(ArrayVec::new(), |mut on, i| on.try_push(i).ok().map(|()| on))
        .unwrap_or_default()
}

/// Whether a ray from a point on the border of one triangle runs into another triangle that has that
/// border too, at once: the answer for a start infinitesimally inside the first triangle.
///
/// `inward` points from the start into the first triangle; `shared` are the one or two common corners
/// of the second triangle, `corners`, as indices.
pub(super) fn enters_neighbour(
    corners: &[Point3; 3],
    shared: &[usize],
    inward: &Vector3,
    direction: &Vector3,
) -> bool {
    // From ε·inward the plane is met after ε·tau, at ε·w from the start: blocked if tau > 0 and w lies within
    // the triangle as seen from there.
    let [a, b, c] = corners;
    let n = (b - a).cross(&(c - a));
    let tau = -n.dot(inward) / n.dot(direction);
    if !(tau.is_finite() && tau > 0.0) {
        return false;
    }
    let w = inward + direction * tau;
    let inside_of_edge = |i: usize, j: usize, k: usize| {
        // Which side of edge i–j the displacement w points to, against the side of corner k.
        let edge = corners[j] - corners[i];
        let across = n.cross(&edge);
        across.dot(&w) * across.dot(&(corners[k] - corners[i])) > 0.0
    };
    match *shared {
        [i, j] => inside_of_edge(i, j, 3 - i - j),
        [i] => {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            inside_of_edge(i, j, k) && inside_of_edge(i, k, j)
        }
        _ => false,
    }
}

/// Weights of the three corners at the point next to `x` on a triangle's edge or vertex, given by one or
/// two corners' indices.
pub(super) fn weights_on(corners: &[Point3; 3], border: &[usize], x: &Point3) -> [f64; 3] {
    let mut weights = [0.0; 3];
    match *border {
        [i, j] => {
            let edge = corners[j] - corners[i];
            let w = (edge.dot(&(x - corners[i])) / edge.norm_squared()).clamp(0.0, 1.0);
            weights[i] = 1.0 - w;
            weights[j] = w;
        }
        [i] => weights[i] = 1.0,
        _ => {}
    }
    weights
}
