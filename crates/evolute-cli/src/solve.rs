//! `evolute solve`: the radiosity solution of a scene, in a file.

use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use evolute::output::{check_target, replace_file};
use evolute::solve::{Checkpoint, encode_solution};
use evolute::trace::Tracer;

use crate::failure::Failure;
use crate::options::Common;
use crate::progress::Progress;
use crate::session::{self, Deadline};
use crate::solution::{self, Job};
use crate::summary::Summary;

/// Computes where light goes in a scene, for pictures and points that are asked for later
///
/// The file holds meshes over all diffuse surfaces, the direct, specular and indirect irradiance at their vertices, and
/// the energy ledger; render and probe read it with --solution. It belongs to the scene's shapes, materials and lamps:
/// the camera may be moved. A run that was interrupted, or stopped by --max-time or --max-iterations, keeps what it
/// has computed, and --resume goes on from there to the same bits.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  evolute solve desk.xml -o desk.evolute
  evolute solve desk.xml -o desk.evolute --resume    goes on after Ctrl-C or a limit
  evolute render desk.xml --solution desk.evolute -o desk.png")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML [default: the built-in room]
    scene: Option<PathBuf>,
    /// Where the solution goes
    #[arg(short = 'o', long, value_name = "FILE.evolute")]
    output: PathBuf,
    /// Go on from what is in that file, made with the same scene and options; begin if there is none
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    pub common: Common,
}

/// Runs the verb.
pub fn run(arguments: &Arguments, summary: &mut Summary) -> Result<(), Failure> {
    let (common, path) = (&arguments.common, arguments.output.as_path());
    let extension = path.extension().and_then(|e| e.to_str());
    if !extension.is_some_and(|e| e.eq_ignore_ascii_case("evolute")) {
        return Err(Failure::Usage(format!(
            "solve writes .evolute files, not '{}'",
            path.display()
        )));
    }
    check_target(path)?;
    let deadline = Deadline::new(common);
    let scene = session::load_or_built_in(arguments.scene.as_deref(), common, summary)?;
    let tracer = Tracer::new(&scene);
    let progress = Progress::new(common, "solution", 0);
    let transfer = session::transfer_settings(&scene, common);
    let job = Job {
        scene: &scene,
        tracer: &tracer,
        transfer,
        common,
        deadline: &deadline,
        progress: &progress,
    };
    summary.set("accuracy", transfer.relative);
    summary.set("accuracy_abs", transfer.absolute);
    let mut checkpoint = Checkpoint::default();
    if arguments.resume {
        match known(&job, path, summary)? {
            Some(known) => checkpoint = known,
            None => return Ok(()),
        }
    }
    summary.lap("prepare");

    session::begin_work();
    let settings = job.settings();
    let solved = job.solve(Some(&mut checkpoint));
    drop(progress);
    summary.lap("solve");
    let outcome = match solved {
        Ok(solver) => Some(solver.into_outcome()),
        Err(Failure::Interrupted) if !checkpoint.is_empty() => None,
        Err(failure) => return Err(failure),
    };
    if let Some(outcome) = &outcome {
        let accuracy = solution::tell(outcome, common, summary);
        solution::note_accuracy(&accuracy, outcome, common);
    }
    let is_complete = outcome.as_ref().is_some_and(|o| o.is_complete);
    let kept = (!is_complete).then_some(&checkpoint);
    let bytes = encode_solution(&scene, &settings, outcome.as_ref(), kept)
        .map_err(|e| Failure::Input(format!("cannot write '{}': {e}", path.display())))?;
    replace_file(path, &bytes)?;
    session::detail(common, &format!("wrote {} ({} bytes)", path.display(), bytes.len()));
    summary.file(path);
    summary.lap("write");
    match outcome {
        None => Err(Failure::Kept(path.into())),
        Some(_) if is_complete => Ok(()),
        Some(_) => Err(Failure::Limit(format!(
            "stopped by --max-time or --max-iterations: what there is of the solution is written; repeat the command \
             with --resume and without that limit to go on from '{}'",
            path.display()
        ))),
    }
}

/// What a run may go on from; none if nothing is left to do.
fn known(
    job: &Job<'_, '_>,
    path: &Path,
    summary: &mut Summary,
) -> Result<Option<Checkpoint>, Failure> {
    let name = path.display();
    if !path.try_exists().unwrap_or(true) {
        session::note(job.common, &format!("there is no '{name}' yet: beginning"));
        return Ok(Some(Checkpoint::default()));
    }
    let file = solution::read(path, job.scene)?;
    let resumable = file.is_resumable(&job.settings());
    resumable.map_err(|e| Failure::Input(format!("cannot go on from '{name}': {e}")))?;
    if let Some(outcome) = file.outcome.as_ref().filter(|o| o.is_complete) {
        solution::tell(outcome, job.common, summary);
        session::note(job.common, &format!("'{name}' is complete: nothing is left to do"));
        return Ok(None);
    }
    let checkpoint = file.checkpoint.unwrap_or_default();
    let (vertices, iterations) = checkpoint.counts();
    summary.set("resumed", json!({ "vertices": vertices, "iterations": iterations }));
    session::detail(
        job.common,
        &format!("going on from {vertices:?} vertices and {iterations} iterations"),
    );
    Ok(Some(checkpoint))
}
