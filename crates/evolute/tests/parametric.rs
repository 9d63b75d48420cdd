//! Parametric surfaces: derivatives, bounds, parameters of points, singular points, area, and ray hits
//! against a brute-force search that shares nothing with them but the formulas' values.
#![allow(clippy::print_stderr, clippy::unwrap_used)]

use evolute::formula::Formula;
use evolute::geometry::{Aabb, Point3, Ray, Transform, Vector3};
use evolute::surface::{Cell, Parametric, Surface, SurfaceError};
use evolute::trace::Tracer;

const WAVE: [&str; 3] = ["100*(s-0.5)", "-5*cos(3*pi*(s-0.5))*cos(3*pi*(t-0.5))", "100*(0.5-t)"];
const SADDLE: [&str; 3] = ["2*s-1", "2*t-1", "0.8*((2*s-1)^2-(2*t-1)^2)"];
const MONKEY: [&str; 3] = ["2*s-1", "2*t-1", "(2*s-1)^3-3*(2*s-1)*(2*t-1)^2"];
const SPHERE: [&str; 3] = ["sin(pi*t)*cos(2*pi*s)", "sin(pi*t)*sin(2*pi*s)", "cos(pi*t)"];
const TORUS: [&str; 3] =
    ["(2+0.7*cos(2*pi*t))*cos(2*pi*s)", "(2+0.7*cos(2*pi*t))*sin(2*pi*s)", "0.7*sin(2*pi*t)"];
/// A mirror dish: a paraboloid with rim 1 and depth 1/2, polar parameters (a pole at t = 0).
const DISH: [&str; 3] = ["t*cos(2*pi*s)", "t*sin(2*pi*s)", "0.5*t^2"];
/// An octant of the sphere over the unit square: both sides that meet at s = 0 collapse.
const CORNER: [&str; 3] =
    ["s*cos(pi/2*t)/sqrt(1+s^2)", "s*sin(pi/2*t)/sqrt(1+s^2)", "1/sqrt(1+s^2)"];

fn surface(f: [&str; 3], transform: Transform) -> Parametric {
    build(f, transform).unwrap()
}

fn build(f: [&str; 3], transform: Transform) -> Result<Parametric, SurfaceError> {
    let [x, y, z] = f.map(|f| Formula::parse(f, &["s", "t"], &[]).unwrap());
    Parametric::new(x, y, z, transform, false)
}

/// Turned, stretched and moved.
fn somewhere() -> Transform {
    let turn = Transform::rotation(Vector3::new(1.0, 2.0, -0.5), 0.7).unwrap();
    let stretch = Transform::scaling(Vector3::new(1.5, 0.8, -1.1)).unwrap();
    Transform::translation(Vector3::new(3.0, -20.0, 7.0)).after(&turn.after(&stretch))
}

/// Random numbers that are the same everywhere.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let x = self.0 ^ (self.0 >> 29);
        (x.wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1u64 << 53) as f64
    }
    fn direction(&mut self) -> Vector3 {
        loop {
            let v =
                Vector3::new(self.unit(), self.unit(), self.unit()) * 2.0 - Vector3::repeat(1.0);
            if v.norm_squared() <= 1.0 && v.norm_squared() > 1e-4 {
                return v.normalize();
            }
        }
    }
}

/// All roots of a ray by brute force: positions on a grid, boxes around their samples, and plain
/// quartering of the parameter domain as long as the samples, widened by their own sagging, surround
/// the ray. Uses nothing of the surface but `position`.
struct BruteForce<'p> {
    surface: &'p Parametric,
    /// Boxes around blocks of the grid, finest first; level k has side length `GRID >> k`.
    levels: Vec<Vec<Aabb>>,
}

const GRID: usize = 256;

impl<'p> BruteForce<'p> {
    fn new(surface: &'p Parametric) -> Self {
        let n = 2 * GRID + 1;
        let at = |i: usize, j: usize| {
            surface.position(i as f64 / (n - 1) as f64, j as f64 / (n - 1) as f64)
        };
        let x: Vec<Point3> = (0..n * n).map(|k| at(k % n, k / n)).collect();
        let block = |i: usize, j: usize| {
            let p = |a: usize, b: usize| x[2 * i + a + n * (2 * j + b)];
            let points = (0..9).map(|k| p(k % 3, k / 3));
            let sag = (0..3)
                .flat_map(|k| [[p(0, k), p(1, k), p(2, k)], [p(k, 0), p(k, 1), p(k, 2)]])
                .map(|[a, b, c]| (b - nalgebra::center(&a, &c)).norm())
                .fold(0.0, f64::max);
            Aabb::around(points).grown(2.0 * sag + 1e-12 * surface.size())
        };
        let finest = (0..GRID * GRID).map(|k| block(k % GRID, k / GRID)).collect();
        let mut levels: Vec<Vec<Aabb>> = vec![finest];
        let mut m = GRID;
        while m > 1 {
            let below = &levels[levels.len() - 1];
            let b = |i: usize, j: usize| below[i + m * j];
            let next = (0..m / 2 * (m / 2))
                .map(|k| (2 * (k % (m / 2)), 2 * (k / (m / 2))))
                .map(|(i, j)| {
                    b(i, j).union(&b(i + 1, j)).union(&b(i, j + 1)).union(&b(i + 1, j + 1))
                })
                .collect();
            levels.push(next);
            m /= 2;
        }
        Self { surface, levels }
    }

