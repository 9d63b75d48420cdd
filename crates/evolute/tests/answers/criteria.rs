//! The criteria of the paper's section 3.3, each switched off in turn, in a scene where it matters.

use rayon::prelude::*;

use evolute::scene::load_file;
use evolute::trace::Tracer;
use evolute::transfer::{
    Criteria, Receiver, ReceiverLight, SolidAngle, Transfer, TransferSettings,
};

use crate::cases;
use crate::common::{SPECULAR, receiver};

const RECEIVERS: u32 = 120;
const ACCURACY: f64 = 1e-2;

/// A scene, where its receivers are spread (half sides and height), which way they face, and the largest
/// solid angle [sr] of a cell of the grid that truth starts from.
struct Case {
    scene: &'static str,
    half: [f64; 2],
    height: f64,
    finest: f64,
}

const CASES: [Case; 3] = [
    Case { scene: "near", half: [1.0, 1.0], height: 0.003, finest: 1e-2 },
    Case { scene: "bumps", half: [0.8, 0.8], height: 1.2, finest: 1e-3 },
    Case { scene: "bars", half: [0.5, 0.5], height: 2.0, finest: 1e-3 },
];

/// Points that fill the rectangle evenly (Roberts's R₂), facing down.
fn receivers(case: &Case) -> Vec<Receiver> {
    (0..RECEIVERS)
        .map(|k| {
            let at = |step: f64| 2.0 * ((f64::from(k) + 0.5) * step).fract() - 1.0;
            let [x, y] = case.half;
            let p = [x * at(0.754_877_666_246_693), y * at(0.569_840_290_998_053), case.height];
            receiver(p, [0.05, 0.0, -1.0])
        })
        .collect()
}

/// What a set of criteria makes of a case.
struct Outcome {
    chains: u64,
    /// Errors as shares of the light, in order.
    errors: Vec<f64>,
    /// Receivers whose error is within the estimate.
    held: usize,
    /// Receivers whose error is more than asked for.
    wrong: usize,
}

fn outcome(lights: &[ReceiverLight], truth: &[ReceiverLight]) -> Outcome {
    let pairs = || lights.iter().zip(truth);
    let off = |(l, t): (&ReceiverLight, &ReceiverLight)| (l.specular[1] - t.specular[1]).abs();
    let mut errors: Vec<f64> =
        pairs().map(|p| off(p) / p.1.specular[1].max(f64::MIN_POSITIVE)).collect();
    errors.sort_by(f64::total_cmp);
    Outcome {
        wrong: errors.iter().filter(|e| **e > ACCURACY).count(),
        chains: lights.iter().map(|l| l.counts.chains).sum::<u64>() / u64::from(RECEIVERS),
        errors,
        held: pairs().filter(|p| off(*p) <= p.0.error + p.1.error).count(),
    }
}

#[test]
fn each_criterion_matters_somewhere() {
    let all = Criteria::default();
    let sets = [
        ("all", all),
        ("without 1", Criteria { solid_angle: None, ..all }),
        ("without 2", Criteria { normal_variation: None, ..all }),
        ("without 3", Criteria { matching_trees: None, ..all }),
        ("without 4", Criteria { quadrature: None, ..all }),
    ];
    for (number, case) in CASES.iter().enumerate() {
        let scene =
            load_file(cases::path("criteria", &format!("{}.xml", case.scene)), &[]).unwrap().scene;
        let tracer = Tracer::new(&scene);
        let at = receivers(case);
        let run = |accuracy: f64, criteria: Criteria| -> Vec<ReceiverLight> {
            let settings = TransferSettings { criteria, ..cases::settings(&scene, accuracy) };
            let transfer = Transfer::new(&scene, &tracer, settings);
            at.par_iter().map(|r| transfer.light(r, SPECULAR)).collect()
        };
        // Truth is computed from a grid so fine that nothing is left to criteria 1 to 3.
        let fine = Criteria { solid_angle: Some(SolidAngle { largest: case.finest }), ..all };
        let truth = run(1e-4, fine);
        println!(
            "{}: chains, error median / 90 % / worst, worse than asked, within the estimate",
            case.scene
        );
        let outcomes: Vec<Outcome> = sets
            .iter()
            .map(|(name, criteria)| {
                let o = outcome(&run(ACCURACY, *criteria), &truth);
                let at = |share: f64| o.errors[(share * f64::from(RECEIVERS - 1)) as usize];
                println!(
                    "  {name}: {} chains, {:.1e} / {:.1e} / {:.1e}, {}, {} of {RECEIVERS}",
                    o.chains,
                    at(0.5),
                    at(0.9),
                    at(1.0),
                    o.wrong,
                    o.held
                );
                o
            })
            .collect();
        let [with, without, queue] = [&outcomes[0], &outcomes[number + 1], &outcomes[4]];
        assert!(without.wrong >= 3 * with.wrong + 3, "{}", case.scene);
        assert!(without.errors[RECEIVERS as usize - 1] > 5.0 * ACCURACY, "{}", case.scene);
        assert!(with.wrong == 0 && with.held == RECEIVERS as usize, "{}", case.scene);
        assert!(queue.wrong >= 3 * with.wrong + 3 && queue.chains <= with.chains, "{}", case.scene);
    }
}
