//! Million rays per second of the tracer, one thread: `cargo bench -p evolute --bench tracer`.
//!
//! With `-- --write FOLDER` the mesh and its rays are also written there as little-endian numbers, for
//! `bench/embree`. `-- --rounds N` repeats each measurement and prints the fastest;
//! `-- --only nearest` measures one kind of ray, `-- --scene curved` one scene; `-- --formulas` measures
//! parametric surfaces one by one, too.
#![allow(clippy::unwrap_used, clippy::print_stdout, clippy::print_stderr, dead_code)]

#[path = "../tests/brute/mod.rs"]
mod brute;

use brute::{DISH, Random, SADDLE, SURFACES, WAVE, motion, scene_of, surface};
use evolute::geometry::{Point3, Ray, Transform, Vector3};
use evolute::scene::{Scene, ShapeId};
use evolute::surface::{Cylinder, Mesh, Parametric, Rectangle, Sphere, Surface};
use evolute::trace::{Anchor, Tracer};
use std::io::Write as _;
use std::time::Instant;

const RAYS: usize = 1_000_000;

/// z = 1.2 (sin 2.1x + cos 1.9y + ½ sin 5(x + y)) over [−10, 10]², 500×500 cells of two triangles, in a
/// box of 12 triangles with its top at z = 8: as the figures in `dependencies.md` were taken.
fn wavy_mesh() -> Mesh {
    const N: u32 = 500;
    let mut positions = vec![];
    for j in 0..=N {
        for i in 0..=N {
            let at = |k: u32| f64::from(k) / f64::from(N) * 20.0 - 10.0;
            let (x, y) = (at(i), at(j));
            let z = 1.2 * ((2.1 * x).sin() + (1.9 * y).cos() + 0.5 * (5.0 * (x + y)).sin());
            positions.push(Point3::new(x, y, z));
        }
    }
    let mut triangles = vec![];
    for j in 0..N {
        for i in 0..N {
            let a = j * (N + 1) + i;
            triangles.push([a, a + 1, a + N + 2]);
            triangles.push([a, a + N + 2, a + N + 1]);
        }
    }
    let size = Transform::translation(Vector3::new(0.0, 0.0, 2.0))
        .after(&Transform::scaling(Vector3::new(10.5, 10.5, 6.0)).unwrap());
    let cube = Mesh::cube(size, true).unwrap();
    let first = positions.len() as u32;
    positions.extend_from_slice(cube.positions());
    triangles.extend(cube.triangles().iter().map(|t| t.map(|v| v + first)));
    Mesh::new(positions, triangles, None, None).unwrap()
}

struct Workload {
    nearest: Vec<Ray>,
    /// Each with the anchor of its start; to t = 1.
    shadow: Vec<(Ray, Anchor)>,
    coherent: Vec<Ray>,
}

/// Random rays from inside the box; segments from the surface to random points of the plane z = 6;
/// pinhole rays of a 1000×1000 picture.
fn mesh_workload(mesh: &Mesh) -> Workload {
    let mut r = Random(1);
    let nearest = (0..RAYS)
        .map(|_| {
            let o =
                Point3::new(r.between(-10.0, 10.0), r.between(-10.0, 10.0), r.between(-2.0, 7.5));
            Ray::new(o, r.direction())
        })
        .collect();
    let shadow = (0..RAYS)
        .map(|_| {
            let t = (r.next() % 500_000) as u32;
            let point = mesh.at(t, 0.3, 0.4);
            let up = mesh.area_vector(t).normalize();
            let to = Point3::new(r.between(-10.0, 10.0), r.between(-10.0, 10.0), 6.0);
            // Just above the surface, so that the same segments serve tracers without anchors.
            let o = point.x + up * 1e-6;
            (Ray::new(o, to - o), Anchor { shape: ShapeId(0), point })
        })
        .collect();
    let eye = Point3::new(-9.0, -9.0, 7.0);
    let forward = (Point3::new(0.0, 0.0, 0.0) - eye).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let above = right.cross(&forward);
    let coherent = (0..RAYS)
        .map(|i| {
            let (x, y) = ((i % 1000) as f64 / 500.0 - 1.0, (i / 1000) as f64 / 500.0 - 1.0);
            Ray::new(eye, forward + right * (0.7 * x) - above * (0.7 * y))
        })
        .collect();
    Workload { nearest, shadow, coherent }
}