    /// All roots with τ > 0, in no order, some twice.
    fn roots(&self, ray: &Ray) -> Vec<Root> {
        let mut out = Vec::new();
        let mut waiting = vec![(self.levels.len() - 1, 0, 0)];
        while let Some((level, i, j)) = waiting.pop() {
            let m = GRID >> level;
            if !crosses(&self.levels[level][i + m * j], ray) {
                continue;
            }
            if level > 0 {
                for k in 0..4 {
                    waiting.push((level - 1, 2 * i + k % 2, 2 * j + k / 2));
                }
            } else {
                let h = 0.5 / m as f64;
                let centre = [(2 * i + 1) as f64 * h, (2 * j + 1) as f64 * h];
                self.halve(ray, centre, [h, h], &mut out);
            }
        }
        out
    }

    fn halve(&self, ray: &Ray, c: [f64; 2], h: [f64; 2], out: &mut Vec<Root>) {
        let size = self.surface.size();
        let w = ray.direction.normalize();
        // Never beyond the domain, where formulas need not be defined.
        let x: [Vector3; 9] = std::array::from_fn(|k| {
            let (i, j) = ((k % 3) as f64 - 1.0, (k / 3) as f64 - 1.0);
            let p = [c[0] + h[0] * i, c[1] + h[1] * j].map(|x: f64| x.clamp(0.0, 1.0));
            self.surface.position(p[0], p[1]) - ray.origin
        });
        // Across the ray, one axis near the surface's normal: a grazing ray is told apart best there.
        let n = (x[5] - x[3]).cross(&(x[7] - x[1]));
        let a = (n - w * n.dot(&w)).try_normalize(1e-6 * n.norm());
        let a = a.unwrap_or_else(|| {
            evolute::geometry::tangent_frame(&nalgebra::Unit::new_unchecked(w)).0
        });
        let f = [a, w.cross(&a)].map(|across| x.map(|r| across.dot(&r)));
        let mut bend = 0f64;
        for f in f {
            let g = |i: usize, j: usize| f[i + 3 * j];
            let sag = (0..3)
                .flat_map(|k| [[g(0, k), g(1, k), g(2, k)], [g(k, 0), g(k, 1), g(k, 2)]])
                .chain([[g(0, 0), g(1, 1), g(2, 2)], [g(0, 2), g(1, 1), g(2, 0)]])
                .map(|[a, b, c]| (b - 0.5 * (a + c)).abs())
                .fold(0.0, f64::max);
            let lo = f.iter().copied().fold(f64::INFINITY, f64::min);
            let hi = f.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let slack = sag + 1e-13 * size;
            if lo - slack > 0.0 || hi + slack < 0.0 {
                return;
            }
            bend = bend.max(sag);
        }
        let length = |i: usize, j: usize| (x[i] - x[j]).norm();
        let sides = [length(3, 4) + length(4, 5), length(1, 4) + length(4, 7)];
        let tau = |r: &Vector3| r.dot(&w) / ray.direction.norm();
        // A plane piece of the surface is solved by Cramer's rule, from the samples.
        let [p, q] = f.map(|f| [f[4], 0.5 * (f[5] - f[3]), 0.5 * (f[7] - f[1])]);
        let det = p[1] * q[2] - p[2] * q[1];
        let slope = det.abs() / (0.25 * sides[0] * sides[1]);
        if bend <= 1e-13 * size
            || (bend <= 1e-11 * size && slope > 1e-2)
            || sides[0].max(sides[1]) < 1e-10 * size
        {
            let u = [(p[2] * q[0] - p[0] * q[2]) / det, (p[0] * q[1] - p[1] * q[0]) / det];
            let certain = slope > 1e-5;
            if certain && u.iter().any(|u| u.abs() > 1.01) {
                return;
            }
            let u = if certain { u } else { [0.0; 2] };
            let r = x[4] + (x[5] - x[3]) * (0.5 * u[0]) + (x[7] - x[1]) * (0.5 * u[1]);
            if tau(&r) > 0.0 {
                out.push(Root { tau: tau(&r), certain });
            }
        } else {
            // The longer side in space is halved: at a pole one of them is nothing.
            let k = usize::from(sides[1] > sides[0]);
            for sign in [-0.5, 0.5] {
                let (mut c, mut g) = (c, h);
                c[k] += sign * h[k];
                g[k] *= 0.5;
                self.halve(ray, c, g, out);
            }
        }
    }
}

