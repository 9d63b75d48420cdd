//! A slow search for the first surface that a ray meets, to hold the tracer against. It uses neither
//! the tracer's bounds nor its root finding: implicit functions are sampled densely along the ray and
//! their sign changes and minima refined by bisection and golden section; triangles are tested one by
//! one with Plücker coordinates.
#![allow(clippy::unwrap_used, dead_code)]

use evolute::geometry::{Point3, Ray, Rgb, Transform, Vector3};
use evolute::scene::{Material, Scene, Shape, ShapeId, SideMaterial};
use evolute::surface::{Cylinder, Disk, Mesh, Rectangle, Sphere, Surface, SurfacePoint};
use evolute::trace::{Anchor, Tracer};
use std::f64::consts::{PI, TAU};

/// SplitMix64 (Steele, Lea & Flood 2014).
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    pub fn direction(&mut self) -> Vector3 {
        loop {
            let v = Vector3::from_fn(|_, _| self.between(-1.0, 1.0));
            if v.norm_squared() > 1e-4 && v.norm_squared() <= 1.0 {
                return v.normalize();
            }
        }
    }
    pub fn point(&mut self, size: f64) -> Point3 {
        Point3::from(Vector3::from_fn(|_, _| self.between(-size, size)))
    }
}

/// A scene of surfaces only.
pub fn scene_of(surfaces: Vec<Surface>) -> Scene {
    let side = SideMaterial::default();
    let shapes = surfaces
        .into_iter()
        .enumerate()
        .map(|(i, surface)| Shape {
            id: format!("shape {i}"),
            surface,
            material: Material { front: side, back: side, dielectric: None },
            radiance: Rgb::BLACK,
        })
        .collect();
    Scene { name: String::new(), shapes, sensors: vec![], max_depth: None }
}

/// A random motion with a scale, in a cube of half side `spread`.
pub fn motion(r: &mut Random, spread: f64, stretch: Vector3) -> Transform {
    let turn = Transform::rotation(r.direction(), r.between(0.0, 6.0)).unwrap();
    Transform::translation(r.point(spread).coords)
        .after(&turn)
        .after(&Transform::scaling(stretch).unwrap())
}

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

/// A patch by its definition: half-way from the facet to the mean of its point's projections.
fn phong_patch(mesh: &Mesh, triangle: u32, p: f64, q: f64) -> Point3 {
    let indices = mesh.triangles()[triangle as usize];
    let corners = indices.map(|i| mesh.positions()[i as usize]);
    let normals = indices.map(|i| mesh.normals().unwrap()[i as usize].normalize());
    let w = [1.0 - p - q, p, q];
    let flat = corners[0] + (corners[1] - corners[0]) * p + (corners[2] - corners[0]) * q;
    let mut drop = Vector3::zeros();
    for i in 0..3 {
        drop += normals[i] * ((flat - corners[i]).dot(&normals[i]) * w[i]);
    }
    flat - drop * 0.5
}

/// Height of `y` over a patch, and how far inside its triangle the foot is (in weights).
fn height_over_patch(mesh: &Mesh, triangle: u32, y: &Point3) -> (f64, f64) {
    let at = |p: f64, q: f64| phong_patch(mesh, triangle, p, q);
    let (mut p, mut q) = (1.0 / 3.0, 1.0 / 3.0);
    let tangents = |p: f64, q: f64| {
        // Central differences of a quadratic are exact.
        (at(p + 0.5, q) - at(p - 0.5, q), at(p, q + 0.5) - at(p, q - 0.5))
    };
    let (pp, qq, pq) = {
        let x = at(0.0, 0.0);
        let second = |a: Point3, b: Point3| (a - x) + (b - x);
        let cross = at(0.5, 0.5) - at(0.5, -0.5) - (at(-0.5, 0.5) - at(-0.5, -0.5));
        (second(at(1.0, 0.0), at(-1.0, 0.0)), second(at(0.0, 1.0), at(0.0, -1.0)), cross)
    };
    for _ in 0..12 {
        let r = at(p, q) - y;
        let (a, b) = tangents(p, q);
        let (g0, g1) = (a.dot(&r), b.dot(&r));
        let h00 = a.dot(&a) + pp.dot(&r);
        let h01 = a.dot(&b) + pq.dot(&r);
        let h11 = b.dot(&b) + qq.dot(&r);
        let det = h00 * h11 - h01 * h01;
        let (dp, dq) = ((g0 * h11 - g1 * h01) / det, (g1 * h00 - g0 * h01) / det);
        (p, q) = (p - dp, q - dq);
        if dp.abs() + dq.abs() < 1e-15 {
            break;
        }
    }
    let (a, b) = tangents(p, q);
    let n = a.cross(&b).normalize();
    (n.dot(&(y - at(p, q))), p.min(q).min(1.0 - p - q))
}

