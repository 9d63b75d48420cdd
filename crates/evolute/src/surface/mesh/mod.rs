//! Triangle meshes.

mod convex;
mod patch;

pub(crate) use patch::{Patch, PatchRoot};

use super::plane::{contact_tolerance, grown_for_rounding};
use super::{Jet, LocalGeometry, SurfaceError, SurfacePoint};
use crate::geometry::{
    Aabb, Matrix2, Matrix3, Point3, Ray, Transform, UnitVector3, Vector2, Vector3,
};
use arrayvec::ArrayVec;

/// What the vertex normals of a mesh do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum MeshSmoothing {
    /// They bend each facet to a smooth quadratic patch, on which rays meet the mesh. Reflections in
    /// 5,000 facets of a sphere are then 1e-4 off the sphere's, not 7 %.
    #[default]
    Patch,
    /// They turn the normal only: the surface is its flat facets (Mitsuba 3's convention).
    Facets,
}

/// A triangle mesh in world space, with or without vertex normals and texture coordinates.
///
/// The front of a facet is the side from which its vertices run counter-clockwise; with vertex
/// normals it is the side of the interpolated normal. Triangles without area are kept in the
/// numbering and never met. With vertex normals and [`MeshSmoothing::Patch`], the default, positions are
/// those of smooth patches over the facets; edges whose normals differ by more than 60°, or are those of
/// a flat face, stay straight, and a mesh of such edges only stays faceted.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    positions: Vec<Point3>,
    triangles: Vec<[u32; 3]>,
    normals: Option<Vec<Vector3>>,
    texcoords: Option<Vec<[f64; 2]>>,
    /// One a triangle, if the mesh is smooth.
    patches: Vec<Patch>,
    bounds: Aabb,
    area: f64,
    convex: bool,
}