/// What the brute-force search finds: where, and whether the crossing is certain or the ray tangent to
/// within the search's resolution.
#[derive(Clone, Copy, Debug)]
struct Root {
    tau: f64,
    certain: bool,
}

/// Slab test of the line beyond the origin.
fn crosses(b: &Aabb, ray: &Ray) -> bool {
    let (mut near, mut far) = (0f64, f64::INFINITY);
    for i in 0..3 {
        let (o, d) = (ray.origin[i], ray.direction[i]);
        if d == 0.0 {
            if o < b.min[i] || o > b.max[i] {
                return false;
            }
            continue;
        }
        let (x, y) = ((b.min[i] - o) / d, (b.max[i] - o) / d);
        near = near.max(x.min(y));
        far = far.min(x.max(y));
    }
    near <= far * (1.0 + 1e-12)
}

/// A ray to test with, and where on the surface it starts.
fn random_ray(p: &Parametric, r: &mut Random, kind: u32) -> (Ray, Option<(f64, f64)>) {
    let b = p.bounds();
    match kind % 10 {
        // Grazing: along a tangent, off it by a small angle and a small height.
        0 => loop {
            let (s, t) = (r.unit(), r.unit());
            let Some(l) = p.local(s, t) else { continue };
            let (u, v) = evolute::geometry::tangent_frame(&l.n);
            let phi = std::f64::consts::TAU * r.unit();
            let angle = 10f64.powf(-6.0 * r.unit()) * if r.unit() < 0.5 { -1.0 } else { 1.0 };
            let d = (u * phi.cos() + v * phi.sin() + l.n.into_inner() * angle).normalize();
            let height = p.size() * 10f64.powf(-3.0 - 6.0 * r.unit());
            let x = l.x + l.n.into_inner() * if r.unit() < 0.5 { height } else { -height };
            break (Ray::new(x - d * (p.size() * r.unit()), d * (0.5 + r.unit())), None);
        },
        // From the surface itself, now and then from its border or its corner.
        1 => {
            let mut side = || match (r.unit() * 10.0) as u32 {
                0 => 0.0,
                1 => 1.0,
                _ => r.unit(),
            };
            let (s, t) = (side(), side());
            let x = p.position(s, t);
            let d = match p.local(s, t).filter(|_| r.unit() < 0.5) {
                Some(l) => {
                    let (u, v) = evolute::geometry::tangent_frame(&l.n);
                    let phi = std::f64::consts::TAU * r.unit();
                    let angle =
                        10f64.powf(-4.0 * r.unit()) * if r.unit() < 0.5 { -1.0 } else { 1.0 };
                    u * phi.cos() + v * phi.sin() + l.n.into_inner() * angle
                }
                None => r.direction(),
            };
            (Ray::new(x, d), Some((s, t)))
        }
        _ => {
            let o = b.centre() + r.direction() * p.size();
            let at = Vector3::new(r.unit(), r.unit(), r.unit());
            (Ray::new(o, b.min + b.extent().component_mul(&at) - o), None)
        }
    }
}

/// What a comparison found.
#[derive(Default)]
struct Tally {
    hits: u32,
    /// Rays tangent to within the brute-force search's resolution.
    tangent: u32,
    worst_residual: f64,
    disagreements: Vec<String>,
}

fn compare(name: &str, p: &Parametric, count: u32, seed: u64) -> Tally {
    let brute = BruteForce::new(p);
    let mut r = Random(seed);
    let mut tally = Tally::default();
    for k in 0..count {
        let (ray, start) = random_ray(p, &mut r, k);
        let length = ray.direction.norm();
        let found = p.intersect(&ray, 0.0, f64::INFINITY, start);
        // The start itself: what lies within rounding of it, which near a tangent reaches further.
        let own = |tau: f64| {
            start.is_some_and(|(s, t)| {
                let n = p.local(s, t).map_or(1.0, |l| l.n.dot(&ray.direction).abs() / length);
                tau * length <= 1e-10 * p.size() / n.max(1e-5)
            })
        };
        let mut roots = brute.roots(&ray);
        roots.retain(|q| !own(q.tau));
        roots.sort_by(|a, b| a.tau.total_cmp(&b.tau));
        let near = |a: f64, b: f64, share: f64| (a - b).abs() * length <= share * p.size();
        let first = roots.iter().find(|q| q.certain);
        let before = |q: &&Root| first.is_none_or(|f| q.tau < f.tau);
        let mut tangents = roots.iter().filter(|q| !q.certain).filter(before);
        let same = match (found, first) {
            (None, None) => true,
            (Some((a, ..)), Some(b)) => near(a, b.tau, 1e-7),
            _ => false,
        };
        // Where the search saw a tangent first, that may be a hit or not.
        let touching = !same
            && match found {
                Some((a, ..)) => tangents.any(|q| near(a, q.tau, 1e-4)),
                None => first.is_none() && tangents.next().is_some(),
            };
        tally.hits += u32::from(found.is_some());
        tally.tangent += u32::from(touching);
        let residual =
            found.map_or(0.0, |(tau, s, t)| (p.position(s, t) - ray.at(tau)).norm() / p.size());
        tally.worst_residual = tally.worst_residual.max(residual);
        if !(same || touching) {
            tally.disagreements.push(format!(
                "{name} ray {k}: {ray:?} from {start:?}: {found:?} (residual {residual:.1e}), brute \
                 force {first:?}"
            ));
        }
    }
    tally
}

