//! What a receiver sees by way of plane mirrors alone, without a search.
//!
//! Unfolded along its reflections, a chain of plane mirrors is a straight line: each mirror is a polygon that
//! cuts a part out of the window that those before it leave. What is left of a plane mirror is a letter that may
//! follow, however small it looks: of ten reflections between two facing mirrors the last windows are far narrower
//! than the cells of a first grid. Towards a ball a few chains are traced.
//!
//! What a window shows bounds what may come through it: outside of it cells are dark by proof.
//!
//! Limit: what else stands in the way is not asked; disks and balls count as sixteen-sided polygons around them.

use super::chain::{Event, Step};
use super::extension::{facet, facet_of, is_faceted};
use super::lamp::Lamp;
use super::part::Part;
use super::settings::Receiver;
use super::word::{WordId, Words};
use crate::geometry::{Matrix3, Point3, UnitVector3, Vector3, math, tangent_frame};
use crate::scene::ShapeId;
use crate::surface::Surface;

/// Sides of the polygon that stands for a disk or a ball.
const SIDES: u32 = 16;
/// Part of the way from a window's middle to its corners at which a chain is tried when one through the middle
/// does not arrive.
const ASIDE: f64 = 0.75;
/// A polygon of less area than this share of its size squared is rounding.
const THIN: f64 = 1e-13;

/// The part of a plane mirror that a receiver sees through all mirrors before it.
#[derive(Clone, Debug)]
pub struct Window {
    /// Where it lies when the chain is unfolded to a straight line from the receiver [m].
    corners: Vec<Point3>,
    /// From the scene to where it lies unfolded after the reflection.
    unfold: Isometry,
}

/// x ↦ A x + b with an orthogonal matrix.
#[derive(Clone, Copy, Debug)]
struct Isometry {
    linear: Matrix3,
    shift: Vector3,
}

impl Isometry {
    const IDENTITY: Self = Self {
        linear: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        shift: Vector3::new(0.0, 0.0, 0.0),
    };

    fn point(&self, x: &Point3) -> Point3 {
        Point3::from(self.linear * x.coords + self.shift)
    }

    fn inverse_point(&self, x: &Point3) -> Point3 {
        Point3::from(self.linear.transpose() * (x.coords - self.shift))
    }

    /// After a reflection in the plane through `x` with unit normal `n`.
    fn after_reflection(&self, x: &Point3, n: &Vector3) -> Self {
        let mirror = Matrix3::identity() - n * n.transpose() * 2.0;
        let offset = n * (2.0 * n.dot(&x.coords));
        Self { linear: self.linear * mirror, shift: self.linear * offset + self.shift }
    }
}

impl Window {
    /// The window of a word's last letter, after that of the word before, if all are plane mirrors and one sees
    /// the last.
    pub fn of(
        surface: &Surface,
        step: &Step,
        before: Option<&Self>,
        receiver: &Receiver,
    ) -> Option<Self> {
        if step.event != Event::Reflect {
            return None;
        }
        let polygon = plane_polygon(surface, step.primitive)?;
        let n = normal(&polygon)?;
        let start = before.map_or(Isometry::IDENTITY, |w| w.unfold);
        let corners = match before {
            None => {
                let mut above = polygon.clone();
                clip(&mut above, &receiver.position, &receiver.normal);
                normal(&above).is_some().then_some(above)?
            }
            Some(before) => before.through(&polygon, &receiver.position)?,
        };
        Some(Self { corners, unfold: start.after_reflection(&polygon[0], &n) })
    }

    /// What the receiver sees of a convex polygon through the window, unfolded [m].
    fn through(&self, polygon: &[Point3], receiver: &Point3) -> Option<Vec<Point3>> {
        let mut seen: Vec<Point3> = polygon.iter().map(|x| self.unfold.point(x)).collect();
        let middle = mean(&self.corners) - receiver;
        // Beyond the window's plane.
        let n = normal(&self.corners)?;
        let n = if n.dot(&middle) < 0.0 { -n } else { n };
        clip(&mut seen, &self.corners[0], &n);
        for (k, p) in self.corners.iter().enumerate() {
            let q = &self.corners[(k + 1) % self.corners.len()];
            let (p, q) = (p - receiver, q - receiver);
            let side = p.cross(&q);
            // Between corners that rounding alone keeps apart there is no side.
            if side.norm() <= THIN.sqrt() * p.norm() * q.norm() {
                continue;
            }
            let side = if side.dot(&middle) < 0.0 { -side } else { side };
            clip(&mut seen, receiver, &side);
        }
        normal(&seen).is_some().then_some(seen)
    }

    /// Points spread over it, the middle first, in which directions from the receiver lie [m].
    pub fn points(&self) -> impl Iterator<Item = Point3> + use<> {
        spread(&self.corners)
    }

