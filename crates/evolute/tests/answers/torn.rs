//! Domains that are torn: where a chain meets a surface, and beside it does not exist. Light there was once
//! lost without a word.

use crate::cases;
use crate::common::{SPECULAR, receiver};
use evolute::scene::{Scene, load_file};
use evolute::trace::Tracer;
use evolute::transfer::{Event, ReceiverLight, Transfer};

/// The light at `at`, facing up, and the part of it that comes by the shapes named.
fn by(scene: &Scene, at: [f64; 3], names: &[&str]) -> (ReceiverLight, f64) {
    let tracer = Tracer::new(scene);
    let transfer = Transfer::new(scene, &tracer, cases::settings(scene, 1e-2));
    let (light, words) = transfer.light_by_word(&receiver(at, [0.0, 0.0, 1.0]), SPECULAR);
    let named = |(shape, event): &(_, Event)| {
        let id = scene.shape(*shape).id.as_str();
        (*event == Event::Transmit) == (id != "mirror") && names.contains(&id)
    };
    let part = words
        .iter()
        .filter(|w| w.letters.len() == names.len() && w.letters.iter().all(named))
        .map(|w| w.irradiance[1])
        .sum();
    (light, part)
}

/// What a flat mirror shows is what its virtual image would: 0.9 of the light at the mirrored receiver.
#[test]
fn shell_of_glass_in_a_mirror() {
    let file = cases::path("torn_domains", "shell.xml");
    let scene = load_file(&file, &[]).unwrap().scene;
    let away = [("mirror_x".to_string(), "1000".to_string())];
    let alone = load_file(&file, &away).unwrap().scene;
    for x in [0.069, 0.072, 0.075, 0.078, 0.08] {
        let (light, mirrored) = by(&scene, [x, 0.01, -0.08], &["mirror", "outside", "inside"]);
        let (image, direct) = by(&alone, [0.2 - x, 0.01, -0.08], &["outside", "inside"]);
        println!(
            "x = {x}: {mirrored:.4} by the mirror, {:.4} by its image, estimate {:.3} of {:.3}, met {}",
            0.9 * direct,
            light.error,
            light.specular[1],
            light.met
        );
        assert!(direct > 10.0);
        assert!((mirrored - 0.9 * direct).abs() <= light.error + 0.9 * image.error);
        assert!((mirrored / (0.9 * direct) - 1.0).abs() < 5e-3);
    }
}

/// The specular light of a case at the receivers of its table, which an independent path tracer computed.
fn compare(case: &str) {
    compare_at(case, 1e-2);
}

fn compare_at(case: &str, accuracy: f64) {
    let scene = load_file(cases::path("torn_domains", &format!("{case}.xml")), &[]).unwrap().scene;
    let tracer = Tracer::new(&scene);
    let transfer = Transfer::new(&scene, &tracer, cases::settings(&scene, accuracy));
    for row in cases::table("torn_domains", &format!("{case}.csv")) {
        let light =
            transfer.light(&receiver([row[0], row[1], row[2]], [row[3], row[4], row[5]]), SPECULAR);
        let off = light.specular[1] - row[6];
        println!(
            "{case} {:?}: {:.4}, path tracer {:.4} ± {:.4}, estimate {:.4}, met {}, {} chains",
            &row[..3],
            light.specular[1],
            row[6],
            row[7],
            light.error,
            light.met,
            light.counts.chains
        );
        assert!(off.abs() <= light.error + 3.0 * row[7]);
    }
}

/// Chains that are reflected inside a ball of glass near its limb.
#[test]
fn bubble_in_a_ball() {
    compare("bubble");
}

/// What two flat mirrors show past a bar that hides the middle of each.
#[test]
fn periscope() {
    compare("periscope");
}

/// Receivers near the wall, which reflects twice and more.
#[test]
fn half_ring() {
    compare("half_ring");
}

/// What a torus reflects twice comes by a band of its domain that no point of the first grid lies in.
#[test]
fn torus() {
    compare("torus");
}

/// Normals that differ between the points of the first grid, and hardly at them.
#[test]
fn corrugated() {
    compare("corrugated");
}

/// A letter, the end cap, that is met only from a strip between the points of the first grid.
#[test]
fn rod() {
    compare("rod");
}

/// An end that is met after three reflections, from a strip beside which the chains before leave their surface.
#[test]
fn thick_rod() {
    compare("thick_rod");
}

/// Mirrors that face each other: every further reflection comes from a narrower strip.
#[test]
fn facing() {
    compare("facing");
}

/// The same in a glass body with faces, by total reflection.
#[test]
fn prism() {
    compare("prism");
}

/// What goes from one mirror ball to the next.
#[test]
fn balls() {
    compare("balls");
}

/// What three mirror balls show of each other near their limbs, of which no point of a first grid tells.
#[test]
fn limb() {
    compare("limb");
}

/// Where chains carry nothing, at a disc's middle and at a limb, their neighbours do.
#[test]
fn chains_that_carry_nothing() {
    compare("pole");
    compare_at("graze", 1e-3);
    compare("tube");
}

/// A flat mirror that shows a ball or a tube between the points of its grid, in part behind another.
#[test]
fn small_in_a_mirror() {
    compare_at("hidden", 1e-3);
    compare("ball_in_mirror");
    compare("back_and_forth");
}

/// Islands of a word that are much smaller than a cell of the first grid; beside them its chains do not exist.
#[test]
fn islands() {
    compare_at("corner", 1e-3);
    compare_at("dish_and_ball", 1e-3);
}

/// Under water all light comes through a cone: how large the surface is beyond it must not matter.
#[test]
fn pool() {
    let file = cases::path("torn_domains", "pool.xml");
    let light = |half: &str, x: f64, y: f64| {
        let scene = load_file(&file, &[("half".to_string(), half.to_string())]).unwrap().scene;
        let tracer = Tracer::new(&scene);
        let transfer = Transfer::new(&scene, &tracer, cases::settings(&scene, 1e-3));
        transfer.light(&receiver([x, y, 1e-4], [0.0, 0.0, 1.0]), SPECULAR)
    };
    for (x, y) in [(-0.45, -0.69), (-0.45, -0.33), (0.03, -0.45), (0.51, 0.03), (0.0, 0.0)] {
        let small = light("0.9", x, y);
        for half in ["2", "3", "10"] {
            let large = light(half, x, y);
            println!(
                "({x}, {y}), half {half} m: {:.5} ± {:.5}, 0.9 m: {:.5} ± {:.5}",
                large.specular[1], large.error, small.specular[1], small.error
            );
            assert!(small.specular[1] > 0.3);
            assert!((large.specular[1] - small.specular[1]).abs() <= large.error + small.error);
        }
    }
}
