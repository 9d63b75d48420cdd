//! Smooth quadratic patches over the triangles of a mesh with vertex normals.
//!
//! Phong tessellation (Boubekeur & Alexa, "Phong Tessellation", SIGGRAPH Asia 2008) with α = 1/2: the
//! point of a facet, half-way to the mean of its projections into the tangent planes at the vertices.
//! Half-way, not ¾ as printed there, because a chord's middle then rises by its sagitta h²/8R, so that
//! patches over a sphere lie on it to fourth order in the edge length h.
//!
//! A patch's border over an edge depends on that edge's two positions and normals only: neighbours
//! that share them share the border. Where the normals at an edge's ends turn by more than
//! [`CREASE_COSINE`], the edge stays straight.

use crate::geometry::{Aabb, Matrix2, Point3, Ray, UnitVector3, Vector2, Vector3, tangent_frame};
use arrayvec::ArrayVec;

/// Normals at the ends of an edge that are more than 60° apart are not samples of one smooth surface:
/// a cube's welded corners are 70° and more apart; a ball of eight segments has 45°.
const CREASE_COSINE: f64 = 0.5;

/// A bend of less than this, as a fraction of the edge, is what single precision makes of the normals and
/// positions of a flat face.
const FLAT: f64 = 1e-6;

/// How far outside its triangle, in weights, a root still belongs to a patch: more than the root's
/// rounding, so that a ray through a common border finds at least one of two neighbours.
const BEYOND: f64 = 1e-12;

/// x = v + a p + b q + c p² + d pq + e q².
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Patch {
    v: Point3,
    a: Vector3,
    b: Vector3,
    c: Vector3,
    d: Vector3,
    e: Vector3,
}

/// A root of a ray and a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PatchRoot {
    /// Ray parameter, of either sign.
    pub t: f64,
    pub p: f64,
    pub q: f64,
}

/// A quadratic map of (p, q) to the plane across a ray.
#[derive(Clone, Copy)]
struct Across {
    k: [Vector2; 6],
}

impl Across {
    fn at(&self, p: f64, q: f64) -> Vector2 {
        let [v, a, b, c, d, e] = self.k;
        v + a * p + b * q + (c * p + d * q) * p + e * (q * q)
    }

    fn jacobian(&self, p: f64, q: f64) -> Matrix2 {
        let [_, a, b, c, d, e] = self.k;
        Matrix2::from_columns(&[a + c * (2.0 * p) + d * q, b + d * p + e * (2.0 * q)])
    }

    /// The polar form: the value at a point, or the control value between two.
    fn polar(&self, x: Vector2, y: Vector2) -> Vector2 {
        let [v, a, b, c, d, e] = self.k;
        v + a * (0.5 * (x.x + y.x))
            + b * (0.5 * (x.y + y.y))
            + c * (x.x * y.x)
            + d * (0.5 * (x.x * y.y + x.y * y.x))
            + e * (x.y * y.y)
    }
}

impl Patch {
    /// Over a triangle with unit normals (or zero vectors where there is none) at its corners.
    pub fn new(corners: &[Point3; 3], normals: &[Vector3; 3]) -> Self {
        let bend = |i: usize, j: usize| {
            let edge = corners[j] - corners[i];
            let (m, n) = (&normals[i], &normals[j]);
            if m.dot(n) < CREASE_COSINE {
                return Vector3::zeros();
            }
            let bend = (n * edge.dot(n) - m * edge.dot(m)) * 0.5;
            if bend.norm_squared() < FLAT * FLAT * edge.norm_squared() {
                return Vector3::zeros();
            }
            bend
        };
        // bend(i, j) = bend(j, i) to the bit.
        let (c01, c12, c20) = (bend(0, 1), bend(1, 2), bend(2, 0));
        Self {
            v: corners[0],
            a: corners[1] - corners[0] + c01,
            b: corners[2] - corners[0] + c20,
            c: -c01,
            d: c12 - c01 - c20,
            e: -c20,
        }
    }

    /// Whether it is the facet itself.
    pub fn is_flat(&self) -> bool {
        [self.c, self.d, self.e].iter().all(|k| k.amax() == 0.0)
    }

    /// The point of weights `p`, `q` of the second and third corner.
    pub fn at(&self, p: f64, q: f64) -> Point3 {
        self.v + self.a * p + self.b * q + (self.c * p + self.d * q) * p + self.e * (q * q)
    }

    /// The same point from the first corner.
    fn offset(&self, p: f64, q: f64) -> Vector3 {
        self.a * p + self.b * q + (self.c * p + self.d * q) * p + self.e * (q * q)
    }