const SURFACES: [(&str, [&str; 3]); 7] = [
    ("wave", WAVE),
    ("saddle", SADDLE),
    ("monkey saddle", MONKEY),
    ("sphere", SPHERE),
    ("torus", TORUS),
    ("dish", DISH),
    ("corner", CORNER),
];

/// Rays against a surface as it is and turned, stretched and moved; panics with a list of all
/// disagreements.
fn no_ray_is_missed(f: [&str; 3], name: &str, rays: u32) {
    let mut all = Vec::new();
    for (k, transform) in [Transform::identity(), somewhere()].into_iter().enumerate() {
        let p = surface(f, transform);
        let tally = compare(name, &p, rays / 2, 17 + k as u64);
        #[expect(clippy::print_stderr, reason = "the counts of a run by hand")]
        {
            eprintln!(
                "{name}: {} rays, {} hits, {} tangent, worst residual {:.1e} sizes, {} disagree",
                rays / 2,
                tally.hits,
                tally.tangent,
                tally.worst_residual,
                tally.disagreements.len()
            );
        }
        assert!(tally.hits > rays / 8 && tally.tangent <= rays / 1000);
        assert!(tally.worst_residual <= 1e-13);
        all.extend(tally.disagreements);
    }
    assert!(all.is_empty(), "{} disagree:\n{}", all.len(), all.join("\n"));
}

/// 10⁵ rays in all.
mod no_ray_is_missed {
    macro_rules! tests {
        ($($name:ident: $surface:ident,)*) => { $(
            #[test]
            fn $name() {
                super::no_ray_is_missed(super::$surface, stringify!($name), 14_300);
            }
        )* };
    }

    tests! {
        wave: WAVE,
        saddle: SADDLE,
        monkey_saddle: MONKEY,
        sphere: SPHERE,
        torus: TORUS,
        dish: DISH,
        corner: CORNER,
    }
}

/// 10⁶ rays in all.
#[test]
#[ignore = "minutes; run by hand"]
fn no_ray_of_a_million_is_missed() {
    for (name, f) in SURFACES {
        no_ray_is_missed(f, name, 143_000);
    }
}

/// Time this thread has been computing [ns] (Linux).
fn cpu_ns() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|t| t.parse().ok()).unwrap_or(f64::NAN)
}

/// Nearest hits through the tracer, one thread: rays from a sphere around the surface to random points
/// of its box.
#[test]
#[ignore = "a timing, run by hand"]
#[expect(clippy::print_stderr, reason = "the figures of a run by hand")]
fn timing() {
    use evolute::scene::{Material, Scene, Shape, SideMaterial};
    for (name, f) in SURFACES {
        if std::env::var("ONLY").is_ok_and(|only| only != name) {
            continue;
        }
        let start = cpu_ns();
        let p = surface(f, Transform::identity());
        let build = cpu_ns() - start;
        let (b, leaves) = (p.bounds(), p.leaf_count());
        let black = SideMaterial::default();
        let shape = Shape {
            id: name.into(),
            surface: Surface::Parametric(p.clone()),
            material: Material { front: black, back: black, dielectric: None },
            radiance: Default::default(),
        };
        let scene =
            Scene { name: name.into(), shapes: vec![shape], sensors: vec![], max_depth: None };
        let tracer = Tracer::new(&scene);
        let mut r = Random(1);
        let count = std::env::var("COUNT").map_or(400_000, |c| c.parse().unwrap());
        let rays: Vec<Ray> = (0..count)
            .map(|_| {
                let o = b.centre() + r.direction() * p.size();
                let at = Vector3::new(r.unit(), r.unit(), r.unit());
                Ray::new(o, b.min + b.extent().component_mul(&at) - o)
            })
            .collect();
        let start = cpu_ns();
        let hits = rays.iter().filter(|r| tracer.nearest(r, f64::INFINITY, &[]).is_some()).count();
        let each = (cpu_ns() - start) / f64::from(count);
        let start = cpu_ns();
        let mut sum = 0.0;
        for ray in &rays {
            sum += p.jet(ray.origin.x.fract().abs(), ray.origin.y.fract().abs()).xuu.x;
        }
        let jet = (cpu_ns() - start) / f64::from(count);
        eprintln!(
            "{name}: {leaves} leaves in {:.0} ms, {each:.0} ns a ray, {:.0} % hit, {jet:.0} ns a jet ({sum:.0})",
            build * 1e-6,
            hits as f64 / f64::from(count) * 100.0
        );
    }
}

