//! Nearest hit and occlusion over all surfaces of a scene.
//!
//! Rays leave surfaces by geometry, not by an offset: the anchors given with a ray name the roots that
//! are its own start. A plane, a rectangle or a triangle is not met again; of a sphere or cylinder the
//! known root is divided out and the other one counts; a start on the border of two triangles counts
//! as infinitesimally inside the anchor's own, so that a concave neighbour blocks at once and a convex
//! or coplanar one does not. A surface that is *not* named but on which the start lies as far as the
//! rounding of its own test can tell is not met there either.

mod ends;
mod hierarchy;
mod leaves;
pub mod tree;
mod triangle;

use crate::geometry::{Aabb, Point3, Ray};
use crate::scene::{Scene, ShapeId};
use crate::surface::{Mesh, Surface, SurfacePoint, contact_tolerance};
use arrayvec::ArrayVec;
use ends::{AtBorder, BorderPoint, Ends, meet_at_border, meet_patch, meet_triangle};
use hierarchy::{Hierarchy, Leaf, Slabs};
use leaves::TriangleLeaves;
use triangle::{Shear, Triangle, may_be_border};

/// A point of a shape: where a ray starts or ends. A ray does not meet the surface again at the
/// point it starts from; other intersections with the same surface count.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// The shape.
    pub shape: ShapeId,
    /// The point on it.
    pub point: SurfacePoint,
}

/// Where a ray meets a surface first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Ray parameter, in units of the direction's length. Zero only where a ray from the border of
    /// two triangles runs into the neighbour at once.
    pub t: f64,
    /// Where; the point's `x` lies on the surface to rounding, not only on the ray.
    pub anchor: Anchor,
}

/// Finds nearest hits and occlusion in a scene. Shared by threads.
///
/// Every surface is met from both sides; what a side does is the material's affair. Answers do not
/// depend on the hierarchy: of hits at equal t the one of the lowest shape, then of its lowest
/// triangle, counts.
#[derive(Debug)]
pub struct Tracer<'s> {
    scene: &'s Scene,
    hierarchy: Hierarchy,
    triangles: TriangleLeaves,
    /// In the order of the hierarchy's leaves.
    others: Vec<(u32, u32)>,
}

/// What a ray finds at a triangle or another primitive.
type Found = (f64, SurfacePoint);

impl<'s> Tracer<'s> {
    /// Builds the hierarchy.
    pub fn new(scene: &'s Scene) -> Self {
        let mut primitives = Vec::new();
        let mut boxes = Vec::new();
        for (i, shape) in (0u32..).zip(&scene.shapes) {
            for primitive in 0..primitive_count(&shape.surface) {
                let b = primitive_bounds(&shape.surface, primitive);
                // A triangle without area is never met; the half-open rest of a NaN neither.
                if !b.is_empty() {
                    primitives.push((i, primitive));
                    boxes.push(b);
                }
            }
        }
        let surface = |i: u32| &scene.shapes[i as usize].surface;
        let mut hierarchy = Hierarchy::new(&boxes, |i| match surface(primitives[i as usize].0) {
            Surface::Mesh(m) if !m.is_smooth() => 0,
            _ => 1,
        });
        let triangles: Vec<Triangle> = hierarchy.order[0]
            .iter()
            .filter_map(|&i| {
                let (shape, primitive) = primitives[i as usize];
                mesh_of(surface(shape)).map(|m| Triangle {
                    corners: m.corners(primitive),
                    shape,
                    primitive,
                })
            })
            .collect();
        let others = hierarchy.order[1].iter().map(|&i| primitives[i as usize]).collect();
        let starts = &hierarchy.starts[0];
        let ends = starts.iter().skip(1).copied().chain([triangles.len() as u32]);
        let leaves = starts.iter().zip(ends).map(|(&a, b)| &triangles[a as usize..b as usize]);
        let (triangles, lines) = TriangleLeaves::new(leaves);
        hierarchy.renumber(&lines);
        hierarchy.order[0] = Vec::new();
        hierarchy.starts[0] = Vec::new();
        Self { scene, hierarchy, triangles, others }
    }

