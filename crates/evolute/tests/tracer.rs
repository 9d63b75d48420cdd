//! The tracer against a slow search, at borders, and far from the origin.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod brute;

use brute::{Random, bumpy_ball, compare, motion, scene_of, scenes, smooth_ball};
use evolute::geometry::{Aabb, Point3, Ray, Transform, Vector3};
use evolute::scene::{Scene, ShapeId};
use evolute::surface::{Cylinder, Mesh, Rectangle, Sphere, Surface};
use evolute::trace::{Anchor, Tracer};

/// Sends rays at scenes of one kind of surface each and prints what was found, all disagreements and
/// all rays left open; `undecided` is the share of rays that may be beyond double precision.
fn agree(scenes: &[(&str, Scene)], rays: usize, undecided: f64) {
    let mut wrong = 0;
    for (kind, scene) in scenes {
        let tally = compare(scene, 1, rays);
        println!(
            "{kind}: {} rays, {} grazing, {} starting on the surface, {} hits, {} undecided, \
             {} disagreements, {:.1e} off the ray, {:.1e} off the surface",
            tally.rays,
            tally.grazing,
            tally.starting,
            tally.hits,
            tally.undecided.len(),
            tally.disagreements.len(),
            tally.off_ray,
            tally.off_surface
        );
        tally.undecided.iter().for_each(|d| println!("  undecided: {d}"));
        tally.disagreements.iter().for_each(|d| println!("  disagrees: {d}"));
        wrong += tally.disagreements.len();
        assert_eq!(tally.rays, rays);
        assert!(tally.grazing * 10 >= rays && tally.starting * 10 >= rays, "{kind}");
        assert!(tally.undecided.len() as f64 <= undecided * rays as f64, "{kind}");
        assert!(tally.hits * 5 > rays, "{kind}");
        // Grazing triangles, where t and weights are known worst, decide this one.
        assert!(tally.off_ray < 1e-10, "{kind}");
        assert!(tally.off_surface < 1e-14, "{kind}");
    }
    assert_eq!(wrong, 0, "the disagreements are printed above");
}

#[test]
fn no_ray_is_missed() {
    agree(&scenes(7, 1.0, Vector3::zeros()), 10_000, 0.001);
}

/// 10⁶ rays for each kind of surface: `cases/tracer/README.md`.
mod of_a_million_no_ray_is_missed {
    use super::{Vector3, agree, scenes};

    macro_rules! tests {
        ($($name:ident: $kind:literal,)*) => { $(
            #[test]
            #[ignore = "10⁶ rays of this kind: up to five minutes of one core"]
            fn $name() {
                let mut scenes = scenes(7, 1.0, Vector3::zeros());
                scenes.retain(|(kind, _)| *kind == $kind);
                assert_eq!(scenes.len(), 1);
                agree(&scenes, 1_000_000, 0.0001);
            }
        )* };
    }

    tests! {
        rectangle: "rectangle",
        disk: "disk",
        sphere: "sphere",
        cylinder: "cylinder",
        mesh: "mesh",
        cube: "cube",
        smooth_mesh: "smooth mesh",
        parametric: "parametric",
    }
}

#[test]
fn no_ray_is_missed_far_from_the_origin() {
    // Grazing depths of 1e-12 and 1 m are beyond coordinates of 1,000 m.
    agree(&scenes(7, 1.0, Vector3::new(1000.0, -1000.0, 1000.0)), 3_000, 0.03);
}

#[test]
fn no_ray_is_missed_in_large_and_small_scenes() {
    agree(&scenes(7, 1e6, Vector3::zeros()), 2_000, 0.001);
    agree(&scenes(7, 1e-6, Vector3::zeros()), 2_000, 0.001);
}

fn uneven(r: &mut Random) -> Transform {
    let stretch = Vector3::from_fn(|_, _| r.between(0.5, 2.0));
    motion(r, 100.0, stretch)
}

