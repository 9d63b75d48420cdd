//! From linear to quadratic interpolation without further values: what the vertices around say of second derivatives.
//!
//! The quadratic function through a triangle's three corners and the three vertices beyond its edges has second
//! derivatives H; at the middle of an edge e it differs from the mean of the edge's ends by −eᵀHe/8. Both
//! triangles of an edge have a say, half each, so that the interpolation stays continuous. All of it is linear
//! in the values, so it is kept as weights of vertices.

use super::mesh::TriangleMesh;
use crate::geometry::{Matrix3, RowVector3, Vector3};

/// Weights of vertices, whose values times them add up to what an edge's middle has beyond the mean of its ends.
pub type Stencil = Vec<(u32, f64)>;

/// Second derivatives over a triangle's plane, as weights of its corners and of the vertices beyond its edges.
struct SecondDerivatives {
    vertices: [u32; 6],
    p: Vector3,
    q: Vector3,
    /// From differences beyond the edges to the derivatives along pp, pq, qq.
    inverse: Matrix3,
    /// Coordinates along p and q of the vertices beyond.
    beyond: [(f64, f64); 3],
}

/// Vertices beyond edges that lie so that differences count more than this are too close to a conic through the
/// corners.
const MOST_AMPLIFIED: f64 = 10.0;

/// The same for all vertices together, along one edge: of even triangles it is 4. Beside lines on which things stand
/// triangles may be flat, and know little of what is across.
const MOST_ALONG: f64 = 30.0;

/// Third differences of this part of the second ones are not small.
const NOT_SMOOTH: f64 = 0.5;

impl SecondDerivatives {
    /// Of a triangle; `None` if the vertices around do not determine them.
    fn new(mesh: &TriangleMesh<'_>, t: u32) -> Option<Self> {
        let [a, b, c] = mesh.positions(t);
        let (p, q) = (b - a, c - a);
        let [i, j, k] = mesh.corners(t);
        let mut vertices = [i, j, k, 0, 0, 0];
        let mut rows = Matrix3::zeros();
        let mut coordinates = [(0.0, 0.0); 3];
        for e in 0..3 {
            let beyond = mesh.beyond(t, e)?;
            let (s, u) = within(&p, &q, &(mesh.vertices()[beyond as usize].position - a));
            // Less what the linear terms of a quadratic that is zero at all corners bring.
            rows.set_row(e, &RowVector3::new(0.5 * s * (s - 1.0), s * u, 0.5 * u * (u - 1.0)));
            vertices[3 + e] = beyond;
            coordinates[e] = (s, u);
        }
        let inverse = rows.try_inverse().filter(|i| i.norm() < MOST_AMPLIFIED)?;
        Some(Self { vertices, p, q, inverse, beyond: coordinates })
    }

    /// Along a vector, as weights; `None` if what vertices bring is amplified too much.
    fn along(&self, x: &Vector3) -> Option<[(u32, f64); 6]> {
        let (s, t) = within(&self.p, &self.q, x);
        let share = RowVector3::new(s * s, 2.0 * s * t, t * t) * self.inverse;
        let mut weights = [0.0; 6];
        for (e, (u, v)) in self.beyond.iter().enumerate() {
            weights[3 + e] += share[e];
            weights[0] -= share[e] * (1.0 - u - v);
            weights[1] -= share[e] * u;
            weights[2] -= share[e] * v;
        }
        let all: f64 = weights.iter().map(|w| w.abs()).sum();
        (all < MOST_ALONG).then(|| std::array::from_fn(|i| (self.vertices[i], weights[i])))
    }
}

/// Coordinates of a vector in a plane's basis.
pub fn within(p: &Vector3, q: &Vector3, x: &Vector3) -> (f64, f64) {
    let (pp, pq, qq) = (p.norm_squared(), p.dot(q), q.norm_squared());
    let (xp, xq) = (x.dot(p), x.dot(q));
    let determinant = pp * qq - pq * pq;
    ((xp * qq - xq * pq) / determinant, (xq * pp - xp * pq) / determinant)
}

