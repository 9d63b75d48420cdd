//! Meshes, and the slow search for their triangles and patches.

use super::quartering::Chart;
use super::{Random, Root};
use evolute::geometry::{Point3, Ray, Transform, Vector3};
use evolute::surface::Mesh;
use std::f64::consts::{PI, TAU};

/// A closed bumpy ball of 2·n·(n−1) triangles about the origin.
pub fn bumpy_ball(r: &mut Random, n: u32, world: &Transform) -> Mesh {
    let mut positions = vec![world.point(&Point3::new(0.0, 0.0, 1.0))];
    for i in 1..n {
        for j in 0..n {
            let (t, p) = (f64::from(i) / f64::from(n) * PI, f64::from(j) / f64::from(n) * TAU);
            let d = Vector3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
            positions.push(world.point(&Point3::from(d * r.between(0.8, 1.2))));
        }
    }
    positions.push(world.point(&Point3::new(0.0, 0.0, -1.0)));
    let at = |i: u32, j: u32| match i {
        0 => 0,
        i if i == n => (n - 1) * n + 1,
        i => 1 + (i - 1) * n + j % n,
    };
    let mut triangles = vec![];
    for i in 0..n {
        for j in 0..n {
            if i > 0 {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            }
            if i + 1 < n {
                triangles.push([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
            }
        }
    }
    Mesh::new(positions, triangles, None, None).unwrap()
}

/// An ellipsoid of `n` segments around with its own normals at the vertices.
pub fn smooth_ball(n: u32, world: &Transform) -> Mesh {
    let (mut positions, mut normals, mut triangles) = (vec![], vec![], vec![]);
    let rings = n / 2;
    for j in 0..=rings {
        for i in 0..n {
            let (t, p) = (f64::from(j) / f64::from(rings) * PI, f64::from(i) / f64::from(n) * TAU);
            let d = Vector3::new(t.sin() * p.cos(), t.sin() * p.sin(), t.cos());
            // Poles and seam must be the same bits for all neighbours.
            let d = if j == 0 || j == rings { Vector3::new(0.0, 0.0, t.cos()) } else { d };
            positions.push(world.point(&Point3::from(d)));
            normals.push(world.normal(&d).normalize());
        }
    }
    for j in 0..rings {
        for i in 0..n {
            let at = |i: u32, j: u32| j * n + i % n;
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j));
            if j + 1 < rings {
                triangles.push([a, b, c]);
            }
            if j > 0 {
                triangles.push([a, c, d]);
            }
        }
    }
    Mesh::new(positions, triangles, Some(normals), None).unwrap()
}

/// All roots by Plücker coordinates, but for the triangle `own`.
pub fn roots(m: &Mesh, ray: &Ray, t_max: f64, own: Option<u32>) -> Vec<Root> {
    let d = ray.direction;
    let speed = d.norm();
    let mut roots = vec![];
    for i in (0..m.triangles().len() as u32).filter(|&i| own != Some(i)) {
        let [a, b, c] = m.corners(i).map(|x| x - ray.origin);
        // Volumes of the tetrahedra spanned by the ray and each edge.
        let v = [d.dot(&b.cross(&c)), d.dot(&c.cross(&a)), d.dot(&a.cross(&b))];
        let reach = a.norm().max(b.norm()).max(c.norm());
        // Some hundred roundings of the products.
        let rounding = 1e-13 * speed * reach * (b - a).norm().max((c - a).norm());
        if v.iter().any(|x| *x > rounding) && v.iter().any(|x| *x < -rounding) {
            continue;
        }
        let n = (b - a).cross(&(c - a));
        let t = n.dot(&a) / n.dot(&d);
        if !(t > 0.0 && t <= t_max) {
            continue;
        }
        let near_edge = v.iter().any(|x| x.abs() < rounding);
        let slope = n.dot(&d).abs() / (n.norm() * speed);
        let doubt = 1e-14 * reach / slope;
        roots.push(Root { t, doubt, certain: !near_edge && t * speed > doubt });
    }
    roots
}

/// A patch by its definition: half-way from the facet to the mean of its point's projections into the
/// tangent planes at the corners.
struct PhongPatch {
    corners: [Point3; 3],
    normals: [Vector3; 3],
    /// A ball around it.
    centre: Point3,
    radius: f64,
}

impl PhongPatch {
    fn new(mesh: &Mesh, triangle: u32) -> Self {
        let normals = mesh.normals().unwrap();
        let corners = mesh.corners(triangle);
        let normals = mesh.triangles()[triangle as usize].map(|v| normals[v as usize].normalize());
        let sum: Vector3 = corners.iter().map(|c| c.coords).sum();
        Self { corners, normals, centre: Point3::from(sum / 3.0), radius: 0.0 }
    }

    fn at(&self, p: f64, q: f64) -> Point3 {
        let [a, b, c] = self.corners;
        let flat = a + (b - a) * p + (c - a) * q;
        let mut drop = Vector3::zeros();
        for (i, w) in [1.0 - p - q, p, q].into_iter().enumerate() {
            let n = &self.normals[i];
            drop += n * ((flat - self.corners[i]).dot(n) * w);
        }
        flat - drop * 0.5
    }
}

/// The point of a patch by its definition.
pub fn phong_point(mesh: &Mesh, triangle: u32, p: f64, q: f64) -> Point3 {
    PhongPatch::new(mesh, triangle).at(p, q)
}

/// The patches of a smooth mesh.
pub struct Patches(Vec<PhongPatch>);

impl Patches {
    pub fn new(mesh: &Mesh) -> Self {
        let patch = |i: u32| {
            let mut patch = PhongPatch::new(mesh, i);
            // The farthest of 81 samples, and a twentieth for what lies between them.
            for k in 0..81 {
                let (p, q) = (f64::from(k % 9) / 8.0, f64::from(k / 9) / 8.0);
                if p + q <= 1.0 {
                    patch.radius = patch.radius.max(1.05 * (patch.at(p, q) - patch.centre).norm());
                }
            }
            patch
        };
        Self((0..mesh.triangles().len() as u32).map(patch).collect())
    }

    /// All roots with t of either sign.
    pub fn roots(&self, ray: &Ray) -> Vec<Root> {
        let mut roots = vec![];
        let inverse_square = 1.0 / ray.direction.norm_squared();
        for patch in &self.0 {
            let o = patch.centre - ray.origin;
            let along = o.dot(&ray.direction);
            let past = o.norm_squared() - along * along * inverse_square;
            // Grown by what the subtraction may lose.
            if past > patch.radius * patch.radius + 1e-12 * o.norm_squared() {
                continue;
            }
            let chart = Chart {
                at: |p: f64, q: f64| patch.at(p, q),
                triangle: true,
                size: patch.radius,
                reach: patch.centre.coords.amax() + patch.radius,
            };
            chart.search(ray, ([0.5; 2], [0.5; 2]), &mut roots);
        }
        roots
    }
}
