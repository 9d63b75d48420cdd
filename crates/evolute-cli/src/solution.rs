//! The first pass of a run: the radiosity solution that indirect light needs, made or read from a file.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use serde_json::json;

use evolute::geometry::Rgb;
use evolute::scene::Scene;
use evolute::solve::{
    Accuracy, Checkpoint, Component, Ledger, Outcome, SolutionError, SolutionFile, Solver,
    SolverSettings, decode_solution,
};
use evolute::trace::Tracer;
use evolute::transfer::{Control, Order, TransferSettings};

use crate::failure::Failure;
use crate::options::Common;
use crate::progress::Progress;
use crate::session::{self, Deadline};
use crate::summary::Summary;

/// Iterations between two looks at the clock.
const ITERATIONS: u64 = 256;

/// The part of the flux that waits at the end of most runs.
const LAST: f64 = 1e-3;

/// What flux may be scaled by before people are told.
const CORRECTED: f64 = 0.02;

/// A mean reflectance at which people who wait should be told why.
const BRIGHT: f64 = 0.98;

/// What a solution is made from, and how that is watched.
pub struct Job<'j, 's> {
    pub scene: &'s Scene,
    pub tracer: &'j Tracer<'j>,
    pub transfer: TransferSettings,
    pub common: &'j Common,
    pub deadline: &'j Deadline,
    pub progress: &'j Progress,
}

impl<'s> Job<'_, 's> {
    /// What is asked of the solution.
    pub fn settings(&self) -> SolverSettings {
        SolverSettings { transfer: self.transfer, ..SolverSettings::default() }
    }

    /// The solution in a file if one is named, else one that is made. It may be less than complete.
    pub fn outcome(
        &self,
        file: Option<&Path>,
        summary: &mut Summary,
    ) -> Result<Outcome<'s>, Failure> {
        let outcome = match file {
            None => self.solve(None)?.into_outcome(),
            Some(path) => {
                let read = read(path, self.scene)?;
                let made_with = read.settings.transfer.relative;
                if made_with > self.transfer.relative {
                    session::note(
                        self.common,
                        &format!(
                            "the solution was made with --accuracy {made_with}: indirect light is no better than \
                             that, whatever is asked for here"
                        ),
                    );
                }
                read.outcome.ok_or_else(|| {
                    Failure::Input(format!(
                        "the solution '{}' was interrupted before it was one; repeat the run that made it, \
                         with --resume",
                        path.display()
                    ))
                })?
            }
        };
        tell(&outcome, self.common, summary);
        Ok(outcome)
    }

    /// Solves until what waits to be shot no longer matters, or a limit of the user's is reached. What a checkpoint
    /// knows is not computed again; it also gets what was computed, and so if the run is interrupted.
    pub fn solve(&self, mut checkpoint: Option<&mut Checkpoint>) -> Result<Solver<'s>, Failure> {
        let order = || self.order();
        let progress = |stage, done, total| self.progress.set(stage, done, total);
        let control = Control { order: &order, progress: &progress };
        let settings = self.settings();
        let (scene, tracer) = (self.scene, self.tracer);
        let solver = match &mut checkpoint {
            None => Solver::new(scene, tracer, &settings, &control),
            Some(known) => Solver::resume(scene, tracer, &settings, &control, known),
        };
        let mut solver = solver.ok_or(Failure::Interrupted)?;
        let (_, reflected) = solver.solution().layer(Component::Indirect).area_and_reflectance();
        if reflected > BRIGHT {
            session::note(
                self.common,
                &format!(
                    "diffuse surfaces reflect {:.1} % of the light, in the mean: what stays among them takes very many \
                     iterations to come to rest; --max-time or --max-iterations end them before",
                    100.0 * reflected
                ),
            );
        }
        let first = solver.ledger().unshot.luminance();
        let mut turn = 0u64;
        let ended = loop {
            let iterations = solver.counts().iterations();
            if self.common.max_iterations.is_some_and(|most| iterations >= most) {
                break Ok(());
            }
            if turn.is_multiple_of(ITERATIONS) {
                match self.order() {
                    Order::Go => {}
                    Order::Finish => break Ok(()),
                    Order::Abandon => break Err(Failure::Interrupted),
                }
                let ledger = solver.ledger();
                let (unshot, emitted) = (ledger.unshot.luminance(), ledger.emitted.luminance());
                // What waits falls like a geometric series, so that its logarithm goes evenly.
                let left = unshot / first;
                let done = if left > 0.0 { left.ln() / LAST.ln() } else { 1.0 };
                self.progress.set_unshot(unshot / emitted, done.clamp(0.0, 1.0));
            }
            if solver.step().is_none() {
                break Ok(());
            }
            turn += 1;
        };
        if let Some(checkpoint) = checkpoint {
            solver.keep_state(checkpoint);
        }
        ended.map(|()| solver)
    }

    /// Whether to go on.
    fn order(&self) -> Order {
        if session::interrupted() {
            Order::Abandon
        } else if self.deadline.passed() {
            Order::Finish
        } else {
            Order::Go
        }
    }
}

