//! Whoever shoots next, and however far: the answer is the same (Yu & Wu, 3.2).

use evolute::scene::Scene;
use evolute::solve::{Component, Scheme, Solver};
use evolute::trace::Tracer;
use evolute::transfer::Control;

use crate::cases::load;
use crate::settings;

/// Irradiance by reflected light at all vertices, luminances [W/m²].
fn indirect(solver: &Solver<'_>) -> Vec<f64> {
    let layer = solver.solution().layer(Component::Indirect);
    let of = |sheet| layer.irradiance(sheet).iter().map(evolute::geometry::Rgb::luminance);
    (0..layer.meshes().len()).flat_map(of).collect()
}

/// Holds schemes against the first one: the same within half of the accuracy, as little may be left waiting, and as many
/// links.
fn check(scene: &Scene, accuracy: f64, edge: f64, schemes: &[Scheme]) {
    let tracer = Tracer::new(scene);
    let settings = settings(accuracy, Some(edge));
    let made = Solver::new(scene, &tracer, &settings, &Control::GO).unwrap();
    let mut first: Option<Vec<f64>> = None;
    for &scheme in schemes {
        let mut solver = made.clone();
        solver.set_scheme(scheme);
        while solver.step().is_some() {}
        let (ledger, counts) = (solver.ledger(), solver.counts());
        assert!(ledger.imbalance().max().abs() <= 1e-9 * ledger.emitted.max());
        assert_eq!(counts.links, made.counts().links);
        assert_eq!(counts.specular == 0, scheme == Scheme::Joint);
        assert!(counts.replayed[0] >= counts.links[0] as u64 / 2);
        let light = indirect(&solver);
        let mean = light.iter().sum::<f64>() / light.len() as f64;
        let each = first.as_ref().unwrap_or(&light).iter().zip(&light);
        let most = each.map(|(a, b)| (a - b).abs() / mean).fold(0.0, f64::max);
        println!(
            "{scheme:?}: differs by at most {:.3} % of the mean; {} diffuse and {} specular iterations, links \
             replayed {:?}, correction {:.3} %",
            100.0 * most,
            counts.diffuse,
            counts.specular,
            counts.replayed,
            100.0 * counts.correction
        );
        assert!(most < 0.5 * accuracy);
        first.get_or_insert(light);
    }
}

#[test]
fn separate_and_joint_iterations_agree() {
    let scene = load("ward_room", &[("west", "mirror")]);
    check(&scene, 1e-2, 0.5, &[Scheme::Flux, Scheme::Joint]);
}

/// With a focus of reflected light, and a narrow gap behind the mirror's frame.
#[test]
fn separate_and_joint_iterations_agree_in_a_room_of_things() {
    let scene = load("room", &[]);
    check(&scene, 5e-2, 0.5, &[Scheme::Flux, Scheme::Joint]);
}

/// By the largest radiosity, small patches shoot as early as large ones: a coarse mesh will do.
#[test]
fn the_scheme_as_printed_agrees() {
    let scene = load("ward_room", &[("west", "mirror")]);
    check(&scene, 1e-2, 2.0, &[Scheme::Flux, Scheme::Printed]);
}