    /// ∂x/∂p, ∂x/∂q.
    pub fn tangents(&self, p: f64, q: f64) -> [Vector3; 2] {
        [self.a + self.c * (2.0 * p) + self.d * q, self.b + self.d * p + self.e * (2.0 * q)]
    }

    /// ∂²x/∂p², ∂²x/∂p∂q, ∂²x/∂q².
    pub fn second_derivatives(&self) -> [Vector3; 3] {
        [self.c * 2.0, self.d, self.e * 2.0]
    }

    /// Six points whose hull contains the patch: its Bézier net.
    pub fn control_points(&self) -> [Point3; 6] {
        let [v, a, b] = [self.v, self.v + self.a * 0.5, self.v + self.b * 0.5];
        [v, self.at(1.0, 0.0), self.at(0.0, 1.0), a, b, self.v + (self.a + self.b + self.d) * 0.5]
    }

    /// A box around the patch and what [`Patch::roots`] counts as belonging to it.
    pub fn bounds(&self) -> Aabb {
        let hull = Aabb::around(self.control_points());
        super::grown_for_rounding(hull.grown(8.0 * BEYOND * hull.diagonal()))
    }

    /// Area [m²], by a rule of degree 5 on four parts (error O(h⁶) of an integrand that is nearly
    /// constant).
    pub fn area(&self) -> f64 {
        // Radon's rule: the centre, and two orbits of three points.
        let root = 15f64.sqrt();
        let orbits = [(6.0 - root, 155.0 - root), (6.0 + root, 155.0 + root)];
        let mut points: ArrayVec<([f64; 2], f64), 7> = ArrayVec::new();
        points.push(([1.0 / 3.0; 2], 270.0 / 1200.0));
        for (corner, weight) in orbits {
            let (s, w) = (corner / 21.0, weight / 1200.0);
            let far = 1.0 - 2.0 * s;
            points.extend([([s, s], w), ([far, s], w), ([s, far], w)]);
        }
        let density = |p: f64, q: f64| {
            let [xp, xq] = self.tangents(p, q);
            xp.cross(&xq).norm()
        };
        // Three scaled parts at the corners and the reversed one between them.
        let parts = [(0.0, 0.0, 0.5), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5), (0.5, 0.5, -0.5)];
        let sum: f64 = parts
            .iter()
            .flat_map(|&(p, q, s)| points.iter().map(move |([x, y], w)| (p + s * x, q + s * y, w)))
            .map(|(p, q, w)| w * density(p, q))
            .sum();
        sum * 0.5 * 0.25
    }

    /// The weights of the point nearest to `x`, from a first guess; exact for points on the patch, to
    /// first order in the distance for others.
    pub fn nearest(&self, x: &Point3, mut p: f64, mut q: f64) -> (f64, f64) {
        // Converges quadratically for points on the patch.
        for _ in 0..16 {
            let [xp, xq] = self.tangents(p, q);
            let r = x - self.at(p, q);
            let form = Matrix2::new(xp.norm_squared(), xp.dot(&xq), xp.dot(&xq), xq.norm_squared());
            let Some(inverse) = form.try_inverse() else { break };
            let step = inverse * Vector2::new(xp.dot(&r), xq.dot(&r));
            let (np, nq) = clamped(p + step.x, q + step.y);
            let moved = (np - p).abs() + (nq - q).abs();
            (p, q) = (np, nq);
            if moved < 1e-16 {
                break;
            }
        }
        (p, q)
    }

    /// All points at which the ray's line (t of either sign) meets the patch, up to four. None is
    /// missed but tangencies beyond double precision.
    ///
    /// Across the ray the patch is a quadratic map g of (p, q). A part of the triangle holds no root if
    /// the Bézier coefficients of a component of g have one sign; at most one if ‖A⁻¹(J − A)‖ < ½ for
    /// the Jacobian A at its middle and J all over it (J is linear: at its corners): Newton's iteration
    /// finds it. Else it is quartered.
    ///
    /// `through` gives the weights at a ray parameter at which the line is known to meet the patch (a
    /// ray's start or end on it). The line then passes there by the weights, not by coordinates whose
    /// rounding would move the root: that one is found where it is, also far from the origin.
    pub fn roots(&self, ray: &Ray, through: Option<(f64, [f64; 2])>) -> ArrayVec<PatchRoot, 4> {
        let mut roots = ArrayVec::new();
        let Some(axis) = UnitVector3::try_new(ray.direction, 0.0) else { return roots };
        let (s, t) = tangent_frame(&axis);
        let across = |x: &Vector3| Vector2::new(s.dot(x), t.dot(x));
        // From the line to the patch's first corner, and the ray parameter where that is on the line.
        let (from, t_from) = match through {
            Some((t, [p, q])) => (-self.offset(p, q), t),
            None => (self.v - ray.origin, 0.0),
        };
        let g = Across { k: [from, self.a, self.b, self.c, self.d, self.e].map(|k| across(&k)) };
        let size = self.a.amax() + self.b.amax();
        let reach = if through.is_some() { 0.0 } else { ray.origin.coords.amax() };
        let rounding = 8.0 * f64::EPSILON * (reach + from.amax() + size);
        let slack = rounding + 4.0 * BEYOND * size;

        struct Part {
            corners: [Vector2; 3],
            depth: u32,
        }
        /// 2⁻²⁰ of the triangle: two roots that are closer than that are tangent to 1e-13 of it.
        const DEEPEST: u32 = 20;
        let mut parts: ArrayVec<Part, { 3 * DEEPEST as usize + 4 }> = ArrayVec::new();
        parts.push(Part {
            corners: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(Vector2::from),
            depth: 0,
        });
        while let Some(Part { corners, depth }) = parts.pop() {
            let [x, y, z] = corners;
            let net = [
                g.polar(x, x),
                g.polar(y, y),
                g.polar(z, z),
                g.polar(x, y),
                g.polar(y, z),
                g.polar(z, x),
            ];
            let (low, high) =
                net.iter().fold((net[0], net[0]), |(low, high), k| (low.inf(k), high.sup(k)));
            if low.max() > slack || high.min() < -slack {
                continue;
            }
            let middle = (x + y + z) / 3.0;
            let a = g.jacobian(middle.x, middle.y);
            let single = a.try_inverse().is_some_and(|inverse| {
                corners.iter().all(|c| {
                    let change = inverse * (g.jacobian(c.x, c.y) - a);
                    // Sums of rows: the norm that goes with the largest component.
                    let row = |i: usize| change[(i, 0)].abs() + change[(i, 1)].abs();
                    row(0).max(row(1)) < 0.5
                })
            });
            if !single && depth < DEEPEST {
                let (xy, yz, zx) = ((x + y) * 0.5, (y + z) * 0.5, (z + x) * 0.5);
                for corners in [[x, xy, zx], [xy, y, yz], [zx, yz, z], [xy, yz, zx]] {
                    parts.push(Part { corners, depth: depth + 1 });
                }
                continue;
            }
            let Some(root) = newton(&g, middle, slack) else { continue };
            if !inside(&corners, root) {
                continue;
            }
            let known = |r: &PatchRoot| (r.p - root.x).abs() + (r.q - root.y).abs() < 1e-9;
            if roots.iter().any(known) {
                continue;
            }
            let (p, q) = (root.x, root.y);
            let along = from + self.offset(p, q);
            let t = t_from + along.dot(&ray.direction) / ray.direction.norm_squared();
            // Two quadratics have at most four common roots.
            if t.is_finite() && roots.try_push(PatchRoot { t, p, q }).is_err() {
                break;
            }
        }
        roots
    }
}

