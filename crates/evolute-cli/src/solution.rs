//! The first pass of a run: the radiosity solution that indirect light needs.

use serde_json::json;

use evolute::geometry::Rgb;
use evolute::scene::Scene;
use evolute::solve::{Ledger, Solver, SolverSettings};
use evolute::trace::Tracer;
use evolute::transfer::{Control, Order, TransferSettings};

use crate::failure::Failure;
use crate::options::Common;
use crate::session;
use crate::summary::Summary;

/// Iterations between two looks at the clock.
const ITERATIONS: u64 = 256;

/// Whether a solution is what was asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// What waits no longer matters.
    Converged,
    /// A limit came first.
    Stopped,
}

/// Solves a scene until what waits to be shot no longer matters, or a limit of the user's is reached.
pub fn solve<'s>(
    scene: &'s Scene,
    tracer: &Tracer<'_>,
    transfer: &TransferSettings,
    common: &Common,
    control: &Control<'_>,
    summary: &mut Summary,
) -> Result<(Solver<'s>, End), Failure> {
    let settings = SolverSettings { transfer: *transfer, ..SolverSettings::default() };
    let solver = Solver::new(scene, tracer, &settings, control);
    let mut solver = solver.ok_or(Failure::Interrupted)?;
    let mut end = if solver.is_complete() { End::Converged } else { End::Stopped };
    let first = solver.ledger().unshot.luminance();
    for iteration in 0u64.. {
        if common.max_iterations.is_some_and(|most| iteration >= most) {
            end = End::Stopped;
            break;
        }
        if iteration % ITERATIONS == 0 {
            match (control.order)() {
                Order::Go => {}
                Order::Finish => {
                    end = End::Stopped;
                    break;
                }
                Order::Abandon => return Err(Failure::Interrupted),
            }
            // What waits falls like a geometric series, so that its logarithm goes evenly.
            let left = solver.ledger().unshot.luminance() / first;
            let done = if left > 0.0 { left.ln() / LAST.ln() } else { 1.0 };
            (control.progress)("unshot flux", (done.clamp(0.0, 1.0) * 1000.0) as u64, 1000);
        }
        if solver.step().is_none() {
            break;
        }
    }
    solver.finish();
    tell(&solver, common, summary);
    Ok((solver, end))
}

/// The part of the flux that waits at the end of most runs.
const LAST: f64 = 1e-3;

/// What the solution took, and where the flux is.
fn tell(solver: &Solver<'_>, common: &Common, summary: &mut Summary) {
    let (counts, ledger) = (solver.counts(), solver.ledger());
    let unit = common.unit_factor();
    let flux = |f: Rgb| f.0.map(|x| x * unit);
    summary.set(
        "solution",
        json!({
            "iterations": { "diffuse": counts.diffuse, "specular": counts.specular },
            "vertices": counts.vertices, "patches": counts.patches,
            "links": counts.links, "rays": counts.rays, "correction": counts.correction,
        }),
    );
    summary.set(
        "ledger",
        json!({
            "emitted": flux(ledger.emitted), "absorbed": flux(ledger.absorbed),
            "escaped": flux(ledger.escaped), "unshot": flux(ledger.unshot),
            "cut": flux(ledger.cut), "discretisation": flux(ledger.discretisation),
        }),
    );
    session::detail(
        common,
        &format!(
            "solution: {} diffuse and {} specular iterations, {:?} vertices, {} links\n{}",
            counts.diffuse,
            counts.specular,
            counts.vertices,
            counts.links[0] + counts.links[1],
            shares(ledger)
        ),
    );
}

/// The ledger in percent of what was emitted.
fn shares(ledger: &Ledger) -> String {
    let all = ledger.emitted.luminance();
    let percent = |f: Rgb| if all > 0.0 { 100.0 * f.luminance() / all } else { 0.0 };
    format!(
        "of the flux emitted {:.3} % was absorbed, {:.3} % escaped, {:.3} % is unshot, {:.4} % was cut, {:+.4} % is \
         discretisation",
        percent(ledger.absorbed),
        percent(ledger.escaped),
        percent(ledger.unshot),
        percent(ledger.cut),
        percent(ledger.discretisation),
    )
}