    /// Irradiance per unit of radiance that all of it would bring (Lambert 1760).
    pub fn offered(&self, receiver: &Receiver) -> f64 {
        let side = |(p, q): (&Point3, &Point3)| {
            let (p, q) = (p - receiver.position, q - receiver.position);
            let across = p.cross(&q);
            let sine = across.norm();
            if sine > 0.0 {
                math::atan2(sine, p.dot(&q)) * across.dot(&receiver.normal) / sine
            } else {
                0.0
            }
        };
        let next = self.corners.iter().cycle().skip(1);
        0.5 * self.corners.iter().zip(next).map(side).sum::<f64>().abs()
    }

    /// Its corners, unfolded [m].
    pub fn corners(&self) -> &[Point3] {
        &self.corners
    }
}

/// What a word's window shows of a lamp.
pub enum Shown {
    /// Not known: the word has no window, or the window's domain is not plane.
    Unknown,
    /// Nothing.
    Nothing,
    /// It comes from this part of the domain at most.
    Within(Part),
}

impl Shown {
    /// What a word shows of a lamp.
    pub fn of(words: &Words<'_>, word: WordId, lamp: &Lamp) -> Self {
        let Some(window) = words.window(word) else { return Self::Unknown };
        let receiver = words.receiver().position;
        let surface = &words.scene().shape(lamp.shape).surface;
        let polygon = plane_polygon(surface, lamp.primitive);
        let seen = match polygon.map(|polygon| window.through(&polygon, &receiver)) {
            // A curved lamp may be anywhere in the window.
            None => window.corners.clone(),
            Some(None) => return Self::Nothing,
            Some(Some(seen)) => seen,
        };
        words.part(word, &seen).map_or(Self::Unknown, Self::Within)
    }
}

/// Traces a chain of a word to each plane or round body that its window shows, and supposes plane mirrors that none
/// arrives at.
pub fn look_through(words: &mut Words<'_>, word: WordId) {
    let Some(window) = words.window(word).cloned() else { return };
    let (scene, receiver) = (words.scene(), words.receiver().position);
    let eye = window.unfold.inverse_point(&receiver);
    let own = words.letter(word);
    let in_part = words.part(word, &window.corners).is_some();
    for (k, shape) in scene.shapes.iter().enumerate() {
        let id = ShapeId(k as u32);
        if !shape.material.is_specular() && shape.radiance.is_black() {
            continue;
        }
        for (piece, polygon) in pieces(&shape.surface, &eye) {
            if (id, piece) == (own.shape, own.primitive) {
                continue;
            }
            let Some(seen) = window.through(&polygon, &receiver) else { continue };
            let plane = is_plane(&shape.surface);
            // Cells look for a plane lamp where it is shown, and a plane mirror that is hidden from the middle
            // need not be hidden from all: one chain is enough to ask.
            let most = match (plane, shape.material.is_specular()) {
                (true, false) if in_part => 0,
                (true, true) => 1,
                _ => usize::MAX,
            };
            let arrives = spread(&seen).take(most).any(|x| {
                let at = words.towards(word, &(x - receiver));
                let departure = at.and_then(|at| words.departure(word, at));
                departure.and_then(|departure| departure.next).is_some_and(|hit| {
                    let met = facet(&shape.surface, hit.anchor.point.primitive);
                    hit.anchor.shape == id && met == piece
                })
            });
            if !arrives && plane {
                words.suppose(word, id, piece, mean(&polygon), &eye);
            }
        }
    }
}

/// The middle of a polygon and points on the way to its corners.
fn spread(polygon: &[Point3]) -> impl Iterator<Item = Point3> + use<> {
    let middle = mean(polygon);
    let corners: Vec<Point3> = polygon.to_vec();
    let aside = corners.into_iter().map(move |corner| middle + (corner - middle) * ASIDE);
    std::iter::once(middle).chain(aside)
}

/// The plane and round pieces of a surface, with the number of the facet where there are some, as polygons:
/// that of a ball is the disc that it covers for the eye.
fn pieces(surface: &Surface, eye: &Point3) -> Vec<(Option<u32>, Vec<Point3>)> {
    match surface {
        Surface::Mesh(m) if is_faceted(m) => (0..m.triangles().len() as u32)
            .filter(|t| facet_of(m, *t).id == *t)
            .filter_map(|t| Some((Some(t), plane_polygon(surface, Some(t))?)))
            .collect(),
        Surface::Sphere(s) => {
            let Some(to) = UnitVector3::try_new(s.centre() - eye, 0.0) else { return Vec::new() };
            let (e1, e2) = tangent_frame(&to);
            vec![(None, round(&s.centre(), &(e1 * s.radius()), &(e2 * s.radius())))]
        }
        _ => plane_polygon(surface, None).map(|polygon| (None, polygon)).into_iter().collect(),
    }
}

/// Whether a surface is a plane polygon, or made of such.
pub fn is_plane(surface: &Surface) -> bool {
    match surface {
        Surface::Rectangle(_) | Surface::Disk(_) => true,
        Surface::Mesh(m) => is_faceted(m),
        _ => false,
    }
}