#[test]
fn derivatives_agree_with_central_differences() {
    for (name, f) in SURFACES {
        let p = surface(f, somewhere());
        let mut r = Random(3);
        for _ in 0..100 {
            let (s, t) = (0.01 + 0.98 * r.unit(), 0.01 + 0.98 * r.unit());
            let j = p.jet(s, t);
            assert_eq!(j.x, p.position(s, t));
            let h = 1e-4;
            let d = |a: f64, b: f64| p.position(s + a * h, t + b * h).coords;
            let first = [(d(1., 0.) - d(-1., 0.)) / (2. * h), (d(0., 1.) - d(0., -1.)) / (2. * h)];
            let second = [
                (d(1., 0.) - d(0., 0.) * 2. + d(-1., 0.)) / (h * h),
                (d(1., 1.) - d(1., -1.) - d(-1., 1.) + d(-1., -1.)) / (4. * h * h),
                (d(0., 1.) - d(0., 0.) * 2. + d(0., -1.)) / (h * h),
            ];
            // Truncation h²·f⁗, with f⁗ up to (3π)⁴ sizes; rounding ε/h² of coordinates near 50.
            let scale = p.size() * 8e3 * h * h;
            for (a, b) in [(j.xu, first[0]), (j.xv, first[1])] {
                assert!((a - b).norm() <= scale, "{name} at {s}, {t}: {a} {b}");
            }
            for (a, b) in [(j.xuu, second[0]), (j.xuv, second[1]), (j.xvv, second[2])] {
                assert!((a - b).norm() <= scale + 1e-5, "{name} at {s}, {t}: {a} {b}");
            }
        }
    }
}

#[test]
fn bounds_contain_samples_and_are_tight() {
    for (name, f) in SURFACES {
        for transform in [Transform::identity(), somewhere()] {
            let p = surface(f, transform);
            let mut around = Aabb::EMPTY;
            for k in 0..=200 * 201 {
                let (s, t) = (f64::from(k % 201) / 200.0, f64::from(k / 201) / 200.0);
                let x = p.position(s, t.min(1.0));
                assert!(p.bounds().contains(&x), "{name} at {s}, {t}");
                around = around.including(x);
            }
            assert!(p.bounds().diagonal() <= around.diagonal() * 1.01, "{name}");
            let mut r = Random(5);
            let mut covered = 0.0;
            for leaf in 0..p.leaf_count() {
                let (b, c) = (p.leaf_bounds(leaf), p.leaf_cell(leaf).unwrap());
                covered += 4.0 * c.half[0] * c.half[1];
                for _ in 0..5 {
                    let q = [0, 1].map(|k: usize| c.centre[k] + c.half[k] * (2.0 * r.unit() - 1.0));
                    assert!(b.contains(&p.position(q[0], q[1])), "{name} at {q:?}");
                }
            }
            assert!((covered - 1.0).abs() < 1e-12, "{name}: leaves cover {covered}");
            for _ in 0..300 {
                let (a, b, c, d) = (r.unit(), r.unit(), r.unit(), r.unit());
                let cell = Cell::spanning([a.min(b), a.max(b)], [c.min(d), c.max(d)]);
                let bounds = p.bounds_of(cell);
                for _ in 0..10 {
                    let (s, t) = (a + (b - a) * r.unit(), c + (d - c) * r.unit());
                    assert!(bounds.contains(&p.position(s, t)), "{name} in {cell:?}");
                }
            }
        }
    }
}

#[test]
fn points_are_located() {
    for (name, f) in SURFACES {
        for transform in [Transform::identity(), somewhere()] {
            let p = surface(f, transform);
            let mut r = Random(7);
            for k in 0..300 {
                let side = |u: f64| if k % 7 == 0 { u.round() } else { u };
                let (s, t) = (side(r.unit()), r.unit());
                let x = p.position(s, t);
                // Other parameters of the same point (a seam) are right, too.
                let (a, b) = p.locate(&x).unwrap_or_else(|| panic!("{name} at {s}, {t}"));
                assert!((p.position(a, b) - x).norm() <= 1e-13 * (p.size() + x.coords.amax()));
                let n = p.local(s, t).map_or(Vector3::x(), |l| l.n.into_inner());
                assert!(p.locate(&(x + n * (1e-9 * p.size()))).is_none(), "{name} at {s}, {t}");
            }
        }
    }
}

