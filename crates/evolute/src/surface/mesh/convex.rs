//! Whether a mesh is convex: what two rays meet of it hides all between them.

use super::Mesh;
use crate::geometry::Point3;

/// A cube has twelve; the work grows with the square.
const MOST_TRIANGLES: usize = 12;
/// Share of the mesh's size that a corner may lie before a face [1]: rounding moves it there.
const FLATNESS: f64 = 1e-12;

impl Mesh {
    /// Whether the flat triangles bound a convex body, or are one triangle or one convex quadrilateral. Not asked of
    /// more than twelve.
    pub fn is_convex(&self) -> bool {
        self.convex
    }

    pub(super) fn finds_itself_convex(&self) -> bool {
        if self.triangles.len() > MOST_TRIANGLES {
            return false;
        }
        let faces: Vec<[Point3; 3]> =
            (0..self.triangles.len() as u32).map(|t| self.corners(t)).collect();
        match faces.as_slice() {
            [_] => true,
            [p, q] => is_quadrilateral(p, q),
            faces => is_closed(faces) && is_bulging(faces, self.bounds().diagonal()),
        }
    }
}

/// Whether every edge of a triangle is an edge of exactly one other. Vertices are the same where their positions are.
fn is_closed(faces: &[[Point3; 3]]) -> bool {
    let edges = || faces.iter().flat_map(|f| (0..3).map(move |k| [f[k], f[(k + 1) % 3]]));
    edges().all(|[p, q]| edges().filter(|e| *e == [p, q] || *e == [q, p]).count() == 2)
}

/// Whether all corners lie on the same side of every triangle, on one side of all or on the other.
fn is_bulging(faces: &[[Point3; 3]], size: f64) -> bool {
    let slack = FLATNESS * size;
    let (mut front, mut back) = (false, false);
    for [p, q, r] in faces {
        let Some(n) = (q - p).cross(&(r - p)).try_normalize(0.0) else { return false };
        for corner in faces.as_flattened() {
            let height = n.dot(&(corner - p));
            front |= height > slack;
            back |= height < -slack;
        }
    }
    front != back
}

/// Whether two triangles share an edge and make a flat convex quadrilateral.
fn is_quadrilateral(p: &[Point3; 3], q: &[Point3; 3]) -> bool {
    let Some(k) = (0..3).find(|k| !q.contains(&p[*k])) else { return false };
    let Some(far) = q.iter().find(|c| !p.contains(c)) else { return false };
    let (apex, u, v) = (p[k], p[(k + 1) % 3], p[(k + 2) % 3]);
    let normal = (u - apex).cross(&(v - apex));
    let turn = |a: &Point3, b: &Point3, c: &Point3| (b - a).cross(&(c - b)).dot(&normal);
    let size = (far - apex).norm();
    let flat = normal.dot(&(far - apex)).abs() <= FLATNESS * size * normal.norm();
    flat && turn(&apex, &u, far) > 0.0
        && turn(&u, far, &v) > 0.0
        && turn(far, &v, &apex) > 0.0
        && turn(&v, &apex, &u) > 0.0
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::geometry::Transform;

    fn mesh(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Mesh {
        let positions = points.iter().map(|p| Point3::from(*p)).collect();
        Mesh::new(positions, triangles.to_vec(), None, None).unwrap()
    }

    #[test]
    fn tells_what_has_gaps() {
        assert!(Mesh::cube(Transform::identity(), false).unwrap().is_convex());
        assert!(Mesh::cube(Transform::identity(), true).unwrap().is_convex());
        let square = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        assert!(mesh(&square, &[[0, 1, 2], [2, 3, 0]]).is_convex());
        let mut dented = square;
        dented[2] = [0.2, 0.3, 0.0];
        assert!(!mesh(&dented, &[[0, 1, 3], [2, 3, 1]]).is_convex());
        // A flat frame, and a tube without its ends.
        let frame: Vec<[f64; 3]> = [1.0, 2.0]
            .iter()
            .flat_map(|r| {
                [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                    .map(|c| [r * c[0], r * c[1], 0.0])
            })
            .collect();
        let ring: Vec<[u32; 3]> = (0..4u32)
            .flat_map(|k| [[k, k + 4, (k + 1) % 4 + 4], [(k + 1) % 4 + 4, (k + 1) % 4, k]])
            .collect();
        assert!(!mesh(&frame, &ring).is_convex());
        let tube: Vec<[f64; 3]> = frame
            .iter()
            .enumerate()
            .map(|(k, p)| [p[0].signum(), p[1].signum(), (k / 4) as f64])
            .collect();
        assert!(!mesh(&tube, &ring).is_convex());
    }
}