/// A root of `g` by Newton's iteration from `x`.
fn newton(g: &Across, mut x: Vector2, slack: f64) -> Option<Vector2> {
    // Under the certificate the error is at least halved in each step, and soon squared.
    for _ in 0..64 {
        let step = g.jacobian(x.x, x.y).try_inverse()? * g.at(x.x, x.y);
        x -= step;
        if step.amax() < 1e-15 {
            break;
        }
        // Away from the triangle for good.
        if x.amax() > 4.0 {
            return None;
        }
    }
    (g.at(x.x, x.y).amax() <= slack).then_some(x)
}

/// Whether `x` is in a part of the triangle, or beyond by no more than [`BEYOND`].
fn inside(corners: &[Vector2; 3], x: Vector2) -> bool {
    let cross = |a: Vector2, b: Vector2| a.x * b.y - a.y * b.x;
    // Positive for parts of either orientation.
    let area = cross(corners[1] - corners[0], corners[2] - corners[0]);
    (0..3).all(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % 3]);
        cross(b - a, x - a) * area.signum() >= -BEYOND * (b - a).norm()
    })
}

/// (p, q) moved into the triangle.
fn clamped(p: f64, q: f64) -> (f64, f64) {
    let (p, q) = (p.max(0.0), q.max(0.0));
    let excess = p + q - 1.0;
    if excess <= 0.0 {
        return (p, q);
    }
    // Along the normal of the third side, then along it.
    let p = (p - 0.5 * excess).clamp(0.0, 1.0);
    (p, 1.0 - p)
}
