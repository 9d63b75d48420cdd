//! Closed forms of optics that traced surfaces must give: design, section 6.

use evolute::geometry::{Point3, Rgb, Transform, UnitVector3, Vector3, math};
use evolute::optics::{
    Chain, CollimatedChain, DielectricBoundary, FactorLaw, Interaction, Vertex, Wavefront,
    reflect_direction, refract_direction,
};
use evolute::surface::{Cylinder, LocalGeometry, Rectangle, Sphere, Surface, SurfacePoint};

use crate::bodies::Random;

fn unit(x: f64, y: f64, z: f64) -> UnitVector3 {
    UnitVector3::new_normalize(Vector3::new(x, y, z))
}

fn sphere(radius: f64) -> Surface {
    Surface::Sphere(Sphere::new(Point3::origin(), radius, Transform::identity(), false).unwrap())
}

fn local(surface: &Surface, x: Point3) -> LocalGeometry {
    surface.local(&SurfacePoint { primitive: 0, p: 0.0, q: 0.0, x }).unwrap()
}

fn mirror(local: LocalGeometry) -> Vertex {
    Vertex {
        local,
        interaction: Interaction::Reflection,
        index_toward_receiver: 1.0,
        index_toward_source: 1.0,
        throughput: Rgb::WHITE,
    }
}

/// E/E₀ on the ray's normal plane, the path `s` after a reflection at incidence `sin_i` on the unit
/// sphere.
fn off_a_sphere(sin_i: f64, s: f64) -> f64 {
    let cos_i = (1.0 - sin_i * sin_i).sqrt();
    let vertex = mirror(local(&sphere(1.0), Point3::new(sin_i, 0.0, cos_i)));
    let light = unit(0.0, 0.0, -1.0);
    let out = reflect_direction(&light, &vertex.local.n);
    let chain = CollimatedChain {
        receiver: vertex.local.x + out.into_inner() * s,
        vertices: &[vertex],
        light,
    };
    let factors = chain.factors(FactorLaw::default()).unwrap();
    assert!((factors.concentration * factors.spread - 1.0).abs() < 1e-13);
    factors.irradiance(Rgb::WHITE, 1.0)[0]
}

#[test]
fn collimated_beam_on_a_convex_sphere() {
    println!("\nconvex sphere, collimated: E/E0 at s = 3");
    for (sin_i, printed) in [(0.0, 0.02040816), (0.6, 0.02028398)] {
        let got = off_a_sphere(sin_i, 3.0);
        let cos_i = (1.0f64 - sin_i * sin_i).sqrt();
        let want = 1.0 / ((1.0 + 6.0 / cos_i) * (1.0 + 6.0 * cos_i));
        println!("  sin i = {sin_i}: {got:.10}, closed form {want:.10}");
        assert!((got - want).abs() < 1e-9 * want);
        assert!((got - printed).abs() < 5e-9);
    }
}

#[test]
fn point_lamp_over_flat_water() {
    // E ∝ T/(h + d/n)² on axis.
    let (h, d, n) = (2.0, 3.0, 4.0 / 3.0);
    let water = Surface::Rectangle(Rectangle::new(Transform::identity(), false).unwrap());
    let (_, t) = DielectricBoundary { n1: 1.0, n2: n }.split(1.0);
    let vertex = Vertex {
        local: local(&water, Point3::origin()),
        interaction: Interaction::Refraction,
        index_toward_receiver: n,
        index_toward_source: 1.0,
        throughput: Rgb::grey(t),
    };
    let chain = Chain {
        receiver: Point3::new(0.0, 0.0, -d),
        vertices: &[vertex],
        source: Point3::new(0.0, 0.0, h),
    };
    let factors = chain.factors(FactorLaw::default()).unwrap();
    let got = factors.path_intensity()[0] / t;
    println!(
        "\nlamp over flat water: {got:.10} T, closed form {:.10} T",
        1.0 / ((h + d / n) * (h + d / n))
    );
    assert!((got - 1.0 / ((h + d / n) * (h + d / n))).abs() < 1e-9);
    assert!((got - 0.05536332).abs() < 5e-9);
    let law = n * n * t;
    assert!((factors.product()[0] - law).abs() < 1e-9 * law);
}

/// The apex at height `z` of a sphere whose centre is at height `z` + `to_centre`.
fn apex(z: f64, to_centre: f64) -> LocalGeometry {
    let at = Transform::translation(Vector3::z() * (z + to_centre));
    let s = Sphere::new(Point3::origin(), to_centre.abs(), at, false).unwrap();
    local(&Surface::Sphere(s), Point3::new(0.0, 0.0, z))
}

