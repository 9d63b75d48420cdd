//! A black lamp in a bright room: what it absorbs is a tenth of all, and is missed where rows miss the lamp.

use evolute::geometry::{Point3, UnitVector3, Vector3};
use evolute::scene::load_str;
use evolute::solve::Component;
use evolute::trace::Tracer;
use evolute::transfer::{HemisphereSettings, Receiver};

use crate::{settings, solved};

/// In a cube of 4 m.
const SCENE: &str = r#"<scene version="3.0.0">
    <shape type="cube" id="walls">
        <transform name="to_world"><scale value="2"/></transform>
        <boolean name="flip_normals" value="true"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.95"/></bsdf>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world"><scale value="0.3"/><rotate x="1" angle="180"/><translate z="1.5"/></transform>
        <emitter type="area"><rgb name="radiance" value="10"/></emitter>
    </shape>
</scene>"#;

/// All that is emitted is absorbed: by walls, as the meshes say, and by the lamp, as receivers on it do.
#[test]
fn light_that_a_black_lamp_absorbs_is_missing() {
    let scene = load_str("black", SCENE, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let solver = solved(&scene, &tracer, &settings(0.01, None));
    let solution = solver.solution();
    let flux = |c: Component| solution.layer(c).flux().0.luminance();
    let walls = 0.05 * Component::ALL.map(flux).iter().sum::<f64>();
    let tolerance = 1e-3 * flux(Component::Indirect) / 96.0;
    let mut lamp = 0.0;
    for up in [-1.0, 1.0] {
        for (x, y) in [(-0.2, -0.2), (0.2, -0.2), (0.0, 0.0), (-0.2, 0.2), (0.2, 0.2)] {
            let normal = UnitVector3::new_unchecked(Vector3::z() * up);
            let receiver = Receiver { position: Point3::new(x, y, 1.5), normal };
            let settings =
                HemisphereSettings { limits: solver.limits(), tolerance, max_samples: 20_000 };
            let light = solution.gather(&tracer, &receiver, &settings).irradiance.luminance();
            lamp += 0.36 / 5.0 * light;
        }
    }
    let emitted = scene.emitted_flux().luminance();
    let off = (walls + lamp) / emitted - 1.0;
    println!(
        "walls absorb {walls:.3} W, the lamp {lamp:.3} W: {:+.2} % of {emitted:.3} W",
        100.0 * off
    );
    assert!(off.abs() < 0.01);
}