/// A plane surface, or a facet of one, as a convex polygon [m].
fn plane_polygon(surface: &Surface, primitive: Option<u32>) -> Option<Vec<Point3>> {
    match surface {
        Surface::Rectangle(r) => Some(r.corners().to_vec()),
        Surface::Disk(d) => {
            let [p, q] = d.radii();
            Some(round(&d.centre(), &p, &q))
        }
        Surface::Mesh(m) if is_faceted(m) => {
            let facet = facet_of(m, primitive?);
            let (o, [p, q]) = (facet.origin, facet.edges);
            Some(if facet.quad {
                vec![o, o + p, o + p + q, o + q]
            } else {
                m.corners(facet.id).to_vec()
            })
        }
        _ => None,
    }
}

/// A polygon around the ellipse of two radii.
fn round(centre: &Point3, p: &Vector3, q: &Vector3) -> Vec<Point3> {
    let step = std::f64::consts::TAU / f64::from(SIDES);
    let wider = 1.0 / math::sin_cos(0.5 * step).1;
    let at = |k: u32| {
        let (sin, cos) = math::sin_cos(step * f64::from(k));
        centre + (p * cos + q * sin) * wider
    };
    (0..SIDES).map(at).collect()
}

/// Keeps what of a convex polygon lies where n · (x − origin) ≥ 0.
fn clip(polygon: &mut Vec<Point3>, origin: &Point3, n: &Vector3) {
    let heights: Vec<f64> = polygon.iter().map(|x| n.dot(&(x - origin))).collect();
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, p) in polygon.iter().enumerate() {
        let next = (k + 1) % polygon.len();
        let (from, to) = (heights[k], heights[next]);
        if from >= 0.0 {
            kept.push(*p);
        }
        if (from > 0.0 && to < 0.0) || (from < 0.0 && to > 0.0) {
            kept.push(p + (polygon[next] - p) * (from / (from - to)));
        }
    }
    *polygon = kept;
}

fn mean(points: &[Point3]) -> Point3 {
    let sum: Vector3 = points.iter().map(|x| x.coords).sum();
    Point3::from(sum / points.len().max(1) as f64)
}

/// Unit normal of a polygon; `None` if it is thinner than rounding.
fn normal(polygon: &[Point3]) -> Option<Vector3> {
    let origin = polygon.first()?;
    let edges: Vec<Vector3> = polygon.iter().map(|x| x - origin).collect();
    let area: Vector3 = edges.windows(2).map(|e| e[0].cross(&e[1])).sum();
    let size = edges.iter().fold(0f64, |m, e| m.max(e.norm_squared()));
    (area.norm() > THIN * size).then(|| area.normalize())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn square(z: f64, half: f64) -> Vec<Point3> {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|[x, y]| Point3::new(x * half, y * half, z))
            .to_vec()
    }

    /// Two facing mirrors: the k-th is seen as a square k times as far, and all of it as far as the first one
    /// lets through.
    #[test]
    fn facing_mirrors_show_smaller_and_smaller_squares() {
        let receiver = Point3::new(0.0, 0.0, 0.5);
        let mirrors = [square(1.0, 0.5), square(0.0, 0.5)];
        let mut window = Window {
            corners: mirrors[0].clone(),
            unfold: Isometry::IDENTITY.after_reflection(&mirrors[0][0], &Vector3::z()),
        };
        for k in 2..=12usize {
            let mirror = &mirrors[(k + 1) % 2];
            let corners = window.through(mirror, &receiver).unwrap();
            let distance = k as f64 - 0.5;
            for x in &corners {
                assert!((x.z - 0.5 - distance).abs() < 1e-12, "{k} {x}");
                assert!((x.x.abs() - 0.5).abs() < 1e-12 && (x.y.abs() - 0.5).abs() < 1e-12);
            }
            let unfold = window.unfold.after_reflection(&mirror[0], &Vector3::z());
            let back = unfold.inverse_point(&receiver);
            assert!((back.x.hypot(back.y)) < 1e-12);
            window = Window { corners, unfold };
        }
        // What stands before the mirror is not seen through it.
        assert!(window.through(&square(0.5, 0.1), &receiver).is_some());
        let first = Window {
            corners: mirrors[0].clone(),
            unfold: Isometry::IDENTITY.after_reflection(&mirrors[0][0], &Vector3::z()),
        };
        assert!(first.through(&square(1.5, 0.1), &receiver).is_none());
    }

    #[test]
    fn clips_to_half() {
        let mut polygon = square(0.0, 1.0);
        clip(&mut polygon, &Point3::origin(), &Vector3::new(1.0, 0.0, 0.0));
        assert!(polygon.iter().all(|x| x.x >= 0.0));
        assert!((mean(&polygon) - Point3::new(0.5, 0.0, 0.0)).norm() < 1e-15);
        clip(&mut polygon, &Point3::new(2.0, 0.0, 0.0), &Vector3::new(1.0, 0.0, 0.0));
        assert!(normal(&polygon).is_none());
    }
}
