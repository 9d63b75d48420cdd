//! The tracer against the slow search, ray by ray.

use super::meshes::phong_point;
use super::{Random, Root, Search, Start, bounds_of};
use evolute::geometry::{Aabb, Ray};
use evolute::scene::{Scene, ShapeId};
use evolute::surface::{Surface, SurfacePoint};
use evolute::trace::{Anchor, Hit, Tracer};

/// What a comparison found.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub rays: usize,
    pub hits: usize,
    /// Rays that meet a surface, or pass it with nothing before, at less than a tenth of a radian.
    pub grazing: usize,
    /// Rays that start on a surface.
    pub starting: usize,
    /// Rays that double precision cannot decide: before the first certain root, the search found one
    /// that may be or not. The tracer's answer is held to be one of these all the same.
    pub undecided: Vec<String>,
    /// All rays on which the two differ.
    pub disagreements: Vec<String>,
    /// Largest distance of a reported point from the ray, over the size of the coordinates.
    pub off_ray: f64,
    /// Largest residual of a reported point in its surface's equation, over the same.
    pub off_surface: f64,
}

/// The sine below which a ray is said to graze.
const GRAZING: f64 = 0.1;

/// A ray to test with.
struct Trial {
    ray: Ray,
    start: Option<(Anchor, f64)>,
    /// Ray parameter where it passes the surface that it was made to graze, and that surface.
    grazes: Option<(f64, usize)>,
}

/// Sends `count` rays at a scene, at least 10 % of which graze a surface and 10 % start on one.
pub fn compare(scene: &Scene, seed: u64, count: usize) -> Tally {
    let tracer = Tracer::new(scene);
    let surfaces: Vec<&Surface> = scene.shapes.iter().map(|s| &s.surface).collect();
    let searches: Vec<Search> = surfaces.iter().map(|s| Search::new(s)).collect();
    let bounds = bounds_of(surfaces.iter().copied());
    let size = bounds.diagonal();
    let coordinates = bounds.centre().coords.amax() + size;
    let mut r = Random(seed);
    let mut tally = Tally::default();
    for i in 0..count {
        let trial = trial(scene, &bounds, i, &mut r);
        let ray = &trial.ray;
        let speed = ray.direction.norm();
        let reach = 2.5 * size / speed;
        let start: Vec<Anchor> = trial.start.iter().map(|s| s.0).collect();
        let mut slow: Vec<(Root, usize)> = vec![];
        for (j, search) in searches.iter().enumerate() {
            let own = trial.start.as_ref().filter(|(a, _)| a.shape.0 as usize == j);
            let own =
                own.map(|(a, slope)| Start { point: a.point, slope: *slope, reach: coordinates });
            slow.extend(search.roots(ray, reach, own.as_ref()).into_iter().map(|root| (root, j)));
        }
        slow.sort_by(|a, b| a.0.t.total_cmp(&b.0.t));
        let certain = slow.iter().position(|(root, _)| root.certain);
        slow.truncate(certain.map_or(slow.len(), |k| k + 1));
        let decided = slow.iter().all(|(root, _)| root.certain);

        let fast = tracer.nearest(ray, reach, &start);
        let slope = fast.as_ref().and_then(|h| slope_at(scene, &h.anchor, ray));
        let agrees = match &fast {
            None => certain.is_none(),
            Some(hit) => slow.iter().any(|(root, j)| {
                // A root is known to the rounding of coordinates over the slope.
                let own = (1e-12 * coordinates / slope.unwrap_or(1.0)).min(1e-5 * size);
                *j == hit.anchor.shape.0 as usize
                    && (root.t - hit.t).abs() * speed <= own + root.doubt
            }),
        };
        tally.rays += 1;
        tally.starting += usize::from(trial.start.is_some());
        let passes = trial.grazes.is_some_and(|(t, _)| fast.as_ref().is_none_or(|h| h.t >= t));
        let met = trial.grazes.is_some_and(|(_, shape)| {
            fast.as_ref().is_some_and(|h| h.anchor.shape.0 as usize == shape)
                && slope.is_some_and(|s| s <= GRAZING)
        });
        tally.grazing += usize::from(passes || met);
        let say = || format!("ray {i}: {ray:?} from {start:?}: slow {slow:?} fast {fast:?}");
        if !decided {
            tally.undecided.push(say());
        }
        if !agrees {
            tally.disagreements.push(say());
        }
        let Some(hit) = &fast else { continue };
        tally.hits += 1;
        let x = hit.anchor.point.x;
        tally.off_ray = tally.off_ray.max((x - ray.at(hit.t)).norm() / coordinates);
        let off = residual(&scene.shape(hit.anchor.shape).surface, &hit.anchor.point);
        tally.off_surface = tally.off_surface.max(off / coordinates);
        if decided && agrees {
            // Occlusion agrees with the nearest hit, before it and beyond it.
            let Hit { t, anchor } = hit;
            let beyond = tracer.occluded(ray, (t * 1.001).min(reach), &start, None);
            let before = tracer.occluded(ray, *t, &start, Some(anchor));
            if t * 1.001 < reach && !beyond || before {
                let ends = format!("occluded beyond {beyond}, before {before}");
                tally.disagreements.push(format!("{}: {ends}", say()));
            }
        }
    }
    tally
}

