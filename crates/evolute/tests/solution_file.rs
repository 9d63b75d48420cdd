//! Solutions as bytes, and runs that go on from what others have computed.
#![allow(clippy::unwrap_used)]

use std::sync::atomic::{AtomicU64, Ordering};

use evolute::geometry::{Point3, Vector3};
use evolute::scene::{Scene, load_str};
use evolute::solve::{
    Checkpoint, Component, Solver, SolverSettings, decode_solution, encode_solution,
};
use evolute::trace::Tracer;
use evolute::transfer::{Control, HemisphereSettings, Order, Receiver};

/// A floor, a wall on it, a tube and a ball that reflect diffusely, a mirror and a lamp.
const SCENE: &str = r#"<scene version="3.0.0">
    <shape type="rectangle" id="floor">
        <bsdf type="diffuse"><rgb name="reflectance" value="0.5, 0.4, 0.3"/></bsdf>
    </shape>
    <shape type="rectangle" id="wall">
        <transform name="to_world"><rotate x="1" angle="90"/><translate y="1" z="1"/></transform>
        <bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.7"/></bsdf></bsdf>
    </shape>
    <shape type="sphere">
        <point name="center" value="0.4, 0.3, 0.25"/> <float name="radius" value="0.25"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.6"/></bsdf>
    </shape>
    <shape type="parametric">
        <string name="x" value="-0.6 + 0.1*cos(2*pi*s)"/> <string name="y" value="0.1*sin(2*pi*s)"/>
        <string name="z" value="0.6*t"/>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.2, 0.6, 0.6"/></bsdf>
    </shape>
    <shape type="rectangle" id="mirror">
        <transform name="to_world"><rotate y="1" angle="90"/><translate x="-1" z="1"/></transform>
        <bsdf type="conductor"><string name="material" value="none"/></bsdf>
    </shape>
    <shape type="rectangle" id="lamp">
        <transform name="to_world"><scale value="0.4"/><rotate x="1" angle="180"/><translate z="1.8"/></transform>
        <emitter type="area"><rgb name="radiance" value="10, 9, 8"/></emitter>
    </shape>
</scene>"#;

fn scene() -> Scene {
    load_str("test.xml", SCENE, &[]).unwrap().scene
}

fn settings() -> SolverSettings {
    let mut settings = SolverSettings { edge: Some(0.5), ..SolverSettings::default() };
    settings.transfer.relative = 0.1;
    settings
}

/// A solution that nothing stops, as bytes.
fn solved(scene: &Scene, tracer: &Tracer<'_>) -> Vec<u8> {
    let mut solver = Solver::new(scene, tracer, &settings(), &Control::GO).unwrap();
    while solver.step().is_some() {}
    encode_solution(scene, &settings(), Some(&solver.into_outcome()), None).unwrap()
}

/// Through bytes and back.
fn stored(scene: &Scene, checkpoint: &Checkpoint) -> Checkpoint {
    let bytes = encode_solution(scene, &settings(), None, Some(checkpoint)).unwrap();
    let file = decode_solution(&bytes, scene).unwrap();
    assert!(file.outcome.is_none());
    file.is_resumable(&settings()).unwrap();
    file.checkpoint.unwrap()
}

#[test]
fn what_is_read_is_what_was_written() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let mut solver = Solver::new(&scene, &tracer, &settings(), &Control::GO).unwrap();
    while solver.step().is_some() {}
    let own = solver.into_outcome();
    let bytes = encode_solution(&scene, &settings(), Some(&own), None).unwrap();
    let file = decode_solution(&bytes, &scene).unwrap();
    assert!(file.checkpoint.is_none());
    assert_eq!(file.settings, settings());
    let read = file.outcome.unwrap();
    assert!(read.is_complete);
    assert_eq!((read.ledger, read.counts), (own.ledger, own.counts));
    for component in Component::ALL {
        let (a, b) = (own.solution.layer(component), read.solution.layer(component));
        for sheet in 0..own.solution.sheets().len() {
            assert_eq!(a.irradiance(sheet), b.irradiance(sheet));
            assert_eq!(a.error(sheet), b.error(sheet));
            b.meshes()[sheet].validate().unwrap();
        }
    }
    // What is read off it, between vertices and by quadratic interpolation.
    let receiver = Receiver {
        position: Point3::new(0.1, -0.2, 0.6),
        normal: evolute::geometry::UnitVector3::new_normalize(Vector3::new(0.3, 1.0, -0.4)),
    };
    let settings = HemisphereSettings {
        limits: evolute::trace::tree::Limits {
            max_specular: 8,
            throughput: 1e-3,
            diffuse_throughput: 1e-3,
            lamps: false,
        },
        tolerance: 0.0,
        max_samples: 2000,
    };
    let [a, b] = [&own, &read].map(|o| o.solution.gather(&tracer, &receiver, &settings).irradiance);
    assert!(a.luminance() > 0.0);
    assert_eq!(a, b);
    let again = encode_solution(&scene, &read.settings, Some(&read), None).unwrap();
    assert!(bytes == again);
}