#[test]
fn areas_meet_their_accuracy() {
    let pi = std::f64::consts::PI;
    let dish = 2.0 * pi / 3.0 * (2f64.sqrt().powi(3) - 1.0);
    // The octant's cap: 2π(1 − cos 45°)/4.
    let corner = pi / 2.0 * (1.0 - 0.5f64.sqrt());
    let torus = 4.0 * pi * pi * 2.0 * 0.7;
    for (f, area) in [(SPHERE, 4.0 * pi), (TORUS, torus), (DISH, dish), (CORNER, corner)] {
        let p = surface(f, Transform::identity());
        for accuracy in [1e-2, 1e-4, 1e-6, 1e-8, 1e-10] {
            let got = p.area(accuracy);
            assert!(
                (got - area).abs() <= accuracy * area,
                "{f:?}: {got}, not {area}, at {accuracy}"
            );
        }
    }
}

/// Where the parametrisation is singular normal and curvature are the limits from inside.
#[test]
fn poles_and_collapsed_corners_have_normals() {
    let sphere = surface(SPHERE, Transform::identity());
    for (s, t) in [(0.3, 0.0), (0.0, 0.0), (0.7, 1.0), (0.2, 1e-9), (0.4, 1e-4), (0.5, 0.5)] {
        let l = sphere.local(s, t).unwrap();
        // x_s × x_t points inward.
        let n = -l.x.coords.normalize();
        assert!((l.n.into_inner() - n).norm() < 1e-9, "{s}, {t}: {} {n}", l.n.into_inner());
        let kappa = l.principal_curvatures().kappa;
        assert!(kappa.iter().all(|k| (k - 1.0).abs() < 1e-7), "{s}, {t}: {kappa:?}");
    }
    let dish = surface(DISH, somewhere());
    let (pole, near) = (dish.local(0.1, 0.0).unwrap(), dish.local(0.1, 1e-4).unwrap());
    assert!((pole.n.into_inner() - near.n.into_inner()).norm() < 3e-4);
    assert!((pole.dn_dx - near.dn_dx).norm() < 3e-4);
    let corner = surface(CORNER, Transform::identity());
    for t in [0.0, 0.4, 1.0] {
        let l = corner.local(0.0, t).unwrap();
        assert!((l.n.into_inner() - Vector3::z()).norm() < 1e-9);
        assert!(l.principal_curvatures().kappa.iter().all(|k| (k + 1.0).abs() < 1e-7));
    }
    // A cone's tip has none.
    let cone = surface(["t*cos(2*pi*s)", "t*sin(2*pi*s)", "t"], Transform::identity());
    assert!(cone.local(0.3, 0.0).is_none());
    assert!(cone.local(0.3, 0.5).is_some());
}

#[test]
fn fronts_are_those_of_the_object_frame() {
    let mirror = Transform::scaling(Vector3::new(-1.0, 1.0, 1.0)).unwrap();
    for flip in [false, true] {
        let [x, y, z] = SPHERE.map(|f| Formula::parse(f, &["s", "t"], &[]).unwrap());
        for transform in [Transform::identity(), mirror] {
            let p = Parametric::new(x.clone(), y.clone(), z.clone(), transform, flip).unwrap();
            let l = p.local(0.2, 0.3).unwrap();
            assert_eq!(l.n.dot(&l.x.coords) > 0.0, flip, "inward but for flip");
            let j = p.jet(0.2, 0.3);
            let n = j.area_vector() * p.normal_sign();
            assert!(n.dot(&l.n) > 0.0);
        }
    }
}

#[test]
fn surfaces_that_are_none_are_refused() {
    let error = |x: &str, y: &str, z: &str| match build([x, y, z], Transform::identity()) {
        Err(e) => e.to_string(),
        Ok(p) => panic!("{x}, {y}, {z} passes with bounds {:?}", p.bounds()),
    };
    for (x, y, z) in [
        ("log(s)", "t", "0"),
        ("1/s", "t", "0"),
        ("1/(s-0.5)", "t", "0"),
        ("1/(s-0.3)", "t", "0"),
        ("sqrt(s-0.7)", "t", "s"),
        ("asin(1.5*s)", "t", "s"),
        ("s", "t", "s/s*0"),
        ("exp(1000*s)", "t", "0"),
        ("1/0", "s", "t"),
    ] {
        let e = error(x, y, z);
        assert!(e.contains("defined") || e.contains("bounded"), "{x}, {y}, {z}: {e}");
    }
    for (x, y, z) in [("1", "2", "3"), ("s", "s", "s"), ("s+t", "s+t", "0"), ("1e20+s", "t", "0")] {
        assert!(error(x, y, z).contains("area"), "{x}, {y}, {z}");
    }
    // What only touches the border of a domain is a surface.
    for x in ["sqrt(s)", "sqrt(1-s^2)", "sqrt(1-sin(pi*s)^2)", "abs(s-0.3)", "asin(s)", "s^1.5"] {
        build([x, "t", "s"], Transform::identity()).unwrap();
    }
}