#[test]
fn mirror_equation() {
    // 1/s + 1/s' = 2/R, R > 0 for a concave mirror; light runs along −z.
    println!("\nmirror equation");
    for (s, r) in [(3.0, 2.0), (0.4, 2.0), (5.0, -1.5), (1.0, 1.0)] {
        let wave = Wavefront::spherical(unit(0.0, 0.0, -1.0), 1.0).transferred(s);
        let wave = wave.reflected(&apex(0.0, r)).unwrap();
        let want = 1.0 / (2.0 / r - 1.0 / s);
        let [near, far] = wave.focal_distances();
        println!("  s = {s}, R = {r}: s' = {near:.10}, closed form {want:.10}");
        assert!((near / want - 1.0).abs() < 1e-9 && (far / want - 1.0).abs() < 1e-9);
        let [k1, k2] = wave.principal().unwrap().kappa;
        assert!((k1 * want - 1.0).abs() < 1e-9 && (k2 * want - 1.0).abs() < 1e-9);
    }
}

#[test]
fn lens_makers_equation() {
    // 1/f_b = (n−1)[1/R₁ − 1/R₂ + (n−1)d/(nR₁R₂)]/[1 − (n−1)d/(nR₁)], radii positive with the centre
    // on the far side; d = 0 is the thin lens.
    println!("\nlens maker's equation");
    for (n, r1, r2) in [(1.5, 0.5, -0.7), (1.7, -0.3, 0.9), (1.33, 0.2, 0.4)] {
        for d in [0.0, 0.01, 0.1] {
            let [image, other] = Wavefront::plane(unit(0.0, 0.0, -1.0), 1.0)
                .refracted(&apex(0.0, -r1), n)
                .unwrap()
                .transferred(d)
                .refracted(&apex(-d, -r2), 1.0)
                .unwrap()
                .focal_distances();
            let power = (n - 1.0) * (1.0 / r1 - 1.0 / r2 + (n - 1.0) * d / (n * r1 * r2));
            let back = (1.0 - (n - 1.0) * d / (n * r1)) / power;
            println!("  n={n} R1={r1} R2={r2} d={d}: f_b = {image:.10}, closed form {back:.10}");
            assert!((image / back - 1.0).abs() < 1e-9 && (other / back - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn coddington_on_a_sphere() {
    // n'cos²t/t' − n cos²i/t = (n'cos t − n cos i)/R = n'/s' − n/s; reflections with n' = −n.
    let mut r = Random(5);
    let mut worst = 0.0f64;
    for _ in 0..1000 {
        let (n1, n2) = (r.uniform(1.0, 2.0), r.uniform(1.0, 2.0));
        let (radius, source) = (r.scale(0.1, 10.0), r.scale(0.1, 10.0));
        let cos_i = r.uniform(0.05, 1.0);
        let sin_i = (1.0 - cos_i * cos_i).sqrt();
        let at = local(&sphere(radius), Point3::new(0.0, 0.0, radius));
        let d = unit(sin_i, 0.0, -cos_i);
        let wave = Wavefront::spherical(d, n1).transferred(source);
        let mut check = |wave: Wavefront, n2: f64, cos_t: f64| {
            let power = (n2 * cos_t - n1 * cos_i) / radius;
            let tangential = (power - n1 * cos_i * cos_i / source) / (n2 * cos_t * cos_t);
            let sagittal = (power - n1 / source) / n2;
            let p = wave.principal().unwrap();
            let t = p.normal_curvature(&Vector3::y().cross(&wave.direction()));
            let s = p.normal_curvature(&Vector3::y());
            let scale = tangential.abs().max(sagittal.abs()).max(1.0);
            worst = worst.max((t - tangential).abs().max((s - sagittal).abs()) / scale);
        };
        if let Some(f) = refract_direction(&d, &at.n, n1, n2) {
            check(wave.refracted(&at, n2).unwrap(), n2, f.cos_t);
        }
        // Reflection is n' = −n with the light run backwards: then K changes its sign.
        let back = wave.reflected(&at).unwrap();
        let p = back.principal().unwrap();
        let t = p.normal_curvature(&Vector3::y().cross(&back.direction()));
        let s = p.normal_curvature(&Vector3::y());
        let want_t = -2.0 / (radius * cos_i) - 1.0 / source;
        let want_s = -2.0 * cos_i / radius - 1.0 / source;
        worst = worst.max((t - want_t).abs().max((s - want_s).abs()) / want_t.abs());
    }
    println!("\nCoddington, 1000 random incidences: worst {worst:.1e}");
    assert!(worst < 1e-9);
}

#[test]
fn circle_caustic_is_the_nephroid() {
    // Light along −z inside a cylindrical mirror about the y axis: the tangential focus.
    let across = Transform::rotation(Vector3::x(), std::f64::consts::FRAC_PI_2).unwrap();
    let ends = [Point3::new(0.0, 0.0, -1.0), Point3::new(0.0, 0.0, 1.0)];
    let cylinder = Surface::Cylinder(Cylinder::new(ends[0], ends[1], 1.0, across, false).unwrap());
    let light = unit(0.0, 0.0, -1.0);
    for i in 1..=40 {
        let angle = 1.5 * f64::from(i - 20) / 20.0;
        let (sin, cos) = math::sin_cos(angle);
        let at = local(&cylinder, Point3::new(sin, 0.0, -cos));
        let wave = Wavefront::plane(light, 1.0).reflected(&at).unwrap();
        let f = wave.focal_distances();
        assert!(f[1].is_infinite() || f[1].abs() > 1e12);
        let caustic = at.x + wave.direction().into_inner() * f[0];
        // The nephroid with its cusp at half the radius, in the angle of the mirror's point.
        let (s3, c3) = math::sin_cos(3.0 * angle);
        let want = Point3::new((3.0 * sin - s3) / 4.0, 0.0, -(3.0 * cos - c3) / 4.0);
        assert!((caustic - want).norm() < 1e-9, "{angle}: {caustic} {want}");
    }
}

#[test]
fn dish_focus() {
    // Paraboloid z = ρ²/4f, 45° rim, at its focus; the sun a disk of half-angle 4.65 mrad far away.
    // E/E₀ = sin²φ/sin²θ. Integrated over the dish (7) with both factors by wavefronts.
    let (f, rim, theta) = (1.0, std::f64::consts::FRAC_PI_4, 4.65e-3);
    let sin_theta = math::sin(theta);
    let radiance = 1.0 / (std::f64::consts::PI * sin_theta * sin_theta); // for E₀ = 1
    let focus = Point3::new(0.0, 0.0, f);
    // ρ = 2f tan(φ/2); Gauss–Legendre in φ, five points a panel; the azimuth is symmetric.
    let nodes = [0.0, 0.538_469_310_105_683_1, 0.906_179_845_938_664];
    let weights = [0.568_888_888_888_888_9, 0.478_628_670_499_366_47, 0.236_926_885_056_189_08];
    let panels = 8;
    let mut irradiance = 0.0;
    for panel in 0..panels {
        let half = 0.5 * rim / panels as f64;
        let mid = (2 * panel + 1) as f64 * half;
        for k in -2i32..=2 {
            let (node, weight) =
                (nodes[k.unsigned_abs() as usize], weights[k.unsigned_abs() as usize]);
            let phi = mid + half * node * f64::from(k.signum());
            let tan = math::tan(0.5 * phi);
            let rho = 2.0 * f * tan;
            let x = Point3::new(rho, 0.0, rho * rho / (4.0 * f));
            // Normal and its derivatives of the graph z = ρ²/4f in the meridian and across.
            let slope = rho / (2.0 * f);
            let w = (1.0 + slope * slope).sqrt();
            let n = unit(-slope, 0.0, 1.0);
            let meridian = Vector3::new(1.0, 0.0, slope) / w;
            let curvatures = [1.0 / (2.0 * f * w * w * w), 1.0 / (2.0 * f * w)];
            let dn_dx = -(meridian * meridian.transpose() * curvatures[0]
                + Vector3::y() * Vector3::y().transpose() * curvatures[1]);
            let at = LocalGeometry { x, n, ng: n, dn_dx };
            let chain =
                Chain { receiver: focus, vertices: &[mirror(at)], source: x + Vector3::z() * 1e3 };
            let factors = chain.factors(FactorLaw::default()).unwrap();
            let toward = focus - x;
            let r2 = toward.norm_squared();
            let cos1 = toward.z / r2.sqrt(); // the receiver faces down
            let cos2 = toward.dot(&n) / r2.sqrt();
            // dA = 2π ρ w dρ, dρ = f (1 + tan²) dφ.
            let area = std::f64::consts::TAU * rho * w * f * (1.0 + tan * tan);
            let virtual_radiance = radiance * factors.product()[0];
            irradiance += virtual_radiance * cos1 * cos2 / r2 * area * weight * half;
        }
    }
    let sin_rim = math::sin(rim);
    let want = sin_rim * sin_rim / (sin_theta * sin_theta);
    println!("\ndish focus: E/E0 = {irradiance:.4}, closed form {want:.4}");
    assert!((irradiance / want - 1.0).abs() < 1e-9);
    assert!((want - 23124.2).abs() < 0.05);
}
