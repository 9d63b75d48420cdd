//! Other views of the same random chains: collimated light, Euler's formulas, and the dual numbers that
//! the receiver's side uses.

use crate::bodies::{Random, all_bodies};
use crate::paths::{Family, Way, random_path};
use evolute::geometry::{Matrix2, Vector3, tangent_frame};
use evolute::optics::differential::{DualRay, DualVector, reflected, refracted};
use evolute::optics::{CollimatedChain, FactorLaw, Interaction, Wavefront};

/// dA₀/dA_P against traced parallel rays, and against the angular spread of the wave from P:
/// (dA₀/dA_P)(dΩ₀/dΩ_P) = (n_P/n₀)².
#[test]
fn collimated_chains() {
    let bodies = all_bodies();
    let mut r = Random(11);
    let (mut worst, mut law, mut done) = ([0.0f64; 2], 0.0f64, 0);
    while done < 10_000 {
        let Some(path) = random_path(&bodies, 1 + done % 6, None, &mut r) else { continue };
        let chain =
            CollimatedChain { receiver: path.start, vertices: &path.vertices, light: -path.last };
        let factors = chain.factors(FactorLaw::default()).unwrap();
        let (direction, index) = path.beginning(Way::FromSource);
        let plane = Wavefront::plane(direction, index);
        let (wave, step) = path.carried(Way::FromSource, plane).unwrap();
        let traced = path.difference(Way::FromSource, Family::Collimated, &wave, step).unwrap();
        let square = traced.norm_squared();
        let off = (1.0 / factors.concentration - traced.determinant()).abs();
        assert!(off <= 1e-5 * square, "{off} {square}");
        worst[0] = worst[0].max(off / square);
        if traced.determinant().abs() > 1e-2 * square {
            let relative = off / traced.determinant().abs();
            assert!(relative <= 1e-5, "{relative}");
            worst[1] = worst[1].max(relative);
        }
        let condition = evolute::optics::condition_number(&wave.position_jacobian());
        let product = factors.concentration * factors.spread;
        let off = (product / (factors.index_ratio * factors.index_ratio) - 1.0).abs();
        let bound = (1e-13 * condition).max(1e-9);
        assert!(off <= bound, "{off} {condition}");
        law = law.max(off / bound);
        done += 1;
    }
    println!(
        "\n{done} collimated chains: determinant off by {:.1e} of ‖J‖², {:.1e} of itself where well off;",
        worst[0], worst[1]
    );
    println!("  (dA0/dA_P)(dΩ0/dΩ_P) from (n_P/n_0)²: {law:.1e} of the bound");
}

/// The Jacobi fields of dual numbers and the curvature tensor are the same derivatives.
#[test]
fn dual_numbers_agree() {
    let bodies = all_bodies();
    let mut r = Random(12);
    let (mut worst, mut done) = (0.0f64, 0);
    while done < 10_000 {
        let Some(path) = random_path(&bodies, 1 + done % 6, None, &mut r) else { continue };
        let (direction, index) = path.beginning(Way::FromReceiver);
        let point = Wavefront::spherical(direction, index);
        let (wave, _) = path.carried(Way::FromReceiver, point).unwrap();

        let (e1, e2) = tangent_frame(&direction);
        let mut ray = DualRay {
            o: DualVector::constant(path.start.coords),
            d: DualVector::new(direction.into_inner(), e1, e2),
        };
        let mut least = 1.0f64;
        for v in &path.vertices {
            let t = (v.local.x.coords - ray.o.v).norm();
            let x = ray.met(t, &v.local.x, &v.local.n).unwrap();
            let side = if ray.d.v.dot(&v.local.n) < 0.0 { 1.0 } else { -1.0 };
            let turn = v.local.dn_dx * side;
            let n = DualVector::new(v.local.n.into_inner() * side, turn * x.a, turn * x.b);
            let cos = -ray.d.dot(&n);
            least = least.min(cos.v);
            let d = match v.interaction {
                Interaction::Reflection => reflected(&ray.d, &n),
                Interaction::Refraction => {
                    let eta = v.index_toward_receiver / v.index_toward_source;
                    let (d, cos_t) = refracted(&ray.d, &n, eta, cos).unwrap();
                    least = least.min(cos_t.v);
                    d
                }
            };
            ray = DualRay { o: x, d };
        }
        let t = (path.end.coords - ray.o.v).norm();
        let across = path.last.into_inner();
        let end = ray.met(t, &path.end, &across).unwrap();
        let [f1, f2]: [Vector3; 2] = wave.frame();
        let dual = Matrix2::new(f1.dot(&end.a), f1.dot(&end.b), f2.dot(&end.a), f2.dot(&end.b));
        let ours = wave.position_jacobian();
        // Snell's cosine loses digits as its square falls.
        let off = (ours - dual).norm() / ours.norm() * least * least;
        worst = worst.max(off);
        done += 1;
    }
    println!(
        "\n{done} chains by dual numbers: worst ‖ΔJ‖/‖J‖ times the least squared cosine {worst:.1e}"
    );
    assert!(worst < 1e-11);
}

/// Euler's formulas, interaction by interaction along whole chains, against the tensor.
#[test]
fn euler_agrees() {
    let bodies = all_bodies();
    let mut r = Random(13);
    let (mut worst, mut done, mut compared) = (0.0f64, 0, 0);
    while done < 10_000 {
        let Some(path) = random_path(&bodies, 1 + done % 6, None, &mut r) else { continue };
        let (direction, index) = path.beginning(Way::FromReceiver);
        let first = (path.vertices[0].local.x - path.start).norm();
        let mut wave = Wavefront::spherical(direction, index).transferred(first);
        let mut euler = wave.principal().unwrap();
        for (i, v) in path.vertices.iter().enumerate() {
            (wave, euler) = match v.interaction {
                Interaction::Reflection => {
                    (wave.reflected(&v.local).unwrap(), euler.reflected(&v.local).unwrap())
                }
                Interaction::Refraction => {
                    let n = v.index_toward_source;
                    (wave.refracted(&v.local, n).unwrap(), euler.refracted(&v.local, n).unwrap())
                }
            };
            let next = path.vertices.get(i + 1).map_or(path.end, |v| v.local.x);
            let way = (next - v.local.x).norm();
            (wave, euler) = (wave.transferred(way), euler.transferred(way));
            let k = wave.curvature().unwrap();
            let size = k.norm().max(1.0);
            // Digits are lost in proportion to K close to foci and where a cosine is small.
            if size > 1e4 {
                break;
            }
            let off = (euler.tensor(wave.frame()) - k).norm() / size;
            worst = worst.max(off);
            compared += 1;
        }
        done += 1;
    }
    println!("\nEuler's formulas against the tensor, {compared} vertices: worst {worst:.1e}");
    assert!(worst < 1e-9, "{worst}");
    assert!(compared > 30_000);
}