/// A ray that leaves a concave sphere at an angle α to the tangent meets it again at 2 sin α exactly,
/// however small α is; outward it does not meet it again.
#[test]
fn nearly_tangent_rays_meet_again() {
    let p = surface(SPHERE, Transform::identity());
    let mut r = Random(11);
    for k in 0..3_000 {
        let alpha = 10f64.powf(-12.0 * r.unit());
        let (s, t) = (r.unit(), 0.02 + 0.96 * r.unit());
        let x = p.position(s, t);
        let n = nalgebra::Unit::new_normalize(-x.coords);
        let (u, v) = evolute::geometry::tangent_frame(&n);
        let phi = std::f64::consts::TAU * r.unit();
        let d = (u * phi.cos() + v * phi.sin()) * alpha.cos() + n.into_inner() * alpha.sin();
        let hit = p.intersect(&Ray::new(x, d), 0.0, f64::INFINITY, Some((s, t)));
        // The start's and the direction's rounding tilts the tangent by some 10⁻¹⁶.
        let chord = 2.0 * alpha.sin();
        match hit {
            Some((tau, ..)) => assert!(
                (tau - chord).abs() <= 1e-4 * chord + 4e-15,
                "ray {k}, angle {alpha}: {tau}, not {chord}"
            ),
            None => assert!(alpha < 1e-14, "ray {k}, angle {alpha} from {s}, {t}: no hit"),
        }
        let outward = d - n.into_inner() * (2.0 * alpha.sin());
        let hit = p.intersect(&Ray::new(x, outward), 0.0, f64::INFINITY, Some((s, t)));
        assert!(hit.is_none(), "ray {k}, angle -{alpha} from {s}, {t}: {hit:?}");
    }
}

/// Rays that leave a closed surface at its seam or from a pole do not meet it at their start.
#[test]
fn seams_and_poles_are_left() {
    let p = surface(SPHERE, somewhere());
    let centre = somewhere().point(&Point3::origin());
    let mut r = Random(13);
    for k in 0..2_000 {
        let (s, t) = match k % 4 {
            0 => (0.0, r.unit()),
            1 => (1.0, r.unit()),
            2 => (r.unit(), 0.0),
            _ => (r.unit(), 1.0),
        };
        let x = p.position(s, t);
        let inward = Ray::new(x, centre + (p.position(r.unit(), r.unit()) - centre) * 0.5 - x);
        let (tau, a, b) = p.intersect(&inward, 0.0, f64::INFINITY, Some((s, t))).unwrap();
        assert!(tau > 1.0 && (p.position(a, b) - inward.at(tau)).norm() < 1e-13);
        let outward = Ray::new(x, -inward.direction);
        let hit = p.intersect(&outward, 0.0, f64::INFINITY, Some((s, t)));
        assert!(hit.is_none(), "{s}, {t}: {hit:?}");
    }
}

