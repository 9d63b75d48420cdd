//! `evolute render`: a picture of a scene.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;

use evolute::output::{
    Exposure, ExrAttributes, Raster, check_target, encode_exr, encode_png, encode_radiance,
    replace_file,
};
use evolute::trace::Tracer;
use evolute::transfer::{Control, Order};
use evolute::view::{Mode, Picture, ViewSettings};

use crate::failure::Failure;
use crate::options::{self, Common};
use crate::progress::Progress;
use crate::session::{self, Deadline};
use crate::solution::{self, Job};
use crate::summary::Summary;

/// Draws a scene: direct light, caustics and what diffuse surfaces pass on, seen through mirrors and glass
///
/// EXR holds radiance in W/(m² sr) as layers: R,G,B is the sum of direct (light that came to the last
/// diffuse surface straight from lamps), specular (by mirrors and lenses), indirect (by way of other diffuse
/// surfaces) and emitted (lamps seen).
/// Z is the length of the path to the first diffuse surface in m, N its normal, irradiance what it
/// receives in W/m². PNG and Radiance .hdr hold the sum.
#[derive(Args, Debug)]
#[command(after_help = "\
Examples:
  evolute render                                 writes room.exr and room.png here
  evolute render desk.xml -o desk.png --size 1280x960 --exposure -1
  evolute render desk.xml --solution desk.evolute    with indirect light from what solve wrote")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML [default: the built-in room]
    scene: Option<PathBuf>,
    /// Where the picture goes [default: NAME.exr and NAME.png in the current folder]
    #[arg(short = 'o', long, value_name = "FILE.exr|.png|.hdr")]
    output: Option<PathBuf>,
    /// A radiosity solution of the scene that 'evolute solve' wrote [default: one is made]
    #[arg(long, value_name = "FILE.evolute")]
    solution: Option<PathBuf>,
    /// Columns and rows of the picture [default: the scene's film]
    #[arg(long, value_name = "WxH", value_parser = options::size, allow_hyphen_values = true)]
    size: Option<(u32, u32)>,
    /// Where light on surfaces comes from: read off the meshes of the radiosity solution, or direct and specular light
    /// computed anew and indirect light gathered
    #[arg(long, value_enum, default_value_t = ModeName::Recompute)]
    mode: ModeName,
    /// Brightness of the PNG: radiance times 2^EV, 1 being nearly white [default: found from the
    /// picture, and told]
    #[arg(long, value_name = "EV", value_parser = options::stops, allow_hyphen_values = true)]
    exposure: Option<f64>,
    #[command(flatten)]
    pub common: Common,
}

/// [`Mode`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum ModeName {
    Mesh,
    Recompute,
}

impl From<ModeName> for Mode {
    fn from(name: ModeName) -> Self {
        match name {
            ModeName::Mesh => Self::Mesh,
            ModeName::Recompute => Self::Recompute,
        }
    }
}

/// The kinds of files.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Exr,
    Png,
    Radiance,
}