/// What the slow search says of one surface.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// First root at t > 0, if there is one.
    pub t: Option<f64>,
    /// Whether double precision decides it: false for tangency and borders within 1e-11 of the size.
    pub certain: bool,
}

/// First sign change of `f` at t > 0 whose root satisfies `inside` (a margin: positive inside); at most
/// `t_max`. `size` is the size of f² terms that cancel.
fn search(
    f: &dyn Fn(f64) -> f64,
    inside: &dyn Fn(f64) -> f64,
    t_max: f64,
    on_surface: bool,
    size: f64,
    patch: bool,
) -> Answer {
    // A patch is sampled over its own ball only.
    let samples = if patch { 8 } else { 48 };
    let at = |i: usize| t_max * i as f64 / samples as f64;
    let values: Vec<f64> = (0..=samples).map(|i| f(at(i))).collect();
    let mut certain = true;
    let mut roots = vec![];
    let mut bisect = |mut a: f64, mut b: f64| {
        let sign = f(a) > 0.0;
        for _ in 0..90 {
            let m = 0.5 * (a + b);
            if (f(m) > 0.0) == sign { a = m } else { b = m }
        }
        roots.push(0.5 * (a + b));
    };
    for i in 0..samples {
        let (fa, fb) = (values[i], values[i + 1]);
        let start = i == 0 && on_surface;
        if !start && (fa > 0.0) != (fb > 0.0) {
            bisect(at(i), at(i + 1));
            continue;
        }
        // Two roots in one interval: look for an extremum of the other sign.
        let sign = if fb > 0.0 { 1.0 } else { -1.0 };
        let slope_a = if i == 0 { f64::NEG_INFINITY } else { sign * (fa - values[i - 1]) };
        let slope_b = if i + 1 == samples { f64::INFINITY } else { sign * (values[i + 2] - fb) };
        let bulge =
            slope_a < sign * (fb - fa) + 1e-12 * size && slope_b > sign * (fb - fa) - 1e-12 * size;
        if !bulge && !start {
            continue;
        }
        let (mut a, mut b) = (at(i), at(i + 1));
        for _ in 0..90 {
            let (c, d) =
                (b - 0.618_033_988_749_894_9 * (b - a), a + 0.618_033_988_749_894_9 * (b - a));
            if sign * f(c) < sign * f(d) { b = d } else { a = c }
        }
        let least = 0.5 * (a + b);
        let value = sign * f(least);
        if value < -1e-14 * size {
            if !start {
                bisect(at(i), least);
            }
            bisect(least, at(i + 1));
        } else if value < 1e-14 * size && least < at(i + 1) && (!start || least > 1e-9 * t_max) {
            certain = false;
        }
    }
    roots.sort_by(f64::total_cmp);
    for t in roots {
        let margin = inside(t);
        if margin.abs() < 1e-11 {
            certain = false;
        }
        if margin > 0.0 {
            return Answer { t: Some(t), certain };
        }
    }
    Answer { t: None, certain }
}

