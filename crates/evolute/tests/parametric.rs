//! Parametric surfaces: derivatives, bounds, parameters of points, singular points, area, and ray hits
//! against a brute-force search that shares nothing with them but the formulas' values.
#![allow(clippy::print_stderr, clippy::unwrap_used)]

mod brute;

use brute::*;
use evolute::formula::Formula;
use evolute::geometry::{Aabb, Point3, Ray, Transform, Vector3};
use evolute::surface::{Cell, Parametric, Surface};

/// Rays against a surface as it is and turned, stretched and moved.
fn no_ray_is_missed(f: [&str; 3], name: &str, rays: usize) {
    for (k, transform) in [Transform::identity(), somewhere()].into_iter().enumerate() {
        let scene = scene_of(vec![Surface::Parametric(surface(f, transform))]);
        let tally = compare(&scene, 17 + k as u64, rays / 2);
        eprintln!(
            "{name}: {} rays, {} grazing, {} starting on the surface, {} hits, {} undecided, worst \
             residual {:.1e}",
            tally.rays,
            tally.grazing,
            tally.starting,
            tally.hits,
            tally.undecided.len(),
            tally.off_ray
        );
        assert!(tally.grazing * 10 >= tally.rays && tally.starting * 10 >= tally.rays);
        assert!(tally.hits > rays / 8, "{}", tally.hits);
        assert!(tally.undecided.len() <= rays / 1000, "{}", tally.undecided.join("\n"));
        assert!(tally.off_ray <= 1e-13);
        let all = tally.disagreements;
        assert!(all.is_empty(), "{} disagree:\n{}", all.len(), all.join("\n"));
    }
}

/// 10⁵ rays in all; 10⁶ of all these surfaces in one scene are an ignored test of `tests/tracer.rs`.
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
            let brute = FormulaGrid::new(&p);
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
                // Roots nearer to an end than a thousandth, or than their own error, are not told from
                // it by brute force.
                let inner = |tau: f64| tau > 1e-3 && tau < 1.0 - 1e-3;
                let roots = brute.roots(&ray);
                let told = |q: &&Root| {
                    let doubt = q.doubt / ray.direction.norm();
                    q.certain && inner(q.t - doubt) && inner(q.t + doubt)
                };
                let first = roots.iter().filter(told);
                let first = first.min_by(|a, b| a.t.total_cmp(&b.t));
                // What it calls a tangent may be a root.
                let tangent =
                    |tau: f64| roots.iter().any(|q| !q.certain && (q.t - tau).abs() < 1e-3);
                between += u32::from(first.is_some());
                let same = match (found, first) {
                    (None, None) => true,
                    // What lies nearer to an end counts if it is on the surface.
                    (Some((tau, s, t)), first) => {
                        let off = (p.position(s, t) - ray.at(tau)).norm() / p.size();
                        off < 1e-12
                            // A root at an inflection is known to rounding over its slope only; the
                            // tracer's as well as the search's.
                            && (first.is_some_and(|q| {
                                (q.t - tau).abs() < 1e-6 + 2.0 * q.doubt / ray.direction.norm()
                            })
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
        let (tau, a, b) = p.extended_hit(&ray, guess, None).unwrap();
        let off = (p.position(a, b) - ray.at(tau)).norm();
        assert!(off <= 1e-12 * p.size(), "{s} {t} {ray:?}: {tau} {a} {b} {off:e}");
        assert!((a - s).abs() < 1e-9 && (b - t).abs() < 1e-9 && (tau - 30.0).abs() < 1e-9);
    }
    // A ray past everything has no hit near any guess.
    let flat = surface(["s", "t", "0"], Transform::identity());
    let parallel = Ray::new(Point3::new(0.0, 0.0, 1.0), Vector3::x());
    assert!(flat.extended_hit(&parallel, (0.5, 0.5), None).is_none());
}

/// Of the two roots of a chord of a paraboloid the one that the ray starts from is not found again, though
/// the guess is close to it: either the other one is, or none.
#[test]
fn a_known_root_is_deflated() {
    let bowl = surface(["s", "t", "((s-0.5)^2+(t-0.5)^2)/4"], Transform::identity());
    let mut r = Random(5);
    let (mut asked, mut found) = (0, 0);
    for _ in 0..500 {
        let (from, to) = ((r.unit(), r.unit()), (r.unit(), r.unit()));
        let (x, y) = (bowl.position(from.0, from.1), bowl.position(to.0, to.1));
        let near = (from.0 + 0.01 * r.unit(), from.1 + 0.01 * r.unit());
        asked += 1;
        if let Some((tau, a, b)) = bowl.extended_hit(&Ray::new(x, y - x), near, Some(from)) {
            let off = (a - to.0).abs().max((b - to.1).abs());
            assert!(off < 1e-8 && (tau - 1.0).abs() < 1e-6, "{from:?} {to:?}: {tau} {a} {b}");
            found += 1;
        }
    }
    // The iteration may give up: 352 of 500 are found.
    assert!(found * 100 > asked * 60, "{found} of {asked}");
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