/// Rays from inside a closed mesh at its vertices and edges, exactly or nearly, never get out.
#[test]
fn closed_meshes_do_not_leak() {
    let mut r = Random(5);
    for i in 0..20 {
        let world = uneven(&mut r);
        let smooth = i % 4 == 0;
        let mesh = if smooth { smooth_ball(12, &world) } else { bumpy_ball(&mut r, 12, &world) };
        let triangles = mesh.triangles().len() as u64;
        let scene = scene_of(vec![Surface::Mesh(mesh.clone())]);
        let tracer = Tracer::new(&scene);
        for i in 0..20_000 {
            let w = match i % 3 {
                0 => 0.0,
                1 => r.unit(),
                _ => 1e-15 * r.unit(),
            };
            let target = mesh.at((r.next() % triangles) as u32, w, 0.0).x;
            let o = world.point(&(r.point(0.2)));
            let ray = Ray::new(o, target - o);
            let hit = tracer.nearest(&ray, f64::INFINITY, &[]).unwrap();
            assert!(hit.t < 1.0 + 1e-9, "{hit:?}");
            assert!(tracer.occluded(&ray, 1.1, &[], None));
        }
    }
}

/// A room of six rectangles that share edges, and a cylinder on its floor: no ray finds a gap.
#[test]
fn rectangles_and_cylinders_that_touch_do_not_leak() {
    let mut r = Random(6);
    for _ in 0..20 {
        let turn = motion(&mut r, 1000.0, Vector3::repeat(1.0));
        let faces: Vec<Surface> = (0..6)
            .map(|i| {
                let mut n = Vector3::zeros();
                n[i / 2] = if i % 2 == 0 { 1.0 } else { -1.0 };
                let face = match i / 2 {
                    0 => Transform::rotation(Vector3::y(), std::f64::consts::FRAC_PI_2).unwrap(),
                    1 => Transform::rotation(Vector3::x(), std::f64::consts::FRAC_PI_2).unwrap(),
                    _ => Transform::identity(),
                };
                let m = turn.after(&Transform::translation(n)).after(&face);
                Surface::Rectangle(Rectangle::new(m, false).unwrap())
            })
            .collect();
        let scene = scene_of(faces);
        let tracer = Tracer::new(&scene);
        for i in 0..10_000 {
            // A point of an edge or a corner.
            let mut edge = Vector3::from_fn(|_, _| if r.unit() < 0.5 { -1.0 } else { 1.0 });
            if i % 4 != 0 {
                edge[i % 3] = r.between(-1.0, 1.0);
            }
            let target = turn.point(&Point3::from(edge));
            let o = turn.point(&r.point(0.9));
            let hit = tracer.nearest(&Ray::new(o, target - o), f64::INFINITY, &[]);
            assert!(hit.is_some_and(|h| h.t < 1.0 + 1e-9), "{hit:?}");
        }
        // Through the rim where a cylinder stands on the floor.
        let floor = Rectangle::new(turn, false).unwrap();
        let top = Point3::new(0.0, 0.0, 1.0);
        let cylinder = Cylinder::new(Point3::origin(), top, 0.5, turn, false).unwrap();
        let scene = scene_of(vec![Surface::Rectangle(floor), Surface::Cylinder(cylinder)]);
        let tracer = Tracer::new(&scene);
        for _ in 0..10_000 {
            let Surface::Cylinder(c) = &scene.shapes[1].surface else { unreachable!() };
            let rim = c.point(r.unit(), 0.0).unwrap().x;
            let o = turn.point(&Point3::new(0.0, 0.0, r.between(0.1, 0.9)));
            let hit = tracer.nearest(&Ray::new(o, rim - o), f64::INFINITY, &[]);
            assert!(hit.is_some_and(|h| h.t < 1.0 + 1e-9), "{hit:?}");
        }
    }
}

/// A point of a mesh's triangle with given weights, as an anchor on shape 0.
fn on(mesh: &Mesh, triangle: u32, p: f64, q: f64) -> Anchor {
    Anchor { shape: ShapeId(0), point: mesh.at(triangle, p, q) }
}