#[test]
fn threads_change_no_byte() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let with = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| solved(&scene, &tracer))
    };
    assert!(with(1) == with(3));
}

/// Stopped again and again, each time a little later, and stored in between.
#[test]
fn what_goes_on_ends_as_if_it_had_never_stopped() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let expected = solved(&scene, &tracer);
    for stop in [Order::Abandon, Order::Finish] {
        let mut checkpoint = Checkpoint::default();
        let (mut runs, mut known) = (0, [0; 3]);
        let outcome = loop {
            runs += 1;
            // Vertices of a run, then iterations of the loop.
            let (asked, most) = (AtomicU64::new(0), 150 * runs);
            let order = || match asked.fetch_add(1, Ordering::Relaxed) {
                n if n < most => Order::Go,
                _ => stop,
            };
            let control = Control { order: &order, progress: &|_, _, _| {} };
            let run = Solver::resume(&scene, &tracer, &settings(), &control, &mut checkpoint);
            let mut left = 200 * runs;
            if let Some(mut solver) = run {
                let mut rests = false;
                while left > 0 && !rests {
                    rests = solver.step().is_none();
                    left -= 1;
                }
                solver.keep_state(&mut checkpoint);
                let outcome = solver.into_outcome();
                if outcome.is_complete {
                    break outcome;
                }
            }
            let (vertices, iterations) = checkpoint.counts();
            assert!((0..3).all(|i| vertices[i] >= known[i]), "{known:?} then {vertices:?}");
            assert!(runs < 500, "{vertices:?} and {iterations} iterations after {runs} runs");
            known = vertices;
            checkpoint = stored(&scene, &checkpoint);
        };
        assert!(runs > 5, "{runs} runs");
        let bytes = encode_solution(&scene, &settings(), Some(&outcome), None).unwrap();
        assert!(bytes == expected, "{stop:?}");
    }
}

/// A run for which there is no time at all comes to the end, as all is known.
#[test]
fn what_is_known_is_not_computed_again() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let mut checkpoint = Checkpoint::default();
    let solver =
        Solver::resume(&scene, &tracer, &settings(), &Control::GO, &mut checkpoint).unwrap();
    assert_eq!(solver.counts().iterations(), 0);
    let mut checkpoint = stored(&scene, &checkpoint);
    let (vertices, iterations) = checkpoint.counts();
    assert_eq!((vertices, iterations), (solver.counts().vertices, 0));
    let halt = Control { order: &|| Order::Finish, progress: &|_, _, _| {} };
    let mut solver = Solver::resume(&scene, &tracer, &settings(), &halt, &mut checkpoint).unwrap();
    assert!(solver.is_complete());
    for _ in 0..50 {
        solver.step().unwrap();
    }
    solver.keep_state(&mut checkpoint);
    let mut checkpoint = stored(&scene, &checkpoint);
    assert_eq!(checkpoint.counts().1, 50);
    let mut solver = Solver::resume(&scene, &tracer, &settings(), &halt, &mut checkpoint).unwrap();
    assert_eq!(solver.counts().iterations(), 50);
    while solver.step().is_some() {}
    let bytes = encode_solution(&scene, &settings(), Some(&solver.into_outcome()), None).unwrap();
    assert!(bytes == solved(&scene, &tracer));
}

#[test]
fn other_scenes_and_settings_are_refused() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let bytes = solved(&scene, &tracer);
    let brighter = SCENE.replace("10, 9, 8", "10, 9, 9");
    let brighter = load_str("test.xml", &brighter, &[]).unwrap().scene;
    let said = decode_solution(&bytes, &brighter).unwrap_err().to_string();
    assert!(said.contains("another scene"), "{said}");
    let file = decode_solution(&bytes, &scene).unwrap();
    let mut finer = settings();
    finer.transfer.relative = 0.01;
    let said = file.is_resumable(&finer).unwrap_err().to_string();
    assert!(said.contains("--accuracy 0.1,") && said.contains("0.01 is asked"), "{said}");
    let coarser = SolverSettings { edge: Some(1.0), ..settings() };
    assert!(file.is_resumable(&coarser).is_err());
}

#[test]
fn damaged_files_are_refused_with_a_sentence() {
    let scene = scene();
    let tracer = Tracer::new(&scene);
    let bytes = solved(&scene, &tracer);
    let says = |bytes: &[u8]| decode_solution(bytes, &scene).unwrap_err().to_string();
    for length in (0..200).chain((200..bytes.len()).step_by(997)) {
        let said = says(&bytes[..length]);
        assert!(said.contains(';'), "{length}: {said}");
    }
    assert!(says(&[&bytes[..], b"x"].concat()).contains("should have"));
    // Every byte of the header, and some of the content.
    for at in (0..100).chain((100..bytes.len()).step_by(331)) {
        for flip in [1, 0x80] {
            let mut damaged = bytes.clone();
            damaged[at] ^= flip;
            let said = says(&damaged);
            assert!(said.contains(';'), "{at}: {said}");
        }
    }
    assert!(says(b"P6 640 480 255").contains("not a solution file"));
    let mut newer = bytes;
    newer[8] += 1;
    assert!(says(&newer).contains("newer evolute"));
}