/// Between two points of a surface: nothing on a sphere's chords, however short or long, from pole to
/// pole and along the seam; elsewhere what brute force finds.
#[test]
fn chords_meet_nothing_but_what_lies_between() {
    for (name, f) in SURFACES {
        for transform in [Transform::identity(), somewhere()] {
            let p = surface(f, transform);
            let brute = BruteForce::new(&p);
            let mut r = Random(29);
            let mut between = 0;
            for k in 0..600 {
                let (a, b) = loop {
                    // From and to the border too; but the wave's borders at s = 0 and 1 are straight
                    // lines, which chords run along.
                    let side = |u: f64| if k % 5 == 0 && f != WAVE { u.round() } else { u };
                    let a = (side(r.unit()), r.unit());
                    let step = 10f64.powf(-5.0 * r.unit());
                    let at = |x: f64, u: f64| (x + step * (2.0 * u - 1.0)).clamp(0.0, 1.0);
                    let b = (at(a.0, r.unit()), side(at(a.1, r.unit())));
                    if (p.position(a.0, a.1) - p.position(b.0, b.1)).norm() > 1e-6 * p.size() {
                        break (a, b);
                    }
                };
                let (x, y) = (p.position(a.0, a.1), p.position(b.0, b.1));
                let ray = Ray::new(x, y - x);
                let found = (0..p.leaf_count())
                    .filter_map(|i| p.intersect_leaf_between(i, &ray, [0.0, 1.0], Some(a), Some(b)))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                // Roots nearer to an end than a thousandth are not told from it by brute force.
                let inner = |tau: f64| tau > 1e-3 && tau < 1.0 - 1e-3;
                let roots = brute.roots(&ray);
                let first = roots.iter().filter(|q| inner(q.tau) && q.certain);
                let first = first.map(|q| q.tau).min_by(f64::total_cmp);
                // What it calls a tangent may be a root.
                let tangent =
                    |tau: f64| roots.iter().any(|q| !q.certain && (q.tau - tau).abs() < 1e-3);
                between += u32::from(first.is_some());
                let same = match (found, first) {
                    (None, None) => true,
                    // What lies nearer to an end counts if it is on the surface.
                    (Some((tau, s, t)), first) => {
                        let off = (p.position(s, t) - ray.at(tau)).norm() / p.size();
                        off < 1e-12
                            && (first.is_some_and(|q| (q - tau).abs() < 1e-6)
                                || !inner(tau)
                                || tangent(tau))
                    }
                    _ => false,
                };
                assert!(same, "{name} from {a:?} to {b:?}: {found:?}, brute force {first:?}");
                assert!(f != SPHERE || found.is_none(), "from {a:?} to {b:?}: {found:?}");
            }
            // Lines meet quadrics twice.
            let quadric = [SADDLE, SPHERE, DISH, CORNER].contains(&f);
            assert_eq!(quadric, between == 0, "{name}: {between}");
        }
    }
}

/// Beyond the border chains go on over the extended surface.
#[test]
fn extended_hits_go_on_beyond_the_border() {
    let p = surface(WAVE, somewhere());
    let mut r = Random(19);
    for _ in 0..500 {
        let (s, t) = (1.6 * r.unit() - 0.3, 1.6 * r.unit() - 0.3);
        let x = p.position(s, t);
        let n = p.local(s, t).unwrap().n.into_inner();
        let d = n + r.direction() * 0.5;
        let ray = Ray::new(x - d * 30.0, d);
        let guess = (s + 0.02 * (r.unit() - 0.5), t + 0.02 * (r.unit() - 0.5));
        let (tau, a, b) = p.extended_hit(&ray, guess).unwrap();
        let off = (p.position(a, b) - ray.at(tau)).norm();
        assert!(off <= 1e-12 * p.size(), "{s} {t} {ray:?}: {tau} {a} {b} {off:e}");
        assert!((a - s).abs() < 1e-9 && (b - t).abs() < 1e-9 && (tau - 30.0).abs() < 1e-9);
    }
    // A ray past everything has no hit near any guess.
    let flat = surface(["s", "t", "0"], Transform::identity());
    let parallel = Ray::new(Point3::new(0.0, 0.0, 1.0), Vector3::x());
    assert!(flat.extended_hit(&parallel, (0.5, 0.5)).is_none());
}

/// Kinks and unbounded derivatives are met, at the ridge and the rim too.
#[test]
fn kinks_are_met() {
    let roof = surface(["s", "t", "0.5-abs(s-0.3)"], Transform::identity());
    let dome = surface(["s", "t", "sqrt(s*(1-s))"], Transform::identity());
    let mut r = Random(23);
    for k in 0..2_000 {
        let (s, t) = (r.unit(), r.unit());
        for (p, s) in
            [(&roof, s), (&roof, 0.3), (&roof, 0.0), (&dome, s), (&dome, 10f64.powf(-12.0 * s))]
        {
            // Steeper than the roof, so that the other side is not met first.
            let tilt = if k % 2 == 0 { 0.0 } else { 0.4 };
            let d = Vector3::new(tilt * (r.unit() - 0.5), tilt * (r.unit() - 0.5), -1.0);
            let ray = Ray::new(p.position(s, t) - d * 2.0, d);
            let (tau, a, b) =
                p.intersect(&ray, 0.0, 9.0, None).unwrap_or_else(|| panic!("{s}, {t}"));
            let off = (p.position(a, b) - ray.at(tau)).norm();
            assert!(off <= 1e-12 * p.size(), "{s} {t} {ray:?}: {tau} {a} {b} {off:e}");
            // The dome's rim is steep: the tilted ray may meet it earlier.
            assert!(tau < 2.0 + 1e-9, "{s}, {t}: {tau}");
            assert!(p.bounds() == dome.bounds() || (tau - 2.0).abs() < 1e-12, "{s}, {t}: {tau}");
        }
    }
}
