//! `evolute probe`: irradiance at the points of a table.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use evolute::geometry::Rgb;
use evolute::output::{check_target, replace_file};
use evolute::solve::{Probe, ProbeLight};
use evolute::trace::Tracer;
use evolute::transfer::{Components, Counts, LONGEST_CHAIN, TransferSettings};

use crate::failure::Failure;
use crate::options::Common;
use crate::points::Points;
use crate::progress::Progress;
use crate::session::{self, Deadline};
use crate::solution::{self, Job};
use crate::summary::Summary;
use crate::table::{Asked, Table};

/// Irradiance at the points of a table
///
/// The table is CSV with the header x,y,z,nx,ny,nz (positions in metres; normals of any length);
/// further columns are carried through. The result has the same rows in the same order, then
/// direct_r, direct_g, direct_b, specular_r, … of the components asked for, and error: the estimated
/// absolute error of the luminance of their sum. All in W/m². Indirect light and the total need a radiosity
/// solution, which is made, or read with --solution.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  evolute probe desk.xml --points grid.csv --solution desk.evolute -o light.csv
  printf 'x,y,z,nx,ny,nz\\n0,0,0.76,0,0,1\\n' | \
    evolute probe desk.xml --points - --components direct,specular -a 1e-3")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML
    scene: PathBuf,
    /// The table of receivers; - reads standard input
    #[arg(long, value_name = "FILE.csv|-")]
    points: PathBuf,
    /// Where the result goes; - is standard output
    #[arg(short = 'o', long, value_name = "FILE.csv|.npz|-", default_value = "-")]
    output: PathBuf,
    /// Parts of the irradiance: direct, specular (by mirrors and lenses), indirect (by way of other diffuse surfaces),
    /// total [default: all four]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    components: Vec<String>,
    /// A radiosity solution of the scene that 'evolute solve' wrote [default: one is made if it is needed]
    #[arg(long, value_name = "FILE.evolute")]
    solution: Option<PathBuf>,
    #[command(flatten)]
    pub common: Common,
}

/// The kinds of files.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Csv,
    Npz,
}

/// Runs the verb.
pub fn run(arguments: &Arguments, summary: &mut Summary) -> Result<(), Failure> {
    let common = &arguments.common;
    let asked = Asked::parse(&arguments.components)?;
    let format = format_of(&arguments.output)?;
    let to_stdout = arguments.output == Path::new("-");
    if !to_stdout {
        check_target(&arguments.output)?;
        check_input(arguments)?;
    }
    let deadline = Deadline::new(common);
    let points = read_points(&arguments.points)?;
    if let Some(clash) = asked.columns().iter().find(|c| points.columns.contains(c)) {
        return Err(Failure::Input(format!(
            "the table already has a column '{clash}', which probe writes; rename or remove it"
        )));
    }
    if format == Format::Npz {
        asked.check_arrays(&points)?;
    }
    let scene = session::load(&arguments.scene, common, summary)?;
    let tracer = Tracer::new(&scene);
    let transfer = session::transfer_settings(&scene, common);
    // Mitsuba's max_depth counts the edges of a path: one from a lamp straight to the receiver.
    let depth = scene.max_depth.unwrap_or(u32::MAX);
    let max_specular = transfer.max_specular.min(depth.saturating_sub(1));
    let settings = TransferSettings { max_specular, ..transfer };
    let computed = Components {
        direct: (asked.direct || asked.total) && depth > 0,
        specular: (asked.specular || asked.total) && max_specular > 0,
    };
    // Another one takes the diffuse reflection.
    let is_indirect = (asked.indirect || asked.total) && depth > 1;
    summary.lap("prepare");

    session::begin_work();
    let progress = Progress::new(common, "receivers", 0);
    let file = arguments.solution.as_deref();
    let job = Job {
        scene: &scene,
        tracer: &tracer,
        transfer,
        common,
        // What lamps send is computed even if there is no time for the rest.
        deadline: &deadline.half(),
        progress: &progress,
    };
    let outcome = if is_indirect { Some(job.outcome(file, summary)?) } else { None };
    let shortfall = outcome.as_ref().and_then(|o| solution::shortfall(o, file));
    summary.lap("solve");
    let probe = Probe::new(&scene, &tracer, &settings, computed, outcome.as_ref());
    progress.begin("receivers", points.receivers.len() as u64);
    let lights: Vec<Option<ProbeLight>> = points
        .receivers
        .par_iter()
        .map(|receiver| {
            let stop = || session::interrupted() || deadline.passed();
            if stop() {
                return None;
            }
            let light = probe.light(&receiver.settled(&tracer), &stop);
            progress.step();
            Some(light)
        })
        .collect();
    drop(progress);
    if session::interrupted() {
        return Err(Failure::Interrupted);
    }
    let seconds = summary.lap("compute");

    let mut counts = Counts::default();
    lights.iter().flatten().for_each(|light| counts += light.counts);
    let done = lights.iter().flatten().count();
    let unmet = lights.iter().flatten().filter(|light| !light.met).count();
    let stopped = lights.iter().flatten().filter(|light| light.stopped).count();
    let factor = common.unit_factor();
    let worst = lights.iter().flatten().map(|l| l.error * factor).fold(0.0, f64::max);
    summary.counts(done as u64, &counts);
    summary.set("receivers_unmet", unmet);
    summary.set("receivers_stopped", stopped);
    summary.set("receivers_left_out", lights.len() - done);
    summary.set("largest_error", worst);
    summary.set("accuracy", settings.relative);
    summary.set("accuracy_abs", settings.absolute);
    summary.set("max_specular", settings.max_specular.min(LONGEST_CHAIN));
    session::detail(
        common,
        &format!(
            "{done} receivers, {} chains, {} rays in {seconds:.3} s",
            counts.chains, counts.rays
        ),
    );

    let table = Table { points: &points, lights: &lights, asked, factor };
    let bytes = match format {
        Format::Csv => table.csv().into_bytes(),
        Format::Npz => table.npz()?,
    };
    if to_stdout {
        session::print(&bytes)?;
    } else {
        replace_file(&arguments.output, &bytes)?;
        summary.file(&arguments.output);
    }
    summary.lap("write");
    if unmet > 0 {
        session::note(
            common,
            &format!(
                "{unmet} of {done} receivers did not reach their tolerance; column error says what \
                 they reached"
            ),
        );
    }
    let at_edges = points.receivers.iter().filter(|r| r.is_at_edge(&tracer)).count();
    if at_edges > 0 {
        session::note(
            common,
            &format!(
                "{at_edges} receivers lie on lines where surfaces meet: the light of one of them, and what is beyond it, \
                 counts as dark there; move them off by a millimetre"
            ),
        );
    }
    let is_dark = |l: &&ProbeLight| !l.stopped && l.total() == Rgb::BLACK;
    let dark = lights.iter().flatten().filter(is_dark).count();
    if dark > 0 && asked.total {
        session::note(
            common,
            &format!(
                "{dark} of {done} receivers get no light at all: if that is not expected, see whether they lie inside a \
                 body or outside of the room, or face the other way"
            ),
        );
    }
    if done < lights.len() || stopped > 0 {
        return Err(Failure::Limit(format!(
            "stopped by --max-time: of {} receivers, {} were not computed and are written as nan, with \
             error inf; {stopped} were given up half-way, what they lack being in their error",
            lights.len(),
            lights.len() - done,
        )));
    }
    match shortfall {
        None => Ok(()),
        Some(why) => Err(Failure::Limit(format!(
            "{why}: indirect light is written as far as it is known, with an error that says so"
        ))),
    }
}