/// The first root of one surface; `own` if the ray starts on it.
pub fn first(surface: &Surface, ray: &Ray, t_max: f64, own: Option<u32>) -> Answer {
    let plane =
        |transform: &Transform, centre: Point3, n: Vector3, margin: &dyn Fn(Point3) -> f64| {
            if own.is_some() {
                return Answer { t: None, certain: true };
            }
            let back = transform.inverse();
            let size = (ray.origin - centre).norm() + t_max * ray.direction.norm();
            search(
                &|t| n.dot(&(ray.at(t) - centre)),
                &|t| margin(back.point(&ray.at(t))),
                t_max,
                false,
                size,
                false,
            )
        };
    match surface {
        Surface::Rectangle(s) => {
            plane(s.world_from_object(), s.centre(), s.normal().into_inner(), &|x| {
                1.0 - x.x.abs().max(x.y.abs())
            })
        }
        Surface::Disk(s) => {
            plane(s.world_from_object(), s.centre(), s.normal().into_inner(), &|x| {
                1.0 - x.x * x.x - x.y * x.y
            })
        }
        Surface::Sphere(s) => {
            let (c, r) = (s.centre(), s.radius());
            let f = |t: f64| (ray.at(t) - c).norm() - r;
            search(
                &f,
                &|_| 1.0,
                t_max,
                own.is_some(),
                r + (ray.origin - c).norm() + c.coords.amax(),
                false,
            )
        }
        Surface::Cylinder(s) => {
            let ([a, b], r) = (s.ends(), s.radius());
            let axis = (b - a) / (b - a).norm_squared();
            let f = |t: f64| {
                let x = ray.at(t) - a;
                (x - (b - a) * axis.dot(&x)).norm() - r
            };
            let inside = |t: f64| {
                let h = axis.dot(&(ray.at(t) - a));
                h.min(1.0 - h)
            };
            search(
                &f,
                &inside,
                t_max,
                own.is_some(),
                r + (ray.origin - a).norm() + s.length() + a.coords.amax(),
                false,
            )
        }
        Surface::Mesh(m) if m.is_smooth() => {
            let mut best = Answer { t: None, certain: true };
            for i in 0..m.triangles().len() as u32 {
                let c = m.corners(i);
                let centre = Point3::from((c[0].coords + c[1].coords + c[2].coords) / 3.0);
                let radius = 1.05 * c.iter().map(|x| (x - centre).norm()).fold(0.0, f64::max);
                // The stretch of the ray in a ball around the patch.
                let (o, d) = (ray.origin - centre, ray.direction);
                let middle = -o.dot(&d) / d.norm_squared();
                let past = (o + d * middle).norm_squared();
                if past > radius * radius {
                    continue;
                }
                let half = ((radius * radius - past) / d.norm_squared()).sqrt();
                let (from, to) = ((middle - half).max(0.0), (middle + half).min(t_max));
                if to <= from {
                    continue;
                }
                let f = |t: f64| height_over_patch(m, i, &ray.at(from + t)).0;
                let inside = |t: f64| height_over_patch(m, i, &ray.at(from + t)).1 + 1e-10;
                let start = own == Some(i) && from == 0.0;
                let size = radius + c[0].coords.amax();
                let answer = search(&f, &inside, to - from, start, size, true);
                best.certain &= answer.certain;
                if let Some(t) = answer.t.map(|t| from + t) {
                    // A border is another patch's too.
                    best.certain &= inside(t - from).abs() > 2e-10;
                    if best.t.is_none_or(|b| t < b) {
                        best.t = Some(t);
                    }
                }
            }
            best
        }
        Surface::Mesh(m) => {
            let d = ray.direction;
            let mut best = Answer { t: None, certain: true };
            for i in (0..m.triangles().len() as u32).filter(|&i| own != Some(i)) {
                let [a, b, c] = m.corners(i).map(|x| x - ray.origin);
                // Volumes of the tetrahedra spanned by the ray and each edge.
                let v = [d.dot(&b.cross(&c)), d.dot(&c.cross(&a)), d.dot(&a.cross(&b))];
                let scale = d.norm()
                    * a.norm().max(b.norm()).max(c.norm())
                    * (b - a).norm().max((c - a).norm());
                if v.iter().any(|x| *x > 1e-13 * scale) && v.iter().any(|x| *x < -1e-13 * scale) {
                    continue;
                }
                let n = (b - a).cross(&(c - a));
                let t = n.dot(&a) / n.dot(&d);
                if !(t > 0.0 && t <= t_max) {
                    continue;
                }
                let near_edge = v.iter().any(|x| x.abs() < 1e-13 * scale);
                // On a closed mesh one of two neighbours takes a ray on their edge, so that t is known.
                if best.t.is_none_or(|b| t < b) {
                    best = Answer { t: Some(t), certain: !near_edge && t > 1e-12 };
                }
            }
            best
        }
        #[allow(unreachable_patterns)]
        _ => panic!("no slow search for this surface"),
    }
}

