//! Pictures against light at points: what a pixel shows is what `Transfer` says of the place it sees.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use evolute::geometry::{Point3, UnitVector3, Vector3};
use evolute::scene::{Scene, load_file, load_str};
use evolute::solve::{Solver, SolverSettings};
use evolute::trace::Tracer;
use evolute::transfer::{
    Components, Control, HemisphereSettings, Receiver, Transfer, TransferSettings,
};
use evolute::view::{Mode, Picture, ViewSettings, render};

const WIDTH: u32 = 40;
const HEIGHT: u32 = 30;

/// A lamp, a floor, a mirror standing on it that faces the camera, and a mirror ball over the floor.
fn scene(integrator: &str) -> Scene {
    let text = format!(
        r#"<scene version="3.0.0">
        {integrator}
        <sensor type="perspective">
            <float name="fov" value="50"/>
            <transform name="to_world">
                <lookat origin="0, -4, 2" target="0, 0, 0.5" up="0, 0, 1"/>
            </transform>
            <film type="hdrfilm">
                <integer name="width" value="{WIDTH}"/> <integer name="height" value="{HEIGHT}"/>
                <rfilter type="box"/>
            </film>
        </sensor>
        <shape type="rectangle" id="floor">
            <transform name="to_world"><scale value="2"/></transform>
            <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.25, 0.75"/></bsdf>
        </shape>
        <shape type="rectangle" id="mirror">
            <transform name="to_world">
                <rotate x="1" angle="90"/><translate y="1.5" z="1"/>
            </transform>
            <bsdf type="conductor"><string name="material" value="none"/></bsdf>
        </shape>
        <shape type="sphere" id="ball">
            <point name="center" x="-0.8" y="0" z="0.5"/> <float name="radius" value="0.4"/>
            <bsdf type="conductor"><string name="material" value="none"/></bsdf>
        </shape>
        <shape type="rectangle" id="lamp">
            <transform name="to_world">
                <scale value="0.3"/><rotate x="1" angle="180"/><translate x="0.5" z="3"/>
            </transform>
            <emitter type="area"><rgb name="radiance" value="30, 20, 10"/></emitter>
        </shape>
    </scene>"#
    );
    load_str("view.xml", &text, &[]).unwrap().scene
}

fn drawn(scene: &Scene, max_specular: u32) -> Picture {
    let tracer = Tracer::new(scene);
    let transfer = TransferSettings { max_specular, ..TransferSettings::default() };
    let settings = ViewSettings { transfer, ..ViewSettings::default() };
    render(scene, &tracer, &scene.sensors[0], None, &settings, &Control::GO).unwrap()
}

fn sum(layer: &[[f32; 3]]) -> f64 {
    layer.iter().flatten().map(|x| f64::from(*x)).sum()
}

/// The place that a pixel's centre sees first, if nothing specular lies before it.
fn floor_at(x: u32, y: u32) -> (Point3, f64) {
    let origin = Point3::new(0.0, -4.0, 2.0);
    let forward = (Point3::new(0.0, 0.0, 0.5) - origin).normalize();
    let right = forward.cross(&Vector3::z()).normalize();
    let up = right.cross(&forward);
    let half = 25f64.to_radians().tan();
    let (w, h) = (f64::from(WIDTH), f64::from(HEIGHT));
    let across = half * (2.0 * (f64::from(x) + 0.5) / w - 1.0);
    let upward = half * (h - 2.0 * (f64::from(y) + 0.5)) / w;
    let direction = (forward + right * across + up * upward).normalize();
    let t = -origin.z / direction.z;
    (origin + direction * t, t)
}