impl Mesh {
    /// A mesh of world-space `positions` [m]; `triangles` index them, as well as `normals` (any
    /// length but not all zero; world space, towards the front) and `texcoords`, which are one a
    /// vertex.
    ///
    /// # Errors
    /// When there are no triangles, an index has no vertex, the counts disagree, a number is not
    /// finite, or no triangle has an area.
    pub fn new(
        positions: Vec<Point3>,
        triangles: Vec<[u32; 3]>,
        normals: Option<Vec<Vector3>>,
        texcoords: Option<Vec<[f64; 2]>>,
    ) -> Result<Self, SurfaceError> {
        let count = positions.len();
        for (n, what) in [(count, "vertices"), (triangles.len(), "triangles")] {
            if u32::try_from(n).is_err() {
                return Err(SurfaceError::TooMany(n, what));
            }
        }
        if triangles.is_empty() {
            return Err(SurfaceError::NoTriangles);
        }
        for (given, what) in [
            (normals.as_ref().map(Vec::len), "normals"),
            (texcoords.as_ref().map(Vec::len), "texture coordinates"),
        ] {
            if let Some(given) = given.filter(|&g| g != count) {
                return Err(SurfaceError::WrongCount { what, vertices: count, given });
            }
        }
        for (i, t) in triangles.iter().enumerate() {
            if let Some(&vertex) = t.iter().find(|&&v| v as usize >= count) {
                return Err(SurfaceError::NoSuchVertex { triangle: i, vertex, count });
            }
        }
        let not_finite = |what: String| Err(SurfaceError::NotFinite { what });
        if let Some(i) = positions.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
            return not_finite(format!("vertex {i}"));
        }
        if let Some(i) = normals.iter().flatten().position(|n| !n.iter().all(|c| c.is_finite())) {
            return not_finite(format!("the normal of vertex {i}"));
        }
        if let Some(i) = texcoords.iter().flatten().position(|c| !c.iter().all(|c| c.is_finite())) {
            return not_finite(format!("the texture coordinate of vertex {i}"));
        }
        let (patches, bounds) = (Vec::new(), Aabb::EMPTY);
        let mut mesh = Self {
            positions,
            triangles,
            normals,
            texcoords,
            patches,
            bounds,
            area: 0.0,
            convex: false,
        };
        mesh.measure();
        mesh.convex = mesh.finds_itself_convex();
        if !(mesh.area > 0.0 && mesh.area.is_finite()) {
            return Err(SurfaceError::NoArea { shape: "mesh" });
        }
        Ok(mesh.with_smoothing(MeshSmoothing::default()))
    }

    /// The same mesh with its vertex normals used differently; without any, nothing changes.
    #[must_use]
    pub fn with_smoothing(mut self, smoothing: MeshSmoothing) -> Self {
        self.patches = match smoothing {
            MeshSmoothing::Facets => Vec::new(),
            MeshSmoothing::Patch => {
                let of = |t| Some(Patch::new(&self.corners(t), &self.corner_normals(t)?));
                (0..self.triangles.len() as u32).map_while(of).collect()
            }
        };
        if self.patches.iter().all(Patch::is_flat) {
            self.patches = Vec::new();
        }
        self.measure();
        self
    }

    /// What its vertex normals do: `Facets` if there are none, or none that bend an edge.
    pub fn smoothing(&self) -> MeshSmoothing {
        if self.patches.is_empty() { MeshSmoothing::Facets } else { MeshSmoothing::Patch }
    }

    /// Whether its triangles are curved patches.
    pub fn is_smooth(&self) -> bool {
        !self.patches.is_empty()
    }

    /// Sets bounds and area.
    fn measure(&mut self) {
        let triangles = 0..self.triangles.len() as u32;
        let boxes = triangles.clone().map(|t| self.triangle_bounds(t));
        self.bounds = grown_for_rounding(boxes.fold(Aabb::EMPTY, |a, b| a.union(&b)));
        self.area = triangles
            .map(|t| match self.patch(t) {
                Some(patch) => patch.area(),
                None => 0.5 * self.area_vector(t).norm(),
            })
            .sum();
    }

    /// The patch over a triangle, if the mesh is smooth.
    pub(crate) fn patch(&self, triangle: u32) -> Option<&Patch> {
        self.patches.get(triangle as usize)
    }

    /// Unit normals at a triangle's corners, if the mesh has them; zero where one has no direction.
    fn corner_normals(&self, triangle: u32) -> Option<[Vector3; 3]> {
        let normals = self.normals.as_ref()?;
        Some(self.triangles[triangle as usize].map(|v| {
            let n = normals[v as usize];
            n.try_normalize(0.0).unwrap_or(n)
        }))
    }

    /// A box around a triangle, or the patch over it [m].
    pub fn triangle_bounds(&self, triangle: u32) -> Aabb {
        match self.patch(triangle) {
            Some(patch) => patch.bounds(),
            None => Aabb::around(self.corners(triangle)),
        }
    }

    /// Points whose hull contains a triangle: its corners, or the six control points of the patch
    /// over it [m].
    pub fn hull(&self, triangle: u32) -> ArrayVec<Point3, 6> {
        match self.patch(triangle) {
            Some(patch) => patch.control_points().into(),
            None => self.corners(triangle).into_iter().collect(),
        }
    }

    /// The points at which the ray's line meets the patch over a triangle of a smooth mesh; `through`
    /// gives the weights at a ray parameter at which it is known to.
    pub(crate) fn patch_roots(
        &self,
        triangle: u32,
        ray: &Ray,
        through: Option<(f64, [f64; 2])>,
    ) -> ArrayVec<PatchRoot, 4> {
        self.patch(triangle).map(|p| p.roots(ray, through)).unwrap_or_default()
    }

    /// The cube [−1, 1]³ under `world_from_object`, facing outward, or inward with `flip_normals`;
    /// vertices, triangles and texture coordinates (the unit square on each face) as in Mitsuba 3,
    /// but that a flipped or mirrored cube has the vertices of each triangle in the other order.
    ///
    /// # Errors
    /// When the transform leaves no area.
    pub fn cube(world_from_object: Transform, flip_normals: bool) -> Result<Self, SurfaceError> {
        let positions =
            CUBE.iter().map(|c| world_from_object.point(&Point3::from(c.map(f64::from)))).collect();
        let texcoords = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].repeat(6);
        let turned = (world_from_object.determinant() < 0.0) != flip_normals;
        let triangles = (0..6u32)
            .flat_map(|f| [[0, 1, 2], [3, 0, 2]].map(|t: [u32; 3]| t.map(|v| 4 * f + v)))
            .map(|[a, b, c]| if turned { [a, c, b] } else { [a, b, c] })
            .collect();
        Self::new(positions, triangles, None, Some(texcoords))
    }

    /// Vertex positions [m].
    pub fn positions(&self) -> &[Point3] {
        &self.positions
    }

    /// Vertex indices of each triangle.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Vertex normals, if the mesh has them; of any length.
    pub fn normals(&self) -> Option<&[Vector3]> {
        self.normals.as_deref()
    }

    /// Texture coordinates of the vertices, if the mesh has them.
    pub fn texcoords(&self) -> Option<&[[f64; 2]]> {
        self.texcoords.as_deref()
    }

    /// The three corners of a triangle [m].
    pub fn corners(&self, triangle: u32) -> [Point3; 3] {
        self.triangles[triangle as usize].map(|v| self.positions[v as usize])
    }

    /// (b − a) × (c − a) of a triangle a, b, c [m²].
    pub fn area_vector(&self, triangle: u32) -> Vector3 {
        let [a, b, c] = self.corners(triangle);
        (b - a).cross(&(c - a))
    }

    /// The point with the weights `p` and `q` of a triangle's second and third vertex.
    pub fn at(&self, triangle: u32, p: f64, q: f64) -> SurfacePoint {
        let x = match self.patch(triangle) {
            Some(patch) => patch.at(p, q),
            None => {
                let [a, b, c] = self.corners(triangle);
                a + (b - a) * p + (c - a) * q
            }
        };
        SurfacePoint { primitive: triangle, p, q, x }
    }

    /// ∂x/∂p and ∂x/∂q at a point: by the weights of the second and third corner [m].
    pub fn tangents(&self, point: &SurfacePoint) -> [Vector3; 2] {
        match self.patch(point.primitive) {
            Some(patch) => patch.tangents(point.p, point.q),
            None => {
                let [a, b, c] = self.corners(point.primitive);
                [b - a, c - a]
            }
        }
    }

    /// Texture coordinates of a triangle's vertices: the mesh's, or (0, 0), (1, 0), (0, 1) where it
    /// has none (Mitsuba 3 does the same).
    fn triangle_texcoords(&self, triangle: u32) -> [[f64; 2]; 3] {
        match &self.texcoords {
            Some(c) => self.triangles[triangle as usize].map(|v| c[v as usize]),
            None => [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        }
    }

    /// Weights (p, q) of the point of a triangle with texture coordinates (u, v); `None` outside the
    /// triangle or where its texture coordinates have no area.
    fn weights(&self, triangle: u32, u: f64, v: f64) -> Option<(f64, f64)> {
        let [a, b, c] = self.triangle_texcoords(triangle);
        let sub = |x: [f64; 2], y: [f64; 2]| [x[0] - y[0], x[1] - y[1]];
        let cross = |x: [f64; 2], y: [f64; 2]| x[0] * y[1] - x[1] * y[0];
        let (ab, ac, ax) = (sub(b, a), sub(c, a), sub([u, v], a));
        let area = cross(ab, ac);
        let (p, q) = (cross(ax, ac) / area, cross(ab, ax) / area);
        // A shared border must belong to one of its two triangles in spite of rounding.
        const SLACK: f64 = 1e-12;
        (p >= -SLACK && q >= -SLACK && p + q <= 1.0 + SLACK).then_some((p, q))
    }

    /// The point of texture coordinates: on the first triangle that has them, if one has.
    pub fn point(&self, u: f64, v: f64) -> Option<SurfacePoint> {
        (0..self.triangles.len() as u32)
            .find_map(|t| self.weights(t, u, v).map(|(p, q)| self.at(t, p, q)))
    }

    /// Second derivatives of a triangle by its barycentric weights: ∂²x/∂p², ∂²x/∂p∂q, ∂²x/∂q²; zero
    /// where it is flat [m].
    pub fn second_derivatives(&self, triangle: u32) -> [Vector3; 3] {
        self.patch(triangle).map_or([Vector3::zeros(); 3], Patch::second_derivatives)
    }

    /// Derivatives by texture coordinates.
    pub fn jet(&self, u: f64, v: f64) -> Option<Jet> {
        self.jet_at(&self.point(u, v)?)
    }

    /// Derivatives by texture coordinates, at a point; `None` where they have no area.
    pub fn jet_at(&self, point: &SurfacePoint) -> Option<Jet> {
        let [ta, tb, tc] = self.triangle_texcoords(point.primitive);
        // (u, v) is linear in (p, q); the inverse of that map.
        let uv = Matrix2::new(tb[0] - ta[0], tc[0] - ta[0], tb[1] - ta[1], tc[1] - ta[1]);
        let inverse = uv.try_inverse().filter(|m| m.iter().all(|c| c.is_finite()))?;
        let (by_u, by_v): (Vector2, Vector2) =
            (inverse.column(0).into_owned(), inverse.column(1).into_owned());
        let [xp, xq] = self.tangents(point);
        let [xpp, xpq, xqq] = self.second_derivatives(point.primitive);
        let second = |a: Vector2, b: Vector2| {
            xpp * (a.x * b.x) + xpq * (a.x * b.y + a.y * b.x) + xqq * (a.y * b.y)
        };
        Some(Jet {
            x: point.x,
            xu: xp * by_u.x + xq * by_u.y,
            xv: xp * by_v.x + xq * by_v.y,
            xuu: second(by_u, by_u),
            xuv: second(by_u, by_v),
            xvv: second(by_v, by_v),
        })
    }

    /// Texture coordinates.
    pub fn uv(&self, point: &SurfacePoint) -> [f64; 2] {
        let [a, b, c] = self.triangle_texcoords(point.primitive);
        let mix = |i: usize| a[i] + (b[i] - a[i]) * point.p + (c[i] - a[i]) * point.q;
        [mix(0), mix(1)]
    }

    /// Geometry at a point: the normal interpolated between vertex normals, if there are any, and its
    /// derivative along the surface; else the facet's own. `None` on a triangle without area.
    pub fn local(&self, point: &SurfacePoint) -> Option<LocalGeometry> {
        let [xp, xq] = self.tangents(point);
        let across = xp.cross(&xq);
        let own = UnitVector3::try_new(across, 0.0).filter(|n| n.iter().all(|c| c.is_finite()))?;
        let flat = LocalGeometry { x: point.x, n: own, ng: own, dn_dx: Matrix3::zeros() };
        let Some([na, nb, nc]) = self.corner_normals(point.primitive) else { return Some(flat) };
        let (np, nq) = (nb - na, nc - na);
        let m = na + np * point.p + nq * point.q;
        // Vertex normals that cancel say nothing: the facet's own then.
        let Some(n) = UnitVector3::try_new(m, 0.0) else { return Some(flat) };
        let squared = across.norm_squared();
        let p_of = xq.cross(&across) / squared;
        let q_of = across.cross(&xp) / squared;
        let dm = np * p_of.transpose() + nq * q_of.transpose();
        let tangential = Matrix3::identity() - n.into_inner() * n.transpose();
        Some(LocalGeometry {
            x: point.x,
            n,
            ng: if own.dot(&n) < 0.0 { -own } else { own },
            dn_dx: tangential * dm / m.norm(),
        })
    }

    /// The nearest point of a triangle; on a patch, exact for points on it and to first order in the
    /// distance for others.
    pub fn nearest_on(&self, triangle: u32, x: &Point3) -> SurfacePoint {
        let flat = self.nearest_on_facet(triangle, x);
        match self.patch(triangle) {
            Some(patch) => {
                let (p, q) = patch.nearest(x, flat.p, flat.q);
                self.at(triangle, p, q)
            }
            None => flat,
        }
    }

    /// The nearest point of a facet (Ericson, "Real-Time Collision Detection", 5.1.5), by weights.
    fn nearest_on_facet(&self, triangle: u32, x: &Point3) -> SurfacePoint {
        let [a, b, c] = self.corners(triangle);
        let (ab, ac, ax) = (b - a, c - a, x - a);
        let (d1, d2) = (ab.dot(&ax), ac.dot(&ax));
        if d1 <= 0.0 && d2 <= 0.0 {
            return self.at(triangle, 0.0, 0.0);
        }
        let bx = x - b;
        let (d3, d4) = (ab.dot(&bx), ac.dot(&bx));
        if d3 >= 0.0 && d4 <= d3 {
            return self.at(triangle, 1.0, 0.0);
        }
        let cx = x - c;
        let (d5, d6) = (ab.dot(&cx), ac.dot(&cx));
        if d6 >= 0.0 && d5 <= d6 {
            return self.at(triangle, 0.0, 1.0);
        }
        let vc = d1 * d4 - d3 * d2;
        if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
            return self.at(triangle, d1 / (d1 - d3), 0.0);
        }
        let vb = d5 * d2 - d1 * d6;
        if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
            return self.at(triangle, 0.0, d2 / (d2 - d6));
        }
        let va = d3 * d6 - d5 * d4;
        let (e, f) = (d4 - d3, d5 - d6);
        if va <= 0.0 && e >= 0.0 && f >= 0.0 && e + f > 0.0 {
            let w = e / (e + f);
            return self.at(triangle, 1.0 - w, w);
        }
        let sum = va + vb + vc;
        if sum > 0.0 { self.at(triangle, vb / sum, vc / sum) } else { self.at(triangle, 0.0, 0.0) }
    }

    /// The surface point at `x` on a triangle, if `x` lies on it to within [`contact_tolerance`].
    pub fn locate_on(&self, triangle: u32, x: &Point3) -> Option<SurfacePoint> {
        let tolerance = contact_tolerance(x, &self.bounds);
        if !self.triangle_bounds(triangle).grown(tolerance).contains(x) {
            return None;
        }
        let point = self.nearest_on(triangle, x);
        ((point.x - x).norm() <= tolerance).then_some(point)
    }

    /// The surface point at `x` on the first triangle on which `x` lies to within
    /// [`contact_tolerance`].
    pub fn locate(&self, x: &Point3) -> Option<SurfacePoint> {
        if !self.bounds.grown(contact_tolerance(x, &self.bounds)).contains(x) {
            return None;
        }
        (0..self.triangles.len() as u32).find_map(|t| self.locate_on(t, x))
    }

    /// The least box around it (grown by its rounding error).
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Area [m²].
    pub fn area(&self) -> f64 {
        self.area
    }

    /// Least distance from `x` [m]; looks at every triangle. On patches to first order in the distance.
    pub fn distance(&self, x: &Point3) -> f64 {
        (0..self.triangles.len() as u32)
            .map(|t| (self.nearest_on(t, x).x - x).norm_squared())
            .fold(f64::INFINITY, f64::min)
            .sqrt()
    }
}

/// Corners of Mitsuba's cube, four a face.
#[rustfmt::skip]
const CUBE: [[i8; 3]; 24] = [
    [1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1],
    [1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1],
    [1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1],
    [1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1],
    [-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1],
    [1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1],
];
