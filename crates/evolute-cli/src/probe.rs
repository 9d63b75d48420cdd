//! `evolute probe`: irradiance at the points of a table.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use clap::Args;
use rayon::prelude::*;

use evolute::output::{
    Array, ArrayData, check_target, csv_field, csv_number, encode_npz, replace_file,
};
use evolute::trace::Tracer;
use evolute::transfer::{Components, Counts, LONGEST_CHAIN, ReceiverLight, Transfer};

use crate::failure::Failure;
use crate::options::Common;
use crate::points::Points;
use crate::progress::Progress;
use crate::session::{self, Deadline};
use crate::summary::Summary;

/// Irradiance at the points of a table
///
/// The table is CSV with the header x,y,z,nx,ny,nz (positions in metres; normals of any length);
/// further columns are carried through. The result has the same rows in the same order, then
/// direct_r, direct_g, direct_b, specular_r, … of the components asked for, and error: the estimated
/// absolute error of the luminance of their sum. All in W/m².
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  printf 'x,y,z,nx,ny,nz\\n0,0,0.76,0,0,1\\n' | evolute probe desk.xml --points - -a 1e-3")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML
    scene: PathBuf,
    /// The table of receivers; - reads standard input
    #[arg(long, value_name = "FILE.csv|-")]
    points: PathBuf,
    /// Where the result goes; - is standard output
    #[arg(short = 'o', long, value_name = "FILE.csv|.npz|-", default_value = "-")]
    output: PathBuf,
    /// Parts of the irradiance: direct, specular [default: both; the radiosity solution that indirect
    /// and total need is not part of this version]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    components: Vec<String>,
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
    let asked = components(&arguments.components)?;
    let format = format_of(&arguments.output)?;
    let to_stdout = arguments.output == Path::new("-");
    if !to_stdout {
        check_target(&arguments.output)?;
        check_input(arguments)?;
    }
    let deadline = Deadline::new(common);
    let points = read_points(&arguments.points)?;
    let results = result_columns(asked);
    if let Some(clash) = results.iter().find(|c| points.columns.contains(c)) {
        return Err(Failure::Input(format!(
            "the table already has a column '{clash}', which probe writes; rename or remove it"
        )));
    }
    if format == Format::Npz {
        check_arrays(&points, asked)?;
    }
    let scene = session::load(&arguments.scene, common, summary)?;
    let tracer = Tracer::new(&scene);
    let mut settings = session::transfer_settings(&scene, common);
    // Mitsuba's max_depth counts the edges of a path: one from a lamp straight to the receiver.
    let depth = scene.max_depth.unwrap_or(u32::MAX);
    settings.max_specular = settings.max_specular.min(depth.saturating_sub(1));
    let computed = Components {
        direct: asked.direct && depth > 0,
        specular: asked.specular && settings.max_specular > 0,
    };
    let transfer = Transfer::new(&scene, &tracer, settings);
    summary.lap("prepare");

    session::begin_work();
    let progress = Progress::new(common, "receivers", points.receivers.len() as u64);
    let lights: Vec<Option<ReceiverLight>> = points
        .receivers
        .par_iter()
        .map(|receiver| {
            let stop = || session::interrupted() || deadline.passed();
            if stop() {
                return None;
            }
            let light = transfer.light_until(receiver, computed, 0.0, &stop);
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
        Format::Csv => table.csv(&results).into_bytes(),
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
    if done < lights.len() || stopped > 0 {
        return Err(Failure::Limit(format!(
            "stopped by --max-time: of {} receivers, {} were not computed and are written as nan, with \
             error inf; {stopped} were given up half-way, what they lack being in their error",
            lights.len(),
            lights.len() - done,
        )));
    }
    Ok(())
}

/// What the list asks for.
fn components(list: &[String]) -> Result<Components, Failure> {
    if list.is_empty() {
        return Ok(Components { direct: true, specular: true });
    }
    let mut asked = Components { direct: false, specular: false };
    for name in list {
        match name.trim() {
            "direct" => asked.direct = true,
            "specular" => asked.specular = true,
            "indirect" | "total" => {
                return Err(Failure::Usage(format!(
                    "component '{}' needs the radiosity solution, which is not part of this version; \
                     ask for --components direct,specular",
                    name.trim()
                )));
            }
            other => {
                return Err(Failure::Usage(format!(
                    "'{other}' is not a component; they are direct and specular"
                )));
            }
        }
    }
    Ok(asked)
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

/// Refuses carried columns that would get the name of an array of the result.
fn check_arrays(points: &Points, asked: Components) -> Result<(), Failure> {
    let taken = |name: &str| match name {
        "position" | "normal" | "error" => true,
        "direct" => asked.direct,
        "specular" => asked.specular,
        _ => false,
    };
    match points.columns.iter().find(|name| taken(name)) {
        None => Ok(()),
        Some(clash) => Err(Failure::Input(format!(
            "the table has a column '{clash}', and the .npz file an array of that name; rename the \
             column, or write .csv"
        ))),
    }
}

/// The names of the columns that are added.
fn result_columns(asked: Components) -> Vec<String> {
    let mut names = Vec::new();
    for (name, wanted) in [("direct", asked.direct), ("specular", asked.specular)] {
        if wanted {
            names.extend(["r", "g", "b"].map(|channel| format!("{name}_{channel}")));
        }
    }
    names.push("error".into());
    names
}

/// The result, ready to be written.
struct Table<'a> {
    points: &'a Points,
    lights: &'a [Option<ReceiverLight>],
    asked: Components,
    /// From W to the unit asked for.
    factor: f64,
}

impl Table<'_> {
    /// What is added to a row: the components asked for, then the error.
    fn values(&self, light: Option<&ReceiverLight>) -> Vec<f64> {
        let mut values = Vec::with_capacity(7);
        let part = |rgb: fn(&ReceiverLight) -> [f64; 3]| {
            light.map_or([f64::NAN; 3], |l| rgb(l).map(|x| x * self.factor))
        };
        if self.asked.direct {
            values.extend(part(|l| l.direct.0));
        }
        if self.asked.specular {
            values.extend(part(|l| l.specular.0));
        }
        values.push(light.map_or(f64::INFINITY, |l| l.error * self.factor));
        values
    }

    fn csv(&self, results: &[String]) -> String {
        let names = self.points.columns.iter().chain(results).map(|c| csv_field(c));
        let mut text = names.collect::<Vec<_>>().join(",") + "\n";
        for (row, light) in self.points.rows.iter().zip(self.lights) {
            for field in row {
                text += &csv_field(field);
                text.push(',');
            }
            let values = self.values(light.as_ref()).into_iter().map(csv_number);
            text += &values.collect::<Vec<_>>().join(",");
            text.push('\n');
        }
        text
    }

    fn npz(&self) -> Result<Vec<u8>, Failure> {
        let n = self.lights.len();
        let triples = |name: &str, values: Vec<f64>| Array {
            name: name.into(),
            shape: vec![n, 3],
            data: ArrayData::F64(values),
        };
        let receivers = &self.points.receivers;
        let mut arrays = vec![
            triples(
                "position",
                receivers.iter().flat_map(|r| [r.position.x, r.position.y, r.position.z]).collect(),
            ),
            triples(
                "normal",
                receivers.iter().flat_map(|r| [r.normal.x, r.normal.y, r.normal.z]).collect(),
            ),
        ];
        let values: Vec<Vec<f64>> = self.lights.iter().map(|l| self.values(l.as_ref())).collect();
        let mut at = 0;
        for (name, wanted) in [("direct", self.asked.direct), ("specular", self.asked.specular)] {
            if wanted {
                let part = values.iter().flat_map(|v| v[at..at + 3].iter().copied()).collect();
                arrays.push(triples(name, part));
                at += 3;
            }
        }
        arrays.push(Array {
            name: "error".into(),
            shape: vec![n],
            data: ArrayData::F64(values.iter().map(|v| v[at]).collect()),
        });
        let read = crate::points::COLUMNS;
        for (i, name) in self.points.columns.iter().enumerate() {
            if !read.contains(&name.as_str()) {
                let column = self.points.rows.iter().map(|row| row[i].clone()).collect();
                arrays.push(carried(name, column));
            }
        }
        Ok(encode_npz(&arrays)?)
    }
}

/// A carried column: numbers if every field is one, else text.
fn carried(name: &str, column: Vec<String>) -> Array {
    let numbers: Option<Vec<f64>> = column.iter().map(|f| f.trim().parse().ok()).collect();
    Array {
        name: name.into(),
        shape: vec![column.len()],
        data: numbers.map_or(ArrayData::Text(column), ArrayData::F64),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn component_lists() {
        let list = |s: &str| components(&s.split(',').map(String::from).collect::<Vec<_>>());
        assert_eq!(list("specular").unwrap(), Components { direct: false, specular: true });
        assert_eq!(components(&[]).unwrap(), Components { direct: true, specular: true });
        for wrong in ["indirect", "total", "direct,total", "diffuse", ""] {
            assert!(matches!(list(wrong), Err(Failure::Usage(_))), "{wrong}");
        }
    }

    #[test]
    fn carried_columns_are_numbers_or_text() {
        let column = |fields: [&str; 2]| fields.map(String::from).to_vec();
        assert!(
            matches!(carried("a", column(["1", " 2.5"])).data, ArrayData::F64(v) if v == [1.0, 2.5])
        );
        assert!(matches!(carried("a", column(["1", "desk"])).data, ArrayData::Text(_)));
    }
}