/// Reads a solution of a scene.
pub fn read<'s>(path: &Path, scene: &'s Scene) -> Result<SolutionFile<'s>, Failure> {
    let name = path.display();
    let bytes = bytes_of(path, scene).map_err(|e| {
        let why = match e.kind() {
            ErrorKind::NotFound => "there is no such file".into(),
            ErrorKind::PermissionDenied => "permission denied".into(),
            _ => e.to_string(),
        };
        Failure::Input(format!(
            "cannot read the solution '{name}': {why}; name a file that 'evolute solve' wrote"
        ))
    })?;
    let decoded = decode_solution(&bytes, scene);
    decoded.map_err(|e| Failure::Input(format!("cannot use the solution '{name}': {e}")))
}

/// A file's bytes; of what is no solution only the first.
fn bytes_of(path: &Path, scene: &Scene) -> std::io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    if !file.metadata()?.is_file() {
        return Err(std::io::Error::other("it is no file"));
    }
    let mut bytes = Vec::new();
    file.by_ref().take(64).read_to_end(&mut bytes)?;
    if !matches!(decode_solution(&bytes, scene), Err(SolutionError::Foreign)) {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}

/// What the solution took, where the flux is, and how well the light is known, which is returned.
pub fn tell(outcome: &Outcome<'_>, common: &Common, summary: &mut Summary) -> Accuracy {
    let (counts, ledger) = (&outcome.counts, &outcome.ledger);
    let unit = common.unit_factor();
    let flux = |f: Rgb| f.0.map(|x| x * unit);
    let transfer = &outcome.settings.transfer;
    let accuracy = outcome.solution.accuracy(transfer.relative, transfer.absolute);
    summary.set(
        "solution",
        json!({
            "complete": outcome.is_complete,
            "iterations": { "diffuse": counts.diffuse, "specular": counts.specular },
            "vertices": counts.vertices, "patches": counts.patches,
            "links": counts.links, "rays": counts.rays, "correction": counts.correction,
            "mean_error": accuracy.mean, "area_within_accuracy": accuracy.met,
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
            "solution: {} diffuse and {} specular iterations, {:?} vertices, {} links\nestimated error of the light on \
             surfaces: {:.2} % in the mean, within the accuracy on {:.1} % of the area\n{}",
            counts.diffuse,
            counts.specular,
            counts.vertices,
            counts.links[0] + counts.links[1],
            100.0 * accuracy.mean,
            100.0 * accuracy.met,
            shares(ledger)
        ),
    );
    let correction = counts.correction;
    if correction > CORRECTED {
        session::note(
            common,
            &format!(
                "meshes do not resolve how light comes to some places (through narrow gaps, as it seems): reflected light \
                 was scaled by {:.1} % to conserve flux, and may be wrong by more than its error figures",
                100.0 * correction
            ),
        );
    }
    accuracy
}

/// Says so if the light on surfaces is not known as well as was asked for, though no limit of the user's stopped the run.
pub fn note_accuracy(accuracy: &Accuracy, outcome: &Outcome<'_>, common: &Common) {
    let asked = outcome.settings.transfer.relative;
    if outcome.is_complete && accuracy.mean > asked {
        session::note(
            common,
            &format!(
                "the light on surfaces is known to {:.2} % in the mean, as far as it can be estimated: not to the {} % \
                 of --accuracy; a smaller one brings it down",
                100.0 * accuracy.mean,
                100.0 * asked
            ),
        );
    }
}

/// Why a result is less than was asked for, if it is the solution's fault, and what may be done.
pub fn shortfall(outcome: &Outcome<'_>, file: Option<&Path>) -> Option<String> {
    if outcome.is_complete {
        return None;
    }
    Some(match file {
        None => "the radiosity solution was stopped by --max-time or --max-iterations".into(),
        Some(path) => format!(
            "a limit stopped the run that made '{}'; repeat that run with --resume to go on",
            path.display()
        ),
    })
}

/// The ledger in percent of what was emitted.
fn shares(ledger: &Ledger) -> String {
    let all = ledger.emitted.luminance();
    // Rounding has no sign.
    let rounded = |x: f64, scale: f64| (x * scale).round() / scale + 0.0;
    let percent = |f: Rgb, digits: i32| {
        let part = if all > 0.0 { 100.0 * f.luminance() / all } else { 0.0 };
        rounded(part, 10f64.powi(digits))
    };
    format!(
        "of the flux emitted {:.3} % was absorbed, {:.3} % escaped, {:.3} % is unshot, {:.4} % was cut, {:+.4} % is \
         discretisation",
        percent(ledger.absorbed, 3),
        percent(ledger.escaped, 3),
        percent(ledger.unshot, 3),
        percent(ledger.cut, 4),
        percent(ledger.discretisation, 4),
    )
}