/// Starts on edges and corners of a cube. From outside nothing is met at once, by any direction out of
/// its own face; from inside the neighbouring face blocks at once, and only that.
#[test]
fn starts_on_edges_see_what_a_start_inside_the_triangle_would() {
    let mut r = Random(8);
    let mut blocked = 0;
    for turn in 0..50 {
        let world = uneven(&mut r);
        let size = world.linear().norm();
        let cube = Mesh::cube(world, turn % 2 == 0).unwrap();
        let scene = scene_of(vec![Surface::Mesh(cube.clone())]);
        let tracer = Tracer::new(&scene);
        for _ in 0..400 {
            let triangle = (r.next() % 12) as u32;
            let w = r.unit();
            let (p, q) = match r.next() % 6 {
                0 => (0.0, 0.0),
                1 => (1.0, 0.0),
                2 => (0.0, 1.0),
                3 => (w, 0.0),
                4 => (0.0, w),
                _ => (w, 1.0 - w),
            };
            let start = on(&cube, triangle, p, q);
            // Where a start a little inside would see something: 1e-7 towards the middle.
            let third = 1.0 / 3.0;
            let inside = on(&cube, triangle, p + 1e-7 * (third - p), q + 1e-7 * (third - q));
            let d = world.vector(&r.direction());
            let exact = tracer.nearest(&Ray::new(start.point.x, d), f64::INFINITY, &[start]);
            let near = tracer.nearest(&Ray::new(inside.point.x, d), f64::INFINITY, &[inside]);
            match (&exact, &near) {
                (None, None) => {}
                (Some(a), Some(b)) => {
                    assert!((a.t - b.t).abs() * d.norm() < 1e-4 * size, "{a:?} {b:?} {start:?}");
                    blocked += usize::from(a.t == 0.0);
                    let x = a.anchor.point.x;
                    let again =
                        cube.at(a.anchor.point.primitive, a.anchor.point.p, a.anchor.point.q).x;
                    assert!(
                        (x - again).norm() < 1e-12 * (size + x.coords.norm()),
                        "{a:?} {again} {start:?} {}",
                        (x - again).norm()
                    );
                }
                _ => panic!("{exact:?} {near:?} {start:?}"),
            }
            // The same way back: a shadow ray that ends on the edge.
            let far = start.point.x + d * 3.0;
            let back = Ray::new(far, -d);
            let end = tracer.occluded(&back, 3.0, &[], Some(&start));
            let forth = tracer.nearest(&Ray::new(start.point.x, d), 3.0, &[start]).is_some();
            assert_eq!(end, forth, "{start:?} {d:?}");
        }
    }
    assert!(blocked > 500, "{blocked}");
}

/// A start close to an edge, but not on it, meets a concave neighbour where it is.
#[test]
fn concave_neighbours_are_met_however_close() {
    let positions = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let mesh =
        Mesh::new(positions.map(Point3::from).to_vec(), vec![[0, 2, 1], [0, 1, 3]], None, None)
            .unwrap();
    let scene = scene_of(vec![Surface::Mesh(mesh.clone())]);
    let tracer = Tracer::new(&scene);
    for k in 1..14 {
        let gap = 10f64.powi(-k);
        let start = on(&mesh, 0, gap, 0.3);
        assert_eq!(start.point.x, Point3::new(gap, 0.3, 0.0));
        let ray = Ray::new(start.point.x, Vector3::new(-1.0, 0.1, 1.0));
        let hit = tracer.nearest(&ray, f64::INFINITY, &[start]).unwrap();
        assert!((hit.t - gap).abs() < 1e-15, "{hit:?}");
        assert_eq!(hit.anchor.point.primitive, 1);
        let away = Ray::new(start.point.x, Vector3::new(1.0, 0.1, 1.0));
        assert!(tracer.nearest(&away, f64::INFINITY, &[start]).is_none());
    }
}

/// A lamp flush in a ceiling is seen from below, one behind it is not.
#[test]
fn ends_on_a_coincident_surface_are_seen() {
    let mut r = Random(9);
    for _ in 0..20 {
        let turn = motion(&mut r, 10.0, Vector3::repeat(1.0));
        let at = |z: f64, size: f64| {
            let m = turn
                .after(&Transform::translation(Vector3::new(0.0, 0.0, z)))
                .after(&Transform::scaling(Vector3::repeat(size)).unwrap());
            Surface::Rectangle(Rectangle::new(m, true).unwrap())
        };
        let scene = scene_of(vec![at(0.0, 3.0), at(0.0, 0.3), at(1e-6, 0.3)]);
        let tracer = Tracer::new(&scene);
        for _ in 0..1000 {
            let below = turn.point(&Point3::new(r.unit(), r.unit(), -1.0));
            for (shape, hidden) in [(1, false), (2, true)] {
                let point = scene.shapes[shape].surface.point(r.unit(), r.unit()).unwrap();
                let end = Anchor { shape: ShapeId(shape as u32), point };
                let ray = Ray::new(below, point.x - below);
                assert_eq!(tracer.occluded(&ray, 1.0, &[], Some(&end)), hidden);
            }
        }
    }
}