impl TriangleMesh<'_> {
    /// By triangle, its own second derivatives.
    fn second_derivatives(&self) -> Vec<Option<SecondDerivatives>> {
        let count = self.triangles().last().map_or(0, |t| t as usize + 1);
        let mut own: Vec<Option<SecondDerivatives>> = Vec::new();
        own.resize_with(count, || None);
        for t in self.triangles() {
            own[t as usize] = SecondDerivatives::new(self, t);
        }
        own
    }

    /// By edge of a triangle: what linear interpolation of the values at vertices is wrong by in the mean, roughly and
    /// without sign: an eighth of what the vertex beyond the edge differs by from the plane through the triangle's own.
    /// (For second derivatives that is the error to within a factor of two; where a function jumps in the
    /// triangle, less than it.) `None` at a border, or where that vertex does not tell.
    pub fn linear_errors(&self, t: u32, value: &dyn Fn(u32) -> f64) -> [Option<f64>; 3] {
        let values = self.corners(t).map(value);
        let [a, b, c] = self.positions(t);
        let (p, q) = (b - a, c - a);
        [0, 1, 2].map(|e| {
            let beyond = self.beyond(t, e)?;
            let (s, u) = within(&p, &q, &(self.vertices()[beyond as usize].position - a));
            let plane = values[0] + s * (values[1] - values[0]) + u * (values[2] - values[0]);
            Some(0.125 * (plane - value(beyond)).abs()).filter(|error| error.is_finite())
        })
    }

    /// By triangle: what quadratic interpolation of the values at vertices is wrong by, roughly and without sign: half of
    /// what the two triangles of an edge differ by in what they say of its middle, for the edge where that is most. (It is of
    /// third order, like the error, and for third derivatives a few times that.) Where it is not small beside the error
    /// of linear interpolation, that one counts: there a function is not smooth; nor is it, often, where triangles end and
    /// not all three are known. It is no more than values around are apart, as beside flat triangles planes run off to
    /// anything, and no less than in triangles around, since third differences may vanish by chance.
    pub fn quadratic_errors(&self, value: &dyn Fn(u32) -> f64) -> Vec<(u32, f64)> {
        let own = self.second_derivatives();
        let at = |v: u32| self.vertices()[v as usize].position;
        let bend = |t: u32, edge: &Vector3| {
            let weights = own[t as usize].as_ref()?.along(edge)?;
            Some(-0.125 * weights.iter().map(|(v, w)| value(*v) * w).sum::<f64>())
        };
        let of = |t: u32| {
            let corners = self.corners(t);
            let linear = self.linear_errors(t, value);
            let third = [0, 1, 2].map(|e| {
                let edge = at(corners[(e + 1) % 3]) - at(corners[e]);
                let both = bend(t, &edge).zip(self.next(t, e).and_then(|n| bend(n, &edge)));
                both.map(|(here, there)| 0.5 * (here - there).abs())
            });
            let is_known = third.iter().all(Option::is_some);
            let most = third.into_iter().zip(linear).filter_map(|(third, second)| {
                match third.zip(second) {
                    Some((third, second)) if is_known && third <= NOT_SMOOTH * second => {
                        Some(third)
                    }
                    Some((third, second)) => Some(third.max(second)),
                    None => third.or(second),
                }
            });
            let beyond = (0..3).filter_map(|e| self.beyond(t, e));
            let (low, high) = corners
                .into_iter()
                .chain(beyond)
                .map(value)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
            (t, most.fold(0.0, f64::max).min(high - low))
        };
        let each: Vec<(u32, f64)> = self.triangles().map(of).collect();
        let mut errors = vec![0.0; own.len()];
        for (t, error) in &each {
            errors[*t as usize] = *error;
        }
        let around = |t: u32| (0..3).filter_map(move |e| self.next(t, e));
        each.iter()
            .map(|&(t, error)| (t, around(t).map(|n| errors[n as usize]).fold(error, f64::max)))
            .collect()
    }

    /// By triangle, of those in question, and edge: what the middle of the edge has beyond the mean of its ends if a
    /// function is quadratic. Empty where the vertices around do not tell.
    pub fn middles(&self, triangles: &[u32]) -> Vec<[Stencil; 3]> {
        let own = self.second_derivatives();
        // At a border, those of a neighbour.
        let of = |t: u32| {
            let around = (0..3).filter_map(|e| self.next(t, e));
            std::iter::once(t).chain(around).find_map(|n| own[n as usize].as_ref())
        };
        let at = |v: u32| self.vertices()[v as usize].position;
        triangles
            .iter()
            .map(|&t| {
                let corners = self.corners(t);
                [0, 1, 2].map(|e| {
                    let edge = at(corners[(e + 1) % 3]) - at(corners[e]);
                    let sides = [Some(t), self.next(t, e)].into_iter().flatten();
                    let known: Vec<_> =
                        sides.filter_map(of).filter_map(|d| d.along(&edge)).collect();
                    let share = -0.125 / known.len().max(1) as f64;
                    let mut stencil = Stencil::new();
                    for weights in known {
                        stencil.extend(weights.map(|(v, w)| (v, share * w)));
                    }
                    merged(stencil)
                })
            })
            .collect()
    }
}

/// Each vertex once.
pub fn merged(mut stencil: Stencil) -> Stencil {
    stencil.sort_by_key(|s| s.0);
    stencil.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        if same {
            kept.1 += next.1;
        }
        same
    });
    stencil
}