/// Distance of a point from its surface by the surface's equation [m].
pub fn residual(surface: &Surface, point: &SurfacePoint) -> f64 {
    let x = &point.x;
    match surface {
        Surface::Rectangle(s) => s.normal().dot(&(x - s.centre())).abs(),
        Surface::Disk(s) => s.normal().dot(&(x - s.centre())).abs(),
        Surface::Sphere(s) => s.distance(x),
        Surface::Cylinder(s) => s.distance(x),
        Surface::Mesh(m) if m.is_smooth() => {
            (x - phong_patch(m, point.primitive, point.p, point.q)).norm()
        }
        Surface::Mesh(m) => {
            let n = m.area_vector(point.primitive).normalize();
            n.dot(&(x - m.corners(point.primitive)[0])).abs()
        }
        Surface::Parametric(p) => (x - p.position(point.p, point.q)).norm(),
    }
}

/// What a comparison found.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    pub rays: usize,
    pub hits: usize,
    /// Rays that double precision cannot decide (tangent to 1e-14 of the coordinates, or on a border
    /// to 1e-11 of the surface) and that are therefore not compared.
    pub undecided: usize,
    /// All others on which the two differ.
    pub disagreements: Vec<String>,
    /// Largest distance of a reported point from the ray, over the size of the coordinates.
    pub off_ray: f64,
    /// Largest residual of a reported point in its surface's equation, over the same.
    pub off_surface: f64,
}

/// Sends `count` rays at a scene: 10 % graze a surface, 10 % start on one.
pub fn compare(scene: &Scene, seed: u64, count: usize) -> Tally {
    let tracer = Tracer::new(scene);
    let bounds = tracer.bounds();
    let (centre, size) = (bounds.centre(), bounds.diagonal());
    let mut r = Random(seed);
    let mut tally = Tally::default();
    for i in 0..count {
        let shape = ShapeId((r.next() % scene.shapes.len() as u64) as u32);
        let surface = &scene.shape(shape).surface;
        // A point of the surface and the geometry there.
        let point = match surface {
            Surface::Mesh(m) => {
                let (p, q) = (r.unit(), r.unit());
                let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
                m.at((r.next() % m.triangles().len() as u64) as u32, p, q)
            }
            s => s.point(r.unit(), r.unit()).unwrap(),
        };
        let Some(local) = surface.local(&point) else { continue };
        let speed = if r.unit() < 0.5 { 1.0 } else { 10f64.powf(r.between(-3.0, 3.0)) };
        let mut start: Vec<Anchor> = vec![];
        let ray = match i % 10 {
            0 => {
                // Grazes: nearly tangent at the point, from a distance.
                let d = local.ng.cross(&r.direction()).normalize();
                let tilt =
                    10f64.powf(r.between(-6.0, -1.0)) * if r.unit() < 0.5 { -1.0 } else { 1.0 };
                let d = d + local.ng.into_inner() * tilt;
                Ray::new(point.x - d * (size * r.between(0.05, 0.6)), d * speed)
            }
            1 => {
                start.push(Anchor { shape, point });
                let mut d = r.direction();
                if r.unit() < 0.3 {
                    d -= local.ng.into_inner() * (d.dot(&local.ng) * r.between(0.99, 1.0));
                }
                Ray::new(point.x, d * speed)
            }
            2..=4 => {
                // From a distance to a point of the surface.
                let d = r.direction();
                Ray::new(point.x + d * (size * r.between(0.1, 0.7)), -d * speed)
            }
            _ => {
                let o = centre + r.point(1.0).coords.component_mul(&bounds.extent()) * 0.6;
                Ray::new(o, r.direction() * speed)
            }
        };
        let reach = 2.5 * size / ray.direction.norm();
        let mut slow: Option<(f64, usize)> = None;
        let mut certain = true;
        for (j, other) in scene.shapes.iter().enumerate() {
            let own = start.first().filter(|a| a.shape.0 as usize == j).map(|a| a.point.primitive);
            let answer = first(&other.surface, &ray, reach, own);
            certain &= answer.certain;
            if let Some(t) = answer.t.filter(|&t| slow.is_none_or(|s| t < s.0)) {
                slow = Some((t, j));
            }
        }
        let fast = tracer.nearest(&ray, reach, &start);
        tally.rays += 1;
        let coordinates = centre.coords.amax() + size;
        let agrees = match (slow, &fast) {
            (None, None) => true,
            (Some((t, _)), Some(hit)) => {
                tally.hits += 1;
                let surface = &scene.shape(hit.anchor.shape).surface;
                let x = hit.anchor.point.x;
                tally.off_ray = tally.off_ray.max((x - ray.at(hit.t)).norm() / coordinates);
                tally.off_surface =
                    tally.off_surface.max(residual(surface, &hit.anchor.point) / coordinates);
                let slope = surface
                    .local(&hit.anchor.point)
                    .map_or(0.0, |l| l.ng.dot(&ray.direction.normalize()).abs());
                // A root is known to the rounding of coordinates over the slope.
                let bound = (1e-12 * coordinates / slope).min(1e-5 * size) / ray.direction.norm();
                (t - hit.t).abs() <= bound
            }
            _ => false,
        };
        // Occlusion agrees with the nearest hit, before it and beyond it.
        if let (Some(hit), true) = (&fast, certain) {
            let beyond = tracer.occluded(&ray, (hit.t * 1.001).min(reach), &start, None);
            let end = tracer.occluded(&ray, hit.t, &start, Some(&hit.anchor));
            if hit.t * 1.001 < reach && !beyond || end {
                tally
                    .disagreements
                    .push(format!("occlusion: ray {i}: {ray:?} {hit:?} {beyond} {end}"));
            }
        }
        if !certain {
            tally.undecided += 1;
        } else if !agrees {
            tally
                .disagreements
                .push(format!("ray {i}: {ray:?} slow {slow:?} fast {fast:?} start {start:?}"));
        }
    }
    tally
}

