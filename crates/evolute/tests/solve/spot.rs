//! A spot of light smaller than the first cells of a hemisphere, in an otherwise dark hall.

use std::f64::consts::PI;

use evolute::geometry::{Point3, UnitVector3, Vector3};
use evolute::scene::load_str;
use evolute::solve::Component;
use evolute::trace::Tracer;
use evolute::transfer::{HemisphereSettings, Receiver};

use crate::{settings, solved};

/// A lamp in a black shaft 1 m above a floor.
const SCENE: &str = r#"<scene version="3.0.0">
    <bsdf type="twosided" id="black"><bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf></bsdf>
    <shape type="rectangle" id="floor">
        <transform name="to_world"><scale value="1"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
    </shape>
    <shape type="rectangle" id="south">
        <transform name="to_world">
            <scale x="0.006" y="0.05"/><rotate x="1" angle="90"/><translate z="0.95"/>
            <translate y="-0.006"/><rotate z="1" angle="0"/><translate x="0.31" y="-0.17"/>
        </transform>
        <ref id="black"/>
    </shape>
    <shape type="rectangle" id="east">
        <transform name="to_world">
            <scale x="0.006" y="0.05"/><rotate x="1" angle="90"/><translate z="0.95"/>
            <translate y="-0.006"/><rotate z="1" angle="90"/><translate x="0.31" y="-0.17"/>
        </transform>
        <ref id="black"/>
    </shape>
    <shape type="rectangle" id="north">
        <transform name="to_world">
            <scale x="0.006" y="0.05"/><rotate x="1" angle="90"/><translate z="0.95"/>
            <translate y="-0.006"/><rotate z="1" angle="180"/><translate x="0.31" y="-0.17"/>
        </transform>
        <ref id="black"/>
    </shape>
    <shape type="rectangle" id="west">
        <transform name="to_world">
            <scale x="0.006" y="0.05"/><rotate x="1" angle="90"/><translate z="0.95"/>
            <translate y="-0.006"/><rotate z="1" angle="270"/><translate x="0.31" y="-0.17"/>
        </transform>
        <ref id="black"/>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world">
            <scale value="0.004"/><rotate x="1" angle="180"/><translate x="0.31" y="-0.17" z="0.9999"/>
        </transform>
        <emitter type="area"><rgb name="radiance" value="1000"/></emitter>
    </shape>
</scene>"#;

#[test]
fn a_small_bright_spot_is_not_missed() {
    let scene = load_str("spot", SCENE, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    // Fine enough for the flux that is read off between vertices to be that of the vertices.
    let solver = solved(&scene, &tracer, &settings(0.02, Some(0.1)));
    // As much as the meshes know: what is asked is whether it is seen.
    let flux = 0.5 * solver.solution().layer(Component::Direct).flux().0.luminance();
    assert!(flux > 0.0);
    let normal = UnitVector3::new_unchecked(-Vector3::z());
    let mut worst: f64 = 0.0;
    for (x, y) in [(0.0, 0.0), (1.0, 0.4), (-0.9, 1.3), (2.1, -0.7), (-2.3, -1.9), (0.7, 2.9)] {
        let receiver = Receiver { position: Point3::new(x, y, 3.0), normal };
        let settings = HemisphereSettings {
            limits: solver.limits(),
            tolerance: 1e-4 * flux,
            max_samples: 20_000,
        };
        let gathered = solver.solution().gather(&tracer, &receiver, &settings);
        let (dx, dy): (f64, f64) = (x - 0.31, y + 0.17);
        let square = dx * dx + dy * dy + 9.0;
        let expected = flux / PI * 9.0 / (square * square);
        let off = gathered.irradiance.luminance() / expected - 1.0;
        println!("({x}, {y}): {:+.2} %, {} rays", 100.0 * off, gathered.rays);
        worst = worst.max(off.abs());
    }
    // The tolerance is a hundredth; and not all of it comes from one point.
    assert!(worst < 0.01, "{worst}");
}

/// The first triangles are ten times as large as the spot: only rays from the lamp know of it.
#[test]
fn a_spot_between_vertices_is_found() {
    let scene = load_str("spot", SCENE, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let flux = |edge: f64| {
        let solver = solved(&scene, &tracer, &settings(0.02, Some(edge)));
        solver.solution().layer(Component::Direct).flux().0.luminance()
    };
    let (found, known) = (flux(1.0), flux(0.05));
    println!("{found:.5} W on triangles of 1 m, {known:.5} W of 5 cm");
    assert!((found / known - 1.0).abs() < 0.02);
}
