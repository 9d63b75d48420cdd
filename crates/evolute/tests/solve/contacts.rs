//! Things that stand on a floor: no light comes under walls and into what is closed, and no dark seams lie along them.

use std::f64::consts::TAU;

use evolute::geometry::{Point3, UnitVector3, Vector3, math};
use evolute::scene::load_str;
use evolute::solve::{Component, Solver, SolverSettings};
use evolute::surface::ChartPoint;
use evolute::trace::Tracer;
use evolute::transfer::{Components, Control, Order, Receiver, Transfer, TransferSettings};

/// A floor [−1, 1]² with a thin wall through a part of it, a turned box, a tin, and a lamp. No edge of theirs lies
/// along the lattice of the first triangles but the wall's.
const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="grey"><bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></bsdf>
    <shape type="rectangle" id="floor"><ref id="grey"/></shape>
    <shape type="rectangle" id="wall">
        <transform name="to_world">
            <scale x="0.4" y="0.3"/><rotate x="1" angle="90"/><translate x="0.25" y="0.4" z="0.3"/>
        </transform>
        <ref id="grey"/>
    </shape>
    <shape type="cube" id="box">
        <transform name="to_world">
            <scale x="0.21" y="0.13" z="0.2"/><rotate z="1" angle="27"/><translate x="-0.4" y="-0.3" z="0.2"/>
        </transform>
        <ref id="grey"/>
    </shape>
    <shape type="cylinder" id="tin">
        <vector name="p0" x="0.45" y="-0.4" z="0"/><vector name="p1" x="0.45" y="-0.4" z="0.3"/>
        <float name="radius" value="0.15"/>
        <ref id="grey"/>
    </shape>
    <shape type="disk" id="lid">
        <transform name="to_world"><scale value="0.15"/><translate x="0.45" y="-0.4" z="0.3"/></transform>
        <ref id="grey"/>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world">
            <scale value="0.05"/><rotate x="1" angle="180"/><translate x="0.1" y="-1.1" z="1.9"/>
        </transform>
        <emitter type="area"><rgb name="radiance" value="100"/></emitter>
    </shape>
</scene>"#;

/// How far from a line light is looked at [m]: nearer than any triangle's middle; and nearer and further off, to tell
/// where a shadow's edge runs beside the line.
const BESIDE: f64 = 4e-3;
const OTHERS: [f64; 2] = [2e-5, 30e-3];

/// Points at a distance outside of all lines, or inside if it is negative; a thin wall has none inside.
fn beside(d: f64) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    let (sin, cos) = math::sin_cos(27f64.to_radians());
    for i in 0..97 {
        let f = (f64::from(i) + 0.5) / 97.0;
        // Where lines end and turn is left out.
        let along = 0.9 * (2.0 * f - 1.0);
        if d > 0.0 {
            let x = 0.25 + 0.4 * along;
            points.extend([[x, 0.4 - d], [x, 0.4 + d]]);
        }
        for side in [-1.0, 1.0] {
            for [u, v] in [[0.21 * along, side * (0.13 + d)], [side * (0.21 + d), 0.13 * along]] {
                points.push([-0.4 + cos * u - sin * v, -0.3 + sin * u + cos * v]);
            }
        }
        let (sin, cos) = math::sin_cos(TAU * f);
        points.push([0.45 + (0.15 + d) * cos, -0.4 + (0.15 + d) * sin]);
    }
    points
}

#[test]
fn no_light_comes_under_walls_and_no_dark_seams_lie_along_them() {
    let scene = load_str("contacts", SCENE, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let relative = 0.03;
    let settings = SolverSettings {
        transfer: TransferSettings { relative, ..TransferSettings::default() },
        edge: Some(0.2),
        ..SolverSettings::default()
    };
    let control = Control { order: &|| Order::Go, progress: &|_, _, _| {} };
    let outcome = Solver::new(&scene, &tracer, &settings, &control).unwrap().into_outcome();
    let solution = &outcome.solution;
    let floor = solution.sheet_of(scene.shape_named("floor").unwrap(), true).unwrap();
    let layer = solution.layer(Component::Direct);
    for component in Component::ALL {
        for mesh in solution.layer(component).meshes() {
            mesh.validate().unwrap();
        }
    }
    let at = |[x, y]: [f64; 2]| {
        let point = scene.shapes[0].surface.locate(&Point3::new(x, y, 0.0)).unwrap();
        let site: ChartPoint = scene.shapes[0].surface.chart_point(&point);
        layer.at(floor, &site).luminance()
    };
    let transfer = Transfer::new(&scene, &tracer, settings.transfer);
    let truth = |[x, y]: [f64; 2]| {
        let receiver = Receiver {
            position: Point3::new(x, y, 0.0),
            normal: UnitVector3::new_unchecked(Vector3::z()),
        };
        let parts = Components { direct: true, specular: false };
        transfer.light_until(&receiver, parts, 0.0, &|| false).direct.luminance()
    };
    let vertices = layer.meshes()[floor].vertices().len();
    let places = beside(BESIDE);
    let most = places.iter().map(|p| truth(*p)).fold(0.0, f64::max);
    let others = OTHERS.map(beside);
    for p in beside(-BESIDE) {
        assert!(at(p) <= 1e-9 * most, "{p:?} inside: {} of {most}", at(p));
    }
    let (mut errors, mut count) = (Vec::new(), 0);
    for (i, place) in places.iter().enumerate() {
        let light = truth(*place);
        if others.iter().all(|o| (light - truth(o[i])).abs() < 0.05 * most) {
            errors.push((at(*place) - light).abs() / most);
            count += 1;
        }
    }
    errors.sort_by(f64::total_cmp);
    let (most_of, worst) = (errors[count * 99 / 100], errors[count - 1]);
    println!(
        "{vertices} vertices; {count} places: 99 % within {most_of:.4} of the brightest, all within {worst:.4}"
    );
    assert!(count > places.len() / 2, "{count}");
    // Some are in one triangle with the edge of a shadow that runs off.
    assert!(most_of < relative, "{most_of}");
}