fn format_of(output: &Path) -> Result<Format, Failure> {
    let extension = output.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        _ if output == Path::new("-") => Ok(Format::Csv),
        Some("csv") => Ok(Format::Csv),
        Some("npz") => Ok(Format::Npz),
        _ => Err(Failure::Usage(format!(
            "probe writes .csv and .npz files, not '{}'",
            output.display()
        ))),
    }
}

/// Refuses to write over the table that is read.
fn check_input(arguments: &Arguments) -> Result<(), Failure> {
    let place = |path: &Path| path.canonicalize().ok();
    match (place(&arguments.output), place(&arguments.points)) {
        (Some(output), Some(input)) if output == input => Err(Failure::Usage(format!(
            "the result would overwrite the table of points '{}'; give --output another name",
            arguments.points.display()
        ))),
        _ => Ok(()),
    }
}

/// Tables beyond this are refused: what is kept of them while they are read takes some ten times as much.
const LARGEST_TABLE: u64 = 1 << 30;

fn read_points(path: &Path) -> Result<Points, Failure> {
    let name =
        if path == Path::new("-") { "standard input".into() } else { path.display().to_string() };
    let read = || {
        let mut bytes = Vec::new();
        // A pipe, or a device, may never end.
        let most = LARGEST_TABLE + 1;
        if path == Path::new("-") {
            std::io::stdin().lock().take(most).read_to_end(&mut bytes)?;
        } else {
            std::fs::File::open(path)?.take(most).read_to_end(&mut bytes)?;
        }
        Ok(bytes)
    };
    let bytes: Vec<u8> = read().map_err(|e: std::io::Error| {
        let why = match e.kind() {
            ErrorKind::NotFound => "there is no such file".into(),
            ErrorKind::IsADirectory => "it is a folder".into(),
            ErrorKind::PermissionDenied => "permission denied".into(),
            _ => e.to_string(),
        };
        Failure::Input(format!(
            "cannot read the table '{name}': {why}; name a CSV file, or - for standard input"
        ))
    })?;
    if bytes.len() as u64 > LARGEST_TABLE {
        return Err(Failure::Input(format!(
            "the table '{name}' is longer than 1 GiB; split it into several"
        )));
    }
    Points::read(&bytes, &name).map_err(Failure::Input)
}