/// 100 spheres, 100 cylinders and 100 parametric patches (a wave, a saddle, a dish by turns) in a room
/// of six rectangles; shadow rays start on each with the same chance.
fn curved_scene() -> Scene {
    let mut r = Random(3);
    let mut surfaces = vec![];
    for i in 0..300 {
        let size = r.between(0.3, 0.8);
        // The wave is a hundred metres wide, the others two.
        let formula = [WAVE, SADDLE, DISH][i / 3 % 3];
        let size = if i % 3 == 2 && formula == WAVE { 0.02 * size } else { size };
        let m = motion(&mut r, 9.0, Vector3::repeat(size));
        surfaces.push(match i % 3 {
            0 => Surface::Sphere(Sphere::new(Point3::origin(), 1.0, m, false).unwrap()),
            1 => {
                let ends = [-1.0, 1.0].map(|z| Point3::new(0.0, 0.0, z));
                Surface::Cylinder(Cylinder::new(ends[0], ends[1], 0.5, m, false).unwrap())
            }
            _ => Surface::Parametric(surface(formula, m)),
        });
    }
    for (axis, sign) in (0..6).map(|i| (i / 2, if i % 2 == 0 { 1.0 } else { -1.0 })) {
        let mut n = Vector3::zeros();
        n[axis] = 10.5 * sign;
        let face = match axis {
            0 => Transform::rotation(Vector3::y(), std::f64::consts::FRAC_PI_2).unwrap(),
            1 => Transform::rotation(Vector3::x(), std::f64::consts::FRAC_PI_2).unwrap(),
            _ => Transform::identity(),
        };
        let m = Transform::translation(n)
            .after(&face)
            .after(&Transform::scaling(Vector3::repeat(10.5)).unwrap());
        surfaces.push(Surface::Rectangle(Rectangle::new(m, false).unwrap()));
    }
    scene_of(surfaces)
}

fn curved_workload(scene: &Scene) -> Workload {
    let mut r = Random(4);
    let nearest = (0..RAYS).map(|_| Ray::new(r.point(10.0), r.direction())).collect();
    let shadow = (0..RAYS)
        .map(|_| {
            let shape = ShapeId((r.next() % scene.shapes.len() as u64) as u32);
            let point = scene.shape(shape).surface.point(r.unit(), r.unit()).unwrap();
            (Ray::new(point.x, r.point(10.0) - point.x), Anchor { shape, point })
        })
        .collect();
    let coherent = (0..RAYS)
        .map(|i| {
            let (x, y) = ((i % 1000) as f64 / 500.0 - 1.0, (i / 1000) as f64 / 500.0 - 1.0);
            Ray::new(Point3::new(-10.0, 0.0, 0.0), Vector3::new(1.0, x, y))
        })
        .collect();
    Workload { nearest, shadow, coherent }
}

/// Processor time of this thread [s], so that other work on the machine counts less; the clock's where
/// the system has no such figure.
fn processor_time() -> f64 {
    static BEGINNING: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .ok()
        .and_then(|s| s.split(' ').next()?.parse::<f64>().ok())
        .map_or_else(|| BEGINNING.elapsed().as_secs_f64(), |ns| ns * 1e-9)
}

/// Mray/s of the fastest of some rounds, and a count that keeps the work from being left out.
fn rate(rounds: usize, rays: usize, mut work: impl FnMut() -> usize) -> (f64, f64) {
    let mut best = f64::INFINITY;
    let mut count = 0;
    for _ in 0..rounds {
        let start = processor_time();
        count = work();
        best = best.min(processor_time() - start);
    }
    (rays as f64 / best / 1e6, count as f64 / rays as f64)
}