    /// The scene traced.
    pub fn scene(&self) -> &'s Scene {
        self.scene
    }

    /// A box around everything [m].
    pub fn bounds(&self) -> Aabb {
        self.hierarchy.bounds
    }

    /// The first surface that the ray meets at 0 < t ≤ `t_max`; `start` names the surfaces on which
    /// it starts.
    pub fn nearest(&self, ray: &Ray, t_max: f64, start: &[Anchor]) -> Option<Hit> {
        let slabs = Slabs::new(&self.hierarchy, ray)?;
        let shear = Shear::new(ray);
        let ahead = |leaf| self.prefetch(leaf);
        let mut borders = ArrayVec::new();
        self.find_borders(ray, t_max, start, None, &mut borders);
        let ends = Ends { start, end: None, end_point: None, borders: &borders };
        let mut best: Option<(u32, Found)> = None;
        // Of equals the lowest shape, then the lowest primitive, wins.
        let offer = |best: &mut Option<(u32, Found)>, t_max: &mut f64, shape: u32, found: Found| {
            let ((t, point), wins) = (
                found,
                match best {
                    None => true,
                    Some((s, (t, p))) => {
                        found.0 < *t
                            || found.0 == *t && (shape, found.1.primitive) < (*s, p.primitive)
                    }
                },
            );
            if wins {
                *best = Some((shape, (t, point)));
                *t_max = t;
            }
        };
        self.hierarchy.along(&slabs, t_max, ahead, |leaf, t_max| {
            if leaf.class == 0 {
                self.meet_triangles(leaf, &shear, ray, *t_max, &ends, |shape, found| {
                    offer(&mut best, t_max, shape, found);
                    false
                });
            }
            for &(shape, primitive) in self.others_of(leaf) {
                if let Some(found) = self.meet(shape, primitive, ray, *t_max, &ends) {
                    offer(&mut best, t_max, shape, found);
                }
            }
            false
        });
        let (shape, (t, point)) = best?;
        Some(Hit { t, anchor: Anchor { shape: ShapeId(shape), point } })
    }

    /// Whether anything lies strictly between the ray's start and `t_max`. `start` names the surfaces
    /// on which the ray starts, `end` the surface point at `t_max`: its own root there does not
    /// occlude, other roots of its surface do. Surfaces on which the end lies as far as rounding can
    /// tell (a lamp flush in a ceiling) do not occlude there either.
    pub fn occluded(&self, ray: &Ray, t_max: f64, start: &[Anchor], end: Option<&Anchor>) -> bool {
        let Some(slabs) = Slabs::new(&self.hierarchy, ray) else { return false };
        let shear = Shear::new(ray);
        let ahead = |leaf| self.prefetch(leaf);
        let mut borders = ArrayVec::new();
        self.find_borders(ray, t_max, start, end, &mut borders);
        let end_point = t_max.is_finite().then(|| end.map_or_else(|| ray.at(t_max), |e| e.point.x));
        let ends = Ends { start, end, end_point, borders: &borders };
        let mut occluded = false;
        self.hierarchy.along(&slabs, t_max, ahead, |leaf, t_max| {
            occluded = match leaf.class {
                0 => self.meet_triangles(leaf, &shear, ray, *t_max, &ends, |_, _| true),
                _ => self
                    .others_of(leaf)
                    .iter()
                    .any(|&(shape, i)| self.meet(shape, i, ray, *t_max, &ends).is_some()),
            };
            occluded
        });
        occluded
    }

    /// The surfaces on which `x` lies, to within [`contact_tolerance`] (64 units in the last place of
    /// the largest coordinate of `x` and of the surface's bounds: what a dozen operations in double
    /// precision may lose); at most eight, the first by shape. Of a mesh one triangle, the first; more
    /// only where triangles without a common corner touch.
    pub fn contacts(&self, x: &Point3) -> ArrayVec<Anchor, 8> {
        let around = Aabb { min: *x, max: *x }.grown(contact_tolerance(x, &self.bounds()));
        let mut found = Vec::new();
        let mut add = |shape: u32, point: Option<SurfacePoint>| {
            found.extend(point.map(|point| Anchor { shape: ShapeId(shape), point }));
        };
        self.hierarchy.within(
            &around,
            |_| true,
            |leaf| {
                for t in self.triangles_of(leaf) {
                    if let Some(m) = mesh_of(self.surface(t.shape)) {
                        add(t.shape, m.locate_on(t.primitive, x));
                    }
                }
                for &(shape, i) in self.others_of(leaf) {
                    add(
                        shape,
                        match self.surface(shape) {
                            Surface::Mesh(m) => m.locate_on(i, x),
                            s => s.locate(x),
                        },
                    );
                }
                false
            },
        );
        found.sort_by_key(|a| (a.shape, a.point.primitive));
        let mut contacts: ArrayVec<Anchor, 8> = ArrayVec::new();
        for anchor in found {
            let known = contacts.iter().any(|c| {
                c.shape == anchor.shape
                    && (c.point.primitive == anchor.point.primitive
                        || mesh_of(&self.scene.shape(c.shape).surface).is_some_and(|m| {
                            let near = m.corners(anchor.point.primitive);
                            m.corners(c.point.primitive).iter().any(|p| near.contains(p))
                        }))
            });
            if !known && contacts.try_push(anchor).is_err() {
                break;
            }
        }
        contacts
    }

    /// Collects all primitives whose boxes overlap `bounds` into `out` (emptied first), by shape and
    /// primitive; false, and no more than `limit` of them in `out`, if there are more.
    pub fn occluders_in(&self, bounds: &Aabb, out: &mut Vec<(ShapeId, u32)>, limit: usize) -> bool {
        out.clear();
        let more = self.any_in(
            bounds,
            |_| true,
            |_, _| true,
            |shape, primitive| {
                let full = out.len() == limit;
                if !full {
                    out.push((shape, primitive));
                }
                full
            },
        );
        out.sort_unstable();
        !more
    }

    /// Whether `holds` of any `wanted` primitive whose box overlaps `bounds`; asked in no particular order,
    /// and not of those in boxes of which `keep` does not hold. What is wanted is asked first, and should be
    /// quick to say: a primitive's box is not at hand.
    pub fn any_in(
        &self,
        bounds: &Aabb,
        keep: impl Fn(&Aabb) -> bool,
        mut wanted: impl FnMut(ShapeId, u32) -> bool,
        mut holds: impl FnMut(ShapeId, u32) -> bool,
    ) -> bool {
        let mut any = false;
        self.hierarchy.within(bounds, keep, |leaf| {
            let triangles = self.triangles_of(leaf).map(|t| (t.shape, t.primitive));
            any =
                triangles.chain(self.others_of(leaf).iter().copied()).any(|(shape, primitive)| {
                    wanted(ShapeId(shape), primitive)
                        && primitive_bounds(self.surface(shape), primitive).overlaps(bounds)
                        && holds(ShapeId(shape), primitive)
                });
            any
        });
        any
    }

    fn surface(&self, shape: u32) -> &'s Surface {
        &self.scene.shapes[shape as usize].surface
    }

    #[inline(always)]
    fn prefetch(&self, leaf: Leaf) {
        if leaf.class == 0 {
            self.triangles.prefetch(leaf.number);
        }
    }

    fn triangles_of(&self, leaf: Leaf) -> impl Iterator<Item = Triangle> {
        (leaf.class == 0).then(|| self.triangles.triangles(leaf.number)).into_iter().flatten()
    }

    /// Calls `found` for each triangle of a leaf that the ray meets at 0 < t ≤ `t_max`, until it
    /// returns true; whether it did.
    #[inline(always)]
    fn meet_triangles(
        &self,
        leaf: Leaf,
        shear: &Shear,
        ray: &Ray,
        t_max: f64,
        ends: &Ends,
        mut found: impl FnMut(u32, Found) -> bool,
    ) -> bool {
        if !ends.borders.is_empty() {
            return self.meet_triangles_at_borders(leaf, shear, ray, t_max, ends, &mut found);
        }
        self.triangles.crossings(leaf.number, shear, |triangle, c| {
            meet_triangle(triangle, c, ray, t_max, ends).is_some_and(|f| found(triangle.shape, f))
        })
    }

    /// The same for rays that start or end on borders of triangles.
    #[cold]
    fn meet_triangles_at_borders(
        &self,
        leaf: Leaf,
        shear: &Shear,
        ray: &Ray,
        t_max: f64,
        ends: &Ends,
        found: &mut dyn FnMut(u32, Found) -> bool,
    ) -> bool {
        self.triangles.triangles(leaf.number).any(|triangle| {
            let met = match meet_at_border(&triangle, ends) {
                AtBorder::Elsewhere => {
                    let sheared = triangle.corners.map(|c| shear.apply(&c.coords.into()));
                    shear
                        .crossing(&sheared)
                        .and_then(|c| meet_triangle(&triangle, &c, ray, t_max, ends))
                }
                AtBorder::Passed => None,
                AtBorder::Met(found) => Some(found).filter(|f| f.0 <= t_max),
            };
            met.is_some_and(|f| found(triangle.shape, f))
        })
    }

    #[inline(always)]
    fn others_of(&self, leaf: Leaf) -> &[(u32, u32)] {
        match leaf.class {
            0 => &[],
            // These have a leaf each.
            _ => &self.others[leaf.number..][..leaf.count],
        }
    }

    /// Which of a ray's ends are on borders of triangles.
    #[inline(always)]
    fn find_borders(
        &self,
        ray: &Ray,
        t_max: f64,
        start: &[Anchor],
        end: Option<&Anchor>,
        borders: &mut ArrayVec<BorderPoint, 9>,
    ) {
        let mut note = |anchor: &Anchor, direction, t| {
            let Some(mesh) = mesh_of(self.surface(anchor.shape.0)) else { return };
            // More than nine such ends there cannot be in earnest; further ones go by rounding.
            if may_be_border(anchor.point.p, anchor.point.q) && !borders.is_full() {
                borders.extend(BorderPoint::of(mesh, anchor, direction, t));
            }
        };
        for anchor in start {
            note(anchor, ray.direction, 0.0);
        }
        if let Some(anchor) = end {
            note(anchor, -ray.direction, t_max);
        }
    }

    /// The nearest root of a primitive that is not a triangle at 0 < t ≤ `t_max`.
    fn meet(
        &self,
        shape: u32,
        primitive: u32,
        ray: &Ray,
        t_max: f64,
        ends: &Ends,
    ) -> Option<Found> {
        let surface = self.surface(shape);
        let start = ends.start.iter().find(|a| a.shape.0 == shape);
        let end = ends.end.filter(|a| a.shape.0 == shape);
        let counts = |t: f64| {
            t > 0.0
                && t <= t_max
                && (end.is_some() || !ends.near_end(t, t_max, |x| surface.locate(x).is_some()))
        };
        // The roots of a quadric of which ends are known: the sum of both roots is known.
        let roots =
            |roots: Option<[f64; 2]>, other: &dyn Fn(&Point3) -> Option<f64>| match (start, end) {
                (None, None) => roots,
                (Some(a), None) => other(&a.point.x).map(|t| [t; 2]),
                (None, Some(a)) => {
                    other(&a.point.x).map(|t| [t_max + t; 2]).filter(|t| t[0] < t_max)
                }
                (Some(_), Some(_)) => None,
            };
        match surface {
            Surface::Rectangle(_) | Surface::Disk(_) if start.is_some() || end.is_some() => None,
            Surface::Rectangle(s) => s.crossing(ray).filter(|c| counts(c.0)),
            Surface::Disk(s) => s.crossing(ray).filter(|c| counts(c.0)),
            Surface::Sphere(s) => {
                let d = &ray.direction;
                let known = start.is_some() || end.is_some();
                let roots = roots(if known { None } else { s.roots(ray) }, &|x| {
                    Some(s.other_root(x, d)).filter(|t| t.is_finite())
                })?;
                let t = roots.into_iter().find(|&t| counts(t))?;
                Some((t, s.projected(&ray.at(t))?))
            }
            Surface::Cylinder(s) => {
                let known = start.is_some() || end.is_some();
                let roots = roots(if known { None } else { s.roots(ray) }, &|x| {
                    s.other_root(x, &ray.direction)
                })?;
                roots
                    .into_iter()
                    .filter(|&t| counts(t))
                    .find_map(|t| s.between_ends(&ray.at(t), &ray.origin).map(|point| (t, point)))
            }
            Surface::Mesh(m) => meet_patch(m, shape, primitive, ray, t_max, ends),
            Surface::Parametric(s) => {
                // Most rays that leave a shallow mirror cannot meet it again.
                if (start.is_some() || end.is_some()) && s.single_crossing(&ray.direction) != 0 {
                    return None;
                }
                let parameters = |a: &Anchor| (a.point.p, a.point.q);
                let (leaving, arriving) = (start.map(parameters), end.map(parameters));
                s.intersect_leaf_between(primitive as usize, ray, [0.0, t_max], leaving, arriving)
                    .filter(|&(t, ..)| counts(t))
                    .map(|(t, p, q)| (t, s.point(p, q)))
            }
        }
    }
}

fn mesh_of(surface: &Surface) -> Option<&Mesh> {
    match surface {
        Surface::Mesh(m) => Some(m),
        _ => None,
    }
}

/// How many primitives of the hierarchy a surface is.
fn primitive_count(surface: &Surface) -> u32 {
    match surface {
        Surface::Mesh(m) => m.triangles().len() as u32,
        Surface::Parametric(p) => p.leaf_count() as u32,
        _ => 1,
    }
}

/// The box of a primitive [m]; empty for a triangle without area.
fn primitive_bounds(surface: &Surface, primitive: u32) -> Aabb {
    match surface {
        Surface::Mesh(m) if m.area_vector(primitive).norm_squared() > 0.0 => {
            m.triangle_bounds(primitive)
        }
        Surface::Mesh(_) => Aabb::EMPTY,
        Surface::Parametric(p) => p.leaf_bounds(primitive as usize),
        s => s.bounds(),
    }
}