/// Scenes of one kind of surface each, under motions with the given scale and shift of the whole.
pub fn scenes(seed: u64, scale: f64, shift: Vector3) -> Vec<(&'static str, Scene)> {
    let mut r = Random(seed);
    let whole =
        Transform::translation(shift).after(&Transform::scaling(Vector3::repeat(scale)).unwrap());
    let mut many = |make: &mut dyn FnMut(&mut Random, &Transform) -> Surface, stretch: bool| {
        let surfaces = (0..6)
            .map(|_| {
                let s = if stretch {
                    Vector3::from_fn(|_, _| r.between(0.2, 2.0))
                } else {
                    Vector3::repeat(r.between(0.5, 1.5))
                };
                let m = motion(&mut r, 3.0, s);
                make(&mut r, &whole.after(&m))
            })
            .collect();
        scene_of(surfaces)
    };
    let up = Vector3::z();
    vec![
        (
            "rectangle",
            many(&mut |_, m| Surface::Rectangle(Rectangle::new(*m, false).unwrap()), true),
        ),
        ("disk", many(&mut |_, m| Surface::Disk(Disk::new(*m, false).unwrap()), true)),
        (
            "sphere",
            many(
                &mut |_, m| Surface::Sphere(Sphere::new(Point3::origin(), 1.0, *m, false).unwrap()),
                false,
            ),
        ),
        (
            "cylinder",
            many(
                &mut |r, m| {
                    let top = Point3::from(up * r.between(0.2, 3.0));
                    Surface::Cylinder(
                        Cylinder::new(Point3::origin(), top, r.between(0.1, 1.0), *m, false)
                            .unwrap(),
                    )
                },
                false,
            ),
        ),
        ("mesh", many(&mut |r, m| Surface::Mesh(bumpy_ball(r, 8, m)), true)),
        (
            "smooth mesh",
            // Gently uneven: no edge turns by the 60° of a crease, which the slow search knows not.
            many(
                &mut |_, m| {
                    let uneven = Transform::scaling(Vector3::new(1.0, 0.8, 0.6)).unwrap();
                    Surface::Mesh(smooth_ball(12, &m.after(&uneven)))
                },
                false,
            ),
        ),
        ("cube", many(&mut |_, m| Surface::Mesh(Mesh::cube(*m, false).unwrap()), true)),
    ]
}