fn measure(name: &str, scene: &Scene, work: &Workload, rounds: usize, only: Option<&str>) {
    let start = Instant::now();
    let tracer = Tracer::new(scene);
    println!("{name}: built in {:.2} s", start.elapsed().as_secs_f64());
    let hits = |rays: &[Ray]| {
        rays.iter().filter(|r| tracer.nearest(r, f64::INFINITY, &[]).is_some()).count()
    };
    let report = |what: &str, (rate, share): (f64, f64)| {
        println!("{name}: {what:9} {rate:6.2} Mray/s ({:.1} % hit)", 100.0 * share);
    };
    let wanted = |what: &str| only.is_none_or(|o| o == what);
    if wanted("nearest") {
        report("nearest", rate(rounds, RAYS, || hits(&work.nearest)));
    }
    if wanted("occluded") {
        let blocked =
            |(r, a): &&(Ray, Anchor)| tracer.occluded(r, 1.0, std::slice::from_ref(a), None);
        report("occluded", rate(rounds, RAYS, || work.shadow.iter().filter(blocked).count()));
    }
    if wanted("coherent") {
        report("coherent", rate(rounds, RAYS, || hits(&work.coherent)));
    }
}

/// One parametric surface alone: rays from a sphere around it to random points of its box.
fn formula_workload(p: &Parametric) -> Workload {
    let mut r = Random(1);
    let b = p.bounds();
    let nearest = (0..RAYS)
        .map(|_| {
            let o = b.centre() + r.direction() * p.size();
            let at = Vector3::from_fn(|_, _| r.unit());
            Ray::new(o, b.min + b.extent().component_mul(&at) - o)
        })
        .collect();
    Workload { nearest, shadow: vec![], coherent: vec![] }
}

fn write(folder: &str, mesh: &Mesh, work: &Workload) -> std::io::Result<()> {
    let file =
        |name: &str| std::fs::File::create(format!("{folder}/{name}")).map(std::io::BufWriter::new);
    let mut out = file("vertices.f32")?;
    for p in mesh.positions() {
        p.iter().try_for_each(|c| out.write_all(&(*c as f32).to_le_bytes()))?;
    }
    let mut out = file("triangles.u32")?;
    for t in mesh.triangles() {
        t.iter().try_for_each(|v| out.write_all(&v.to_le_bytes()))?;
    }
    let shadow: Vec<Ray> = work.shadow.iter().map(|s| s.0).collect();
    for (name, rays) in
        [("nearest", &work.nearest), ("occluded", &shadow), ("coherent", &work.coherent)]
    {
        let mut out = file(&format!("{name}.f32"))?;
        for r in rays {
            for c in r.origin.iter().chain(r.direction.iter()) {
                out.write_all(&(*c as f32).to_le_bytes())?;
            }
        }
    }
    Ok(())
}

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let after = |flag: &str| {
        arguments.iter().position(|a| a == flag).and_then(|i| arguments.get(i + 1).cloned())
    };
    let rounds = after("--rounds").and_then(|n| n.parse().ok()).unwrap_or(3);
    let only = after("--only");
    let only = only.as_deref();
    let scene = after("--scene");
    let wanted = |name: &str| scene.as_ref().is_none_or(|s| s == name);
    if wanted("mesh") {
        let mesh = wavy_mesh();
        let work = mesh_workload(&mesh);
        if let Some(folder) = after("--write") {
            write(&folder, &mesh, &work).unwrap();
        }
        measure("mesh", &scene_of(vec![Surface::Mesh(mesh)]), &work, rounds, only);
    }
    if wanted("curved") {
        let scene = curved_scene();
        measure("curved", &scene, &curved_workload(&scene), rounds, only);
    }
    for (name, formula) in SURFACES.iter().filter(|_| arguments.iter().any(|a| a == "--formulas")) {
        let start = processor_time();
        let p = surface(*formula, Transform::identity());
        let milliseconds = 1e3 * (processor_time() - start);
        println!("{name}: {} leaves in {milliseconds:.0} ms", p.leaf_count());
        let work = formula_workload(&p);
        measure(name, &scene_of(vec![Surface::Parametric(p)]), &work, rounds, Some("nearest"));
    }
}