#[test]
fn pixels_show_the_light_where_they_look() {
    let scene = scene("");
    let picture = drawn(&scene, 256);
    let tracer = Tracer::new(&scene);
    let fine = TransferSettings { relative: 1e-3, ..TransferSettings::default() };
    let transfer = Transfer::new(&scene, &tracer, fine);
    let both = Components { direct: true, specular: true };
    let (mut straight, mut mirrored, mut caustic) = (0, 0, 0);
    let (mut far_off, mut uneven) = (0, 0);
    for i in 0..(WIDTH * HEIGHT) as usize {
        let (mut position, t) = floor_at(i as u32 % WIDTH, i as u32 / WIDTH);
        // The mirror stands upright: the path to the floor seen in it is as long as straight on.
        if (f64::from(picture.distance[i]) - t).abs() > 1e-5 {
            continue;
        }
        if position.y > 1.5 {
            position.y = 3.0 - position.y;
            mirrored += 1;
        } else {
            straight += 1;
        }
        assert_eq!(picture.normal[i], [0.0, 0.0, 1.0]);
        let normal = UnitVector3::new_normalize(Vector3::z());
        let light = transfer.light(&Receiver { position, normal }, both);
        caustic += u32::from(light.specular.0[0] > 0.1 * light.direct.0[0]);
        for c in 0..3 {
            let expected = light.direct.0[c] + light.specular.0[c];
            let shown = f64::from(picture.irradiance[i][c]);
            far_off += u32::from((shown - expected).abs() > 0.03 * expected);
            // Reflectance and 1/π between irradiance and radiance.
            let radiance = f64::from(picture.direct[i][c] + picture.specular[i][c]);
            let ratio = radiance * std::f64::consts::PI / ([0.5, 0.25, 0.75][c] * shown);
            // Over a pixel that holds one surface the mean is the centre but for curvature.
            uneven += u32::from((ratio - 1.0).abs() > 0.02);
        }
    }
    assert!(straight > 300 && mirrored > 50 && caustic > 20, "{straight} {mirrored} {caustic}");
    // Light and interpolation are each allowed 1 %. Shadow edges are sharper than these pixels of
    // some 10 cm; there nodes half a pixel apart are off by more.
    let all = 3 * (straight + mirrored);
    assert!(far_off < all / 20, "{far_off} of {all}");
    // Pixels on outlines and shadow edges.
    assert!(uneven < all / 5, "{uneven} of {all}");
}

#[test]
fn max_depth_counts_as_in_mitsuba() {
    let limited = |depth: u32| {
        scene(&format!(
            r#"<integrator type="path"><integer name="max_depth" value="{depth}"/></integrator>"#
        ))
    };
    let parts = |p: &Picture| [sum(&p.direct), sum(&p.specular), sum(&p.emitted)];
    assert_eq!(parts(&drawn(&limited(0), 256)), [0.0; 3]);
    // One edge: lamps seen directly. This one turns its back, so that only mirrors show it.
    let one = drawn(&limited(1), 256);
    assert_eq!(parts(&one), [0.0; 3]);
    // Two: a mirror shows the lamp, and lamps light the floor.
    let two = parts(&drawn(&limited(2), 256));
    assert!(two[0] > 0.0 && two[1] == 0.0 && two[2] > 0.0, "{two:?}");
    // Three: the floor is seen in the mirror, and the mirror lights the floor.
    let three = parts(&drawn(&limited(3), 256));
    assert!(three[0] > two[0] && three[1] > 0.0 && three[2] >= two[2], "{three:?}");
    // Without chains there is nothing but direct light on what is seen directly.
    let none = parts(&drawn(&scene(""), 0));
    assert!(
        (none[0] - two[0]).abs() < 1e-3 * two[0] && none[1] == 0.0 && none[2] == 0.0,
        "{none:?}"
    );
}

/// A closed box, a mirror ball and a lamp in it.
const BOX: &str = r#"<scene version="3.0.0">
    <sensor type="perspective">
        <float name="fov" value="60"/>
        <transform name="to_world"><lookat origin="0, -0.9, 0" target="0, 1, -0.2" up="0, 0, 1"/></transform>
        <film type="hdrfilm">
            <integer name="width" value="40"/> <integer name="height" value="30"/> <rfilter type="box"/>
        </film>
    </sensor>
    <shape type="cube" id="walls">
        <boolean name="flip_normals" value="true"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.6, 0.5, 0.4"/></bsdf>
    </shape>
    <shape type="sphere" id="ball">
        <point name="center" x="0.3" y="0.4" z="-0.6"/> <float name="radius" value="0.3"/>
        <bsdf type="conductor"><string name="material" value="none"/></bsdf>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world">
            <scale value="0.2"/><rotate x="1" angle="180"/><translate z="0.95"/>
        </transform>
        <emitter type="area"><rgb name="radiance" value="30"/></emitter>
    </shape>