/// Runs the verb.
pub fn run(arguments: &Arguments, summary: &mut Summary) -> Result<(), Failure> {
    let common = &arguments.common;
    let files = targets(arguments)?;
    for (path, _) in &files {
        check_target(path)?;
    }
    let deadline = Deadline::new(common);
    let scene = session::load_or_built_in(arguments.scene.as_deref(), common, summary)?;
    let Some(sensor) = scene.sensors.first() else {
        return Err(Failure::Input(
            "the scene has no sensor, so there is nothing to look from; add \
             <sensor type=\"perspective\">"
                .into(),
        ));
    };
    let tracer = Tracer::new(&scene);
    let transfer = session::transfer_settings(&scene, common);
    let settings = ViewSettings { transfer, size: arguments.size, mode: arguments.mode.into() };
    summary.lap("prepare");

    session::begin_work();
    let progress = Progress::new(common, "picture", 0);
    let control = Control {
        order: &|| {
            if session::interrupted() {
                Order::Abandon
            } else if deadline.passed() {
                Order::Finish
            } else {
                Order::Go
            }
        },
        progress: &|stage, done, total| progress.set(stage, done, total),
    };
    let job = Job {
        scene: &scene,
        tracer: &tracer,
        transfer,
        common,
        // What lamps send is to be seen even if there is no time for the rest.
        deadline: &deadline.half(),
        progress: &progress,
    };
    let file = arguments.solution.as_deref();
    let outcome = job.outcome(file, summary)?;
    let shortfall = solution::shortfall(&outcome, file);
    summary.lap("solve");
    let picture = evolute::view::render(
        &scene,
        &tracer,
        sensor,
        Some(&outcome.solution),
        &settings,
        &control,
    );
    drop(progress);
    let picture = picture.filter(|_| !session::interrupted()).ok_or(Failure::Interrupted)?;
    let seconds = summary.lap("compute");
    summary.counts(picture.receivers, &picture.counts);
    summary.set("receivers_unmet", picture.unmet);
    summary.set("largest_error", picture.largest_error * common.unit_factor());
    summary.set("accuracy", transfer.relative);
    summary.set("accuracy_abs", transfer.absolute);
    summary.set("camera", json!({
        "nodes": picture.nodes, "samples": picture.samples, "rays": picture.rays, "cut": picture.cut,
    }));
    session::detail(
        common,
        &format!(
            "{} × {} pixels, {} receivers, {} chains, {} samples in {seconds:.1} s",
            picture.width,
            picture.height,
            picture.receivers,
            picture.counts.chains,
            picture.samples
        ),
    );

    let (unmet, receivers) = (picture.unmet, picture.receivers);
    let is_complete = picture.complete;
    let raster = raster(picture, common.unit_factor() as f32);
    let exposure = exposure(arguments, &raster);
    if files.iter().any(|(_, format)| *format == Format::Png) {
        summary.set("exposure", exposure.ev);
        if arguments.exposure.is_none() {
            session::detail(common, &format!("--exposure {}", exposure.ev));
        }
    }
    let mut encoded = Vec::new();
    for (path, format) in &files {
        match format {
            Format::Exr => {}
            Format::Png => encoded.push((path, encode_png(&raster, exposure)?)),
            Format::Radiance => encoded.push((path, encode_radiance(&raster)?)),
        }
    }
    // Last, as it takes the raster, which can be large.
    if let Some((path, _)) = files.iter().find(|(_, format)| *format == Format::Exr) {
        encoded.insert(0, (path, encode_exr(raster, &attributes(&scene.name, common))?));
    }
    for (path, bytes) in encoded {
        replace_file(path, &bytes)?;
        session::detail(common, &format!("wrote {}", path.display()));
        summary.file(path);
    }
    summary.lap("write");
    if unmet > 0 {
        session::note(
            common,
            &format!("{} of {} receivers did not reach their tolerance", unmet, receivers),
        );
    }
    let shortfall = if is_complete { shortfall } else { Some("stopped by --max-time".into()) };
    match shortfall {
        None => Ok(()),
        Some(why) => Err(Failure::Limit(format!(
            "{why}: the picture is written, but coarser than asked for"
        ))),
    }
}

/// The files to write.
fn targets(arguments: &Arguments) -> Result<Vec<(PathBuf, Format)>, Failure> {
    let Some(path) = &arguments.output else {
        let name = match arguments.scene.as_deref() {
            None => "room".into(),
            Some(scene) => name_of(scene)?,
        };
        return Ok(vec![
            (format!("{name}.exr").into(), Format::Exr),
            (format!("{name}.png").into(), Format::Png),
        ]);
    };
    let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
    let format = match extension.as_deref() {
        Some("exr") => Format::Exr,
        Some("png") => Format::Png,
        Some("hdr") => Format::Radiance,
        _ => {
            return Err(Failure::Usage(format!(
                "render writes .exr, .png and .hdr files, not '{}'",
                path.display()
            )));
        }
    };
    Ok(vec![(path.clone(), format)])
}

/// A scene file's name without folder and extension.
fn name_of(scene: &Path) -> Result<String, Failure> {
    let stem = scene.file_stem().map(|s| s.to_string_lossy().into_owned());
    stem.ok_or_else(|| Failure::Usage(format!("'{}' names no file", scene.display())))
}

fn exposure(arguments: &Arguments, raster: &Raster) -> Exposure {
    match (arguments.exposure, raster.rgb("")) {
        (Some(ev), _) => Exposure { ev },
        (None, Some(rgb)) => Exposure::automatic(rgb),
        (None, None) => Exposure { ev: 0.0 },
    }
}

fn attributes(scene: &str, common: &Common) -> ExrAttributes {
    let (radiance, irradiance) =
        if common.photometric { ("cd/m^2", "lx") } else { ("W/(m^2 sr)", "W/m^2") };
    ExrAttributes {
        scene: scene.into(),
        units: format!(
            "R,G,B and the layers direct, specular, indirect, emitted: radiance in {radiance}; irradiance: \
             {irradiance}; Z: m along the path; N: unit normal"
        ),
        comments: format!(
            "direct, specular and indirect light, relative accuracy {}",
            common.accuracy
        ),
    }
}

/// The picture's layers as channels, radiance and irradiance times `factor`.
fn raster(picture: Picture, factor: f32) -> Raster {
    let mut raster = Raster::new(picture.width, picture.height);
    let scaled = |v: [f32; 3]| v.map(|x| x * factor);
    raster.push_rgb("", picture.radiance().map(scaled));
    for (name, layer) in [
        ("direct", picture.direct),
        ("specular", picture.specular),
        ("indirect", picture.indirect),
        ("emitted", picture.emitted),
        ("irradiance", picture.irradiance),
    ] {
        raster.push_rgb(name, layer.iter().copied().map(scaled));
    }
    raster.push("Z", picture.distance);
    for (i, axis) in ["N.X", "N.Y", "N.Z"].into_iter().enumerate() {
        raster.push(axis, picture.normal.iter().map(|n| n[i]).collect());
    }
    raster
}
