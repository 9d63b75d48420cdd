//! The same bits whatever the number of threads.

use rayon::prelude::*;

use crate::cases;
use crate::common::{BOTH, receiver};
use evolute::trace::Tracer;
use evolute::transfer::{ReceiverLight, Transfer};

/// 200 receivers on the floors of the ball and the ring, by one thread and by two.
#[test]
fn one_thread_and_two() {
    for (case, step) in [("glass_ball", 0.35), ("mirror_ring_small", 0.1)] {
        let scene = cases::load(case, &[]);
        let tracer = Tracer::new(&scene);
        let transfer = Transfer::new(&scene, &tracer, cases::settings(&scene, 1e-2));
        let lights = |threads: usize| -> Vec<ReceiverLight> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                (0..100)
                    .into_par_iter()
                    .map(|k| {
                        let (i, j) = (f64::from(k % 10), f64::from(k / 10));
                        let at = [step * (i - 4.4), 0.0, step * (j - 4.6)];
                        transfer.light(&receiver(at, [0.0, 1.0, 0.0]), BOTH)
                    })
                    .collect()
            })
        };
        let (one, two) = (lights(1), lights(2));
        let bits = |l: &ReceiverLight| {
            let mut all: Vec<u64> = Vec::new();
            for c in 0..3 {
                all.extend([l.direct[c].to_bits(), l.specular[c].to_bits()]);
            }
            all.push(l.error.to_bits());
            (all, l.met, l.counts)
        };
        assert!(one.iter().zip(&two).all(|(a, b)| bits(a) == bits(b)), "{case}");
        let lit = one.iter().filter(|l| !l.specular.is_black()).count();
        println!("{case}: {} receivers bit for bit, {lit} with specular light", one.len());
        assert!(lit > 10);
    }
}