/// A ray that starts on a sphere or cylinder meets it once more or not at all, however flat it leaves;
/// a shadow ray's end is not its own shadow.
#[test]
fn known_roots_are_divided_out() {
    let mut r = Random(10);
    for _ in 0..50 {
        let m = motion(&mut r, 1000.0, Vector3::repeat(1.0));
        let sphere = Sphere::new(Point3::origin(), 0.5, m, false).unwrap();
        let ends = [-2.0, 2.0].map(|z| Point3::new(0.0, 0.0, z));
        let cylinder = Cylinder::new(ends[0], ends[1], 0.5, m, false).unwrap();
        for surface in [Surface::Sphere(sphere), Surface::Cylinder(cylinder)] {
            let scene = scene_of(vec![surface.clone()]);
            let tracer = Tracer::new(&scene);
            for _ in 0..200 {
                let point = surface.point(r.unit(), r.between(0.4, 0.6)).unwrap();
                let local = surface.local(&point).unwrap();
                let anchor = Anchor { shape: ShapeId(0), point };
                let along = local.n.cross(&m.vector(&Vector3::z())).normalize();
                let slope = 10f64.powf(r.between(-9.0, -0.5));
                let n = local.n.into_inner();
                let out = Ray::new(point.x, along + n * slope);
                assert!(tracer.nearest(&out, f64::INFINITY, &[anchor]).is_none());
                assert!(!tracer.occluded(&out, 10.0, &[anchor], None));
                // A chord: its length is the sine's.
                let within = Ray::new(point.x, (along - n * slope).normalize());
                let hit = tracer.nearest(&within, f64::INFINITY, &[anchor]).unwrap();
                let chord = slope / (1.0 + slope * slope).sqrt();
                assert!((hit.t - chord).abs() < 1e-11 + 1e-12 * chord, "{} {chord}", hit.t);
                assert!(!tracer.occluded(&within, hit.t, &[anchor], Some(&hit.anchor)));
                // From far off to the near side: seen; to the far side: hidden by the near one.
                let far = point.x + (n + along * 0.1) * 5.0;
                let to = Ray::new(far, point.x - far);
                assert!(!tracer.occluded(&to, 1.0, &[], Some(&anchor)));
                let behind = point.x - (n + along * 0.1) * 5.0;
                let to = Ray::new(behind, point.x - behind);
                assert!(tracer.occluded(&to, 1.0, &[], Some(&anchor)));
            }
        }
    }
}

#[test]
fn contacts_and_occluders_are_complete() {
    let mut r = Random(11);
    let world = uneven(&mut r);
    let cube = Mesh::cube(world, false).unwrap();
    let ball = world.point(&Point3::new(1.0, 1.0, 1.0));
    let sphere = Sphere::new(ball - Vector3::new(0.5, 0.0, 0.0), 0.5, Transform::identity(), false);
    let scene = scene_of(vec![Surface::Mesh(cube.clone()), Surface::Sphere(sphere.unwrap())]);
    let tracer = Tracer::new(&scene);
    // The corner: one triangle of the cube, and the sphere.
    let at: Vec<u32> = tracer.contacts(&ball).iter().map(|a| a.shape.0).collect();
    assert_eq!(at, [0, 1]);
    assert!(tracer.contacts(&(ball + Vector3::new(1e-9, 1e-9, 0.0))).is_empty());
    for _ in 0..100 {
        let point = cube.at((r.next() % 12) as u32, 0.3, 0.4);
        let found = tracer.contacts(&point.x);
        assert_eq!((found.len(), found[0].point.primitive), (1, point.primitive));
    }
    let mut found = vec![];
    assert!(tracer.occluders_in(&tracer.bounds(), &mut found, 13));
    assert_eq!(found.len(), 13);
    assert!(found.is_sorted());
    assert!(!tracer.occluders_in(&tracer.bounds(), &mut found, 12));
    let corner = Aabb { min: ball, max: ball }.grown(1e-3);
    assert!(tracer.occluders_in(&corner, &mut found, 13));
    assert!(found.iter().any(|f| f.0 == ShapeId(1)) && found.len() < 13);
}