</scene>"#;

/// Indirect light of a picture against what is gathered at the places that its pixels show, and all of it as the
/// meshes have it.
#[test]
fn indirect_light_is_what_is_gathered_and_what_the_meshes_have() {
    let scene = load_str("box.xml", BOX, &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let mut solver =
        Solver::new(&scene, &tracer, &SolverSettings::default(), &Control::GO).unwrap();
    while solver.step().is_some() {}
    solver.finish();
    let with = |mode| {
        let settings = ViewSettings { mode, ..ViewSettings::default() };
        let solution = Some(solver.solution());
        render(&scene, &tracer, &scene.sensors[0], solution, &settings, &Control::GO).unwrap()
    };
    let (computed, read) = (with(Mode::Recompute), with(Mode::Mesh));
    for (a, b) in [
        (&computed.direct, &read.direct),
        (&computed.specular, &read.specular),
        (&computed.indirect, &read.indirect),
        (&computed.emitted, &read.emitted),
    ] {
        let (a, b) = (sum(a), sum(b));
        assert!((a - b).abs() < 0.02 * sum(&computed.direct), "{a} {b}");
    }
    // Up the middle of the far wall, y = 1: no mirror shows there.
    for row in [5, 10] {
        let i = row * 40 + 20;
        let [nx, ny, nz] = computed.normal[i].map(f64::from);
        assert!(ny < -0.99, "{nx} {ny} {nz}");
        let height = 2.0 * (15.0 - (row as f64 + 0.5)) / 40.0 * 30f64.to_radians().tan();
        let forward = Vector3::new(0.0, 1.9, -0.2).normalize();
        let up = Vector3::new(0.0, 0.2, 1.9).normalize();
        let right = 2.0 * 0.5 / 40.0 * 30f64.to_radians().tan();
        let d = (forward + up * height + Vector3::x() * right).normalize();
        let distance = 1.9 / d.y;
        assert!((f64::from(computed.distance[i]) - distance).abs() < 1e-6);
        let at = Point3::new(0.0, -0.9, 0.0) + d * distance;
        let receiver = Receiver {
            // On the wall to the last bit: what lies behind it sees nothing.
            position: Point3::new(at.x, 1.0, at.z),
            normal: UnitVector3::new_normalize(Vector3::new(nx, ny, nz)),
        };
        let settings =
            HemisphereSettings { limits: solver.limits(), tolerance: 1e-3, max_samples: 100_000 };
        let gathered = solver.solution().gather(&tracer, &receiver, &settings).irradiance;
        let expected = gathered[0] * 0.6 / std::f64::consts::PI;
        let drawn = f64::from(computed.indirect[i][0]);
        assert!((drawn / expected - 1.0).abs() < 0.02, "row {row}: {drawn} {expected}");
    }
}

/// A box stands a hair before a wall: its shadow on the wall begins at the box's outline, and ends within a pixel.
#[test]
fn shadows_narrower_than_a_pixel_are_seen_beside_outlines() {
    const FINER: u32 = 10;
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../bench/room/thin_shadow.xml");
    let mut scene = load_file(file, &[]).unwrap().scene;
    let coarse = drawn(&scene, 4);
    let film = &mut scene.sensors[0].film;
    let (width, height) = (film.width, film.height);
    (film.width, film.height) = (FINER * width, FINER * height);
    let fine = drawn(&scene, 4);
    let brightest = coarse.direct.iter().fold(0f32, |m, p| m.max(p[1]));
    let (mut worst, mut seen) = (0f32, 0f32);
    for y in 0..height {
        for x in 0..width {
            let block = (0..FINER * FINER).map(|k| {
                let (x, y) = (FINER * x + k % FINER, FINER * y + k / FINER);
                fine.direct[(y * FINER * width + x) as usize][1]
            });
            let mean = block.sum::<f32>() / (FINER * FINER) as f32;
            let off = (coarse.direct[(y * width + x) as usize][1] - mean).abs() / brightest;
            if off > worst {
                (worst, seen) = (off, mean / brightest);
            }
        }
    }
    println!("worst pixel off by {worst:.3} of the brightest, {seen:.3} expected");
    assert!(worst <= 0.12, "{worst}");
}
