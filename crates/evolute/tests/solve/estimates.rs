//! Estimated errors of what is read off meshes, against light that is known better: a room with a box and a ball, whose
//! shadows are soft and hard.

use evolute::scene::{Scene, load_str};
use evolute::solve::{Component, Sheet, Solver};
use evolute::surface::ChartPoint;
use evolute::trace::Tracer;
use evolute::transfer::{Components, Receiver, Transfer, TransferSettings};

use crate::{settings, solved};

const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="grey"><bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf></bsdf>
    <bsdf type="twosided" id="dark"><bsdf type="diffuse"><rgb name="reflectance" value="0.2"/></bsdf></bsdf>
    <shape type="cube" id="walls">
        <boolean name="flip_normals" value="true"/>
        <transform name="to_world"><scale x="2" y="1.5" z="1.25"/></transform>
        <ref id="grey"/>
    </shape>
    <shape type="cube" id="box">
        <transform name="to_world">
            <scale x="0.3" y="0.4" z="0.35"/><rotate z="1" angle="25"/><translate x="0.6" y="0.3" z="-0.9"/>
        </transform>
        <ref id="dark"/>
    </shape>
    <shape type="sphere" id="ball">
        <point name="center" x="-0.8" y="-0.2" z="-0.4"/><float name="radius" value="0.3"/>
        <ref id="dark"/>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world">
            <scale x="0.3" y="0.2" z="1"/><rotate x="1" angle="180"/><translate x="0.1" y="-0.2" z="1.2"/>
        </transform>
        <emitter type="area"><rgb name="radiance" value="10"/></emitter>
    </shape>
</scene>"#;

/// A place on a sheet, by its number, with the receiver there.
struct Place {
    sheet: usize,
    site: ChartPoint,
    receiver: Receiver,
}

/// Places on all sheets: more of them where meshes are fine.
fn places(solver: &Solver<'_>, scene: &Scene, count: usize) -> Vec<Place> {
    let solution = solver.solution();
    let meshes = solution.layer(Component::Direct).meshes();
    let triangles = meshes.iter().enumerate().flat_map(|(s, m)| m.triangles().map(move |t| (s, t)));
    let triangles: Vec<(usize, u32)> = triangles.collect();
    let place = |i: usize| {
        let (sheet, t) = triangles[i * triangles.len() / count];
        // Additive recurrence, folded into the triangle.
        let [p, q] = [0.754_877_666, 0.569_840_29].map(|step| (i as f64 * step).fract());
        let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (p, q) };
        let site = meshes[sheet].at(t, [1.0 - p - q, p, q]);
        let Sheet { shape, front, .. } = solution.sheets()[sheet];
        let surface = &scene.shape(shape).surface;
        let point = surface.at_chart(&site);
        let n = surface.local(&point).unwrap().n;
        let receiver = Receiver { position: point.x, normal: if front { n } else { -n } };
        Place { sheet, site, receiver }
    };
    (0..count).map(place).collect()
}

/// What is read, how far that is off, and how far it may be as is estimated, luminances [W/m²].
struct Reading {
    light: f64,
    off: f64,
    estimate: f64,
}

/// Prints and checks readings: the mean error against the mean estimate, and how many are within it.
fn check(what: &str, readings: &[Reading]) {
    let mean =
        |of: fn(&Reading) -> f64| readings.iter().map(of).sum::<f64>() / readings.len() as f64;
    let (light, off, estimate) = (mean(|r| r.light), mean(|r| r.off), mean(|r| r.estimate));
    let within =
        readings.iter().filter(|r| r.off <= r.estimate).count() as f64 / readings.len() as f64;
    println!(
        "{what}: off by {:.3} % of the light, {:.3} % estimated; {:.1} % of {} places within",
        100.0 * off / light,
        100.0 * estimate / light,
        100.0 * within,
        readings.len()
    );
    assert!(off <= estimate);
    assert!(within >= 0.9, "{what}: {within}");
    // Nor is it so wide that it says nothing.
    assert!(estimate <= 8.0 * off, "{what}: {off} {estimate}");
}

#[test]
fn estimates_hold_between_vertices() {
    let scene = load_str("estimates", SCENE, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let solver = solved(&scene, &tracer, &settings(0.02, None));
    let places = places(&solver, &scene, 3000);
    let solution = solver.solution();
    let exact = TransferSettings { relative: 1e-4, ..TransferSettings::default() };
    let transfer = Transfer::new(&scene, &tracer, exact);
    let read = |component: Component, truth: &dyn Fn(&Place) -> f64| -> Vec<Reading> {
        let layer = solution.layer(component);
        let each = places.iter().map(|place| {
            let light = layer.at(place.sheet, &place.site).luminance();
            let off = (light - truth(place)).abs();
            Reading { light, off, estimate: layer.error_at(place.sheet, &place.site) }
        });
        each.collect()
    };
    let direct = |place: &Place| {
        let components = Components { direct: true, specular: false };
        transfer.light(&place.receiver, components).direct.luminance()
    };
    check("direct", &read(Component::Direct, &direct));
    // On meshes of half the size and with a fifth of the error.
    let finer = solved(&scene, &tracer, &settings(0.004, None));
    let indirect = |place: &Place| {
        finer.solution().layer(Component::Indirect).at(place.sheet, &place.site).luminance()
    };
    check("indirect", &read(Component::Indirect, &indirect));
}