/// Sine of the angle between a ray and the surface at a point.
fn slope_at(scene: &Scene, anchor: &Anchor, ray: &Ray) -> Option<f64> {
    let local = scene.shape(anchor.shape).surface.local(&anchor.point)?;
    Some(local.ng.dot(&ray.direction.normalize()).abs())
}

/// A random point of a surface; with `borders`, one in three on the border, at a seam or in a pole.
fn random_point(surface: &Surface, borders: bool, r: &mut Random) -> SurfacePoint {
    if let Surface::Mesh(m) = surface {
        let (p, q) = (r.unit(), r.unit());
        let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
        return m.at((r.next() % m.triangles().len() as u64) as u32, p, q);
    }
    let mut side = || match (r.unit() * 10.0) as u32 {
        0 if borders => 0.0,
        1 if borders => 1.0,
        _ => r.unit(),
    };
    let (u, v) = (side(), side());
    surface.point(u, v).unwrap()
}

/// The `i`-th ray: of twenty, seven graze (made so; fewer get there unhindered), three start on a surface, three go
/// from somewhere to a point of a surface.
fn trial(scene: &Scene, bounds: &Aabb, i: usize, r: &mut Random) -> Trial {
    let size = bounds.diagonal();
    let shape = (r.next() % scene.shapes.len() as u64) as usize;
    let surface = &scene.shapes[shape].surface;
    let speed = if r.unit() < 0.5 { 1.0 } else { 10f64.powf(r.between(-3.0, 3.0)) };
    let free = |ray: Ray| Trial { ray, start: None, grazes: None };
    match i % 20 {
        0..=6 => {
            // Nearly tangent at a point, through it or a little off.
            let (point, local) = loop {
                let point = random_point(surface, false, r);
                if let Some(local) = surface.local(&point) {
                    break (point, local);
                }
            };
            let n = local.ng.into_inner();
            let sign = if r.unit() < 0.5 { -1.0 } else { 1.0 };
            let tilt = sign * GRAZING * 10f64.powf(r.between(-5.0, 0.0));
            let d = (n.cross(&r.direction()).normalize() + n * tilt).normalize();
            let height = match r.next() % 3 {
                0 => 0.0,
                1 => size * 10f64.powf(r.between(-9.0, -3.0)),
                _ => -size * 10f64.powf(r.between(-9.0, -3.0)),
            };
            let back = size * r.between(0.01, 0.4);
            let ray = Ray::new(point.x + n * height - d * back, d * speed);
            Trial { ray, start: None, grazes: Some((back / speed, shape)) }
        }
        7..=9 => {
            let point = random_point(surface, true, r);
            let mut d = r.direction();
            let local = surface.local(&point);
            // Every other one at a small angle.
            if let Some(local) = local.filter(|_| r.unit() < 0.5) {
                let n = local.ng.into_inner();
                let sign = if r.unit() < 0.5 { -1.0 } else { 1.0 };
                let tilt = sign * 10f64.powf(r.between(-4.0, 0.0));
                d = n.cross(&d).normalize() + n * tilt;
            }
            let slope = local.map_or(1.0, |l| l.ng.dot(&d.normalize()).abs());
            let anchor = Anchor { shape: ShapeId(shape as u32), point };
            let ray = Ray::new(point.x, d.normalize() * speed);
            Trial { ray, start: Some((anchor, slope)), grazes: None }
        }
        10..=12 => {
            let (point, d) = (random_point(surface, false, r), r.direction());
            free(Ray::new(point.x + d * (size * r.between(0.1, 0.7)), -d * speed))
        }
        _ => {
            let o = bounds.centre() + r.point(1.0).coords.component_mul(&bounds.extent()) * 0.6;
            free(Ray::new(o, r.direction() * speed))
        }
    }
}

/// Distance of a point from its surface by the surface's equation [m].
fn residual(surface: &Surface, point: &SurfacePoint) -> f64 {
    let x = &point.x;
    match surface {
        Surface::Rectangle(s) => s.normal().dot(&(x - s.centre())).abs(),
        Surface::Disk(s) => s.normal().dot(&(x - s.centre())).abs(),
        Surface::Sphere(s) => s.distance(x),
        Surface::Cylinder(s) => s.distance(x),
        Surface::Mesh(m) if m.is_smooth() => {
            (x - phong_point(m, point.primitive, point.p, point.q)).norm()
        }
        Surface::Mesh(m) => {
            let n = m.area_vector(point.primitive).normalize();
            n.dot(&(x - m.corners(point.primitive)[0])).abs()
        }
        Surface::Parametric(p) => (x - p.position(point.p, point.q)).norm(),
    }
}
