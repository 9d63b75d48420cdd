//! `evolute export`: a scene in the words of Mitsuba 3 alone.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;

use evolute::output::{PlyMesh, check_target, encode_ply, replace_file};
use evolute::receiver::Tessellation;
use evolute::scene::{Scene, SceneDescription};

use crate::failure::Failure;
use crate::options::Common;
use crate::session;
use crate::summary::Summary;

/// Writes a scene that Mitsuba 3 loads as it is: formulas become fine meshes
///
/// Into the folder go NAME.xml, a PLY file for each `parametric` shape (binary, world frame, with normals and
/// texture coordinates) and copies of the mesh files that the scene refers to. Parameters are replaced, included
/// files are part of it.
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  evolute export desk.xml -o desk_mitsuba -D lamp_height=2.4 --triangles 2000000")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML with `parametric` shapes [default: the built-in room]
    scene: Option<PathBuf>,
    /// The folder to write to; it is made if it is not there
    #[arg(short = 'o', long, value_name = "FOLDER")]
    output: PathBuf,
    /// Fewest triangles of each mesh; they are roughly equal
    #[arg(long, value_name = "N", default_value_t = 500_000, allow_negative_numbers = true,
          value_parser = clap::value_parser!(u32).range(1..=MOST_TRIANGLES))]
    triangles: u32,
    #[command(flatten)]
    pub common: Common,
}

/// While a mesh of so many is made it takes some 5 GiB.
const MOST_TRIANGLES: i64 = 10_000_000;

/// Runs the verb.
pub fn run(arguments: &Arguments, summary: &mut Summary) -> Result<(), Failure> {
    let common = &arguments.common;
    let folder = &arguments.output;
    let wrong = |e: evolute::scene::SceneError| Failure::Input(e.to_string());
    let description = match &arguments.scene {
        Some(path) => SceneDescription::from_file(path, &common.define),
        None => SceneDescription::from_text("room.xml", session::ROOM, &common.define),
    }
    .map_err(wrong)?;
    let (scene, _) = description.scene().map_err(wrong)?;
    let plain = description.plain().map_err(wrong)?;
    summary.set("scene", scene.name.clone());
    summary.lap("load");

    let text = folder.join(format!("{}.xml", plain.name));
    let mut targets = vec![text.clone()];
    targets.extend(plain.surfaces.iter().map(|s| folder.join(&s.file)));
    targets.extend(plain.copies.iter().map(|c| folder.join(&c.file)));
    let read = description.files().filter(|_| arguments.scene.is_some()).map(PathBuf::from);
    let read: Vec<PathBuf> = read.chain(plain.copies.iter().map(|c| c.from.clone())).collect();
    refuse_overwriting(&read, &targets)?;
    fs::create_dir_all(folder).map_err(|e| {
        Failure::Input(format!(
            "cannot make the folder '{}': {e}; choose another with -o",
            folder.display()
        ))
    })?;
    for target in &targets {
        check_target(target)?;
    }

    let mut meshes = Vec::new();
    for surface in &plain.surfaces {
        let bytes = mesh(&scene, surface.shape, arguments.triangles, &mut meshes)?;
        put(&folder.join(&surface.file), &bytes, common, summary)?;
    }
    for copy in &plain.copies {
        let bytes = fs::read(&copy.from)
            .map_err(|e| Failure::Input(format!("cannot read '{}': {e}", copy.from.display())))?;
        put(&folder.join(&copy.file), &bytes, common, summary)?;
    }
    // Last: who finds the scene finds all that it refers to.
    put(&text, plain.text.as_bytes(), common, summary)?;
    summary.set("meshes", meshes);
    summary.lap("write");
    Ok(())
}

/// A shape's surface as a PLY file.
fn mesh(
    scene: &Scene,
    shape: evolute::scene::ShapeId,
    triangles: u32,
    meshes: &mut Vec<serde_json::Value>,
) -> Result<Vec<u8>, Failure> {
    let shape = scene.shape(shape);
    let made = Tessellation::new(&shape.surface, triangles as usize);
    meshes.push(json!({
        "shape": shape.id, "vertices": made.positions.len(), "triangles": made.triangles.len(),
    }));
    Ok(encode_ply(&PlyMesh {
        positions: &made.positions,
        normals: &made.normals,
        texcoords: &made.coordinates,
        triangles: &made.triangles,
    })?)
}

fn put(path: &Path, bytes: &[u8], common: &Common, summary: &mut Summary) -> Result<(), Failure> {
    replace_file(path, bytes)?;
    session::detail(common, &format!("wrote {}", path.display()));
    summary.file(path);
    Ok(())
}

/// A scene must not be written over the files that it was read from.
fn refuse_overwriting(read: &[PathBuf], targets: &[PathBuf]) -> Result<(), Failure> {
    let real = |path: &PathBuf| path.canonicalize().ok();
    let read: Vec<PathBuf> = read.iter().filter_map(real).collect();
    match targets.iter().find(|t| real(t).is_some_and(|t| read.contains(&t))) {
        Some(target) => Err(Failure::Usage(format!(
            "'{}' is part of the scene that is exported and would be overwritten; choose another folder with -o",
            target.display()
        ))),
        None => Ok(()),
    }
}
