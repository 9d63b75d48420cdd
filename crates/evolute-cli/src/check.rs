//! `evolute check`: reads a scene and says what is in it.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use evolute::scene::{Scene, Shape, SideMaterial};
use evolute::surface::Surface;

use crate::failure::Failure;
use crate::options::Common;
use crate::session;
use crate::summary::Summary;

/// Reads a scene, checks it and says what is in it
#[derive(Args, Debug)]
#[command(after_help = "\
Example:
  evolute check desk.xml -D lamp_height=2.4")]
pub struct Arguments {
    /// The scene: Mitsuba 3 XML
    scene: PathBuf,
    #[command(flatten)]
    pub common: Common,
}

/// Runs the verb.
pub fn run(arguments: &Arguments, summary: &mut Summary) -> Result<(), Failure> {
    let common = &arguments.common;
    let scene = session::load(&arguments.scene, common, summary)?;
    let factor = common.unit_factor();
    let settings = session::transfer_settings(&scene, common);
    summary.set("shapes", scene.shapes.iter().map(|s| describe(s, factor)).collect::<Vec<_>>());
    summary.set("lamps", scene.lamps().map(|id| scene.shape(id).id.clone()).collect::<Vec<_>>());
    summary.set("emitted_flux", (scene.emitted_flux() * factor).0.to_vec());
    summary.set("surface_area", scene.surface_area());
    summary.set("accuracy_abs", settings.absolute);
    if let Some(depth) = scene.max_depth {
        summary.set("max_depth", depth);
    }
    if let Some(sensor) = scene.sensors.first() {
        let film = sensor.film;
        summary.set("film", json!({ "width": film.width, "height": film.height }));
    }
    if !common.json {
        session::print(report(&scene, settings.absolute, common).as_bytes())?;
    }
    Ok(())
}

fn describe(shape: &Shape, factor: f64) -> Value {
    json!({
        "id": shape.id,
        "kind": kind(&shape.surface),
        "area": shape.surface.area(),
        "front": side(shape, &shape.material.front),
        "back": side(shape, &shape.material.back),
        "emitted_flux": (shape.emitted_flux() * factor).0.to_vec(),
    })
}

fn kind(surface: &Surface) -> &'static str {
    match surface {
        Surface::Rectangle(_) => "rectangle",
        Surface::Disk(_) => "disk",
        Surface::Sphere(_) => "sphere",
        Surface::Cylinder(_) => "cylinder",
        Surface::Mesh(_) => "mesh",
        Surface::Parametric(_) => "parametric",
    }
}

/// What one side does to light, in a few words.
fn side(shape: &Shape, side: &SideMaterial) -> String {
    let mut words = Vec::new();
    if !side.diffuse.is_black() {
        words.push("diffuse".to_owned());
    }
    if let Some(mirror) = &side.mirror {
        words.push(if mirror.conductor.is_some() { "metal" } else { "mirror" }.to_owned());
    }
    if let Some(boundary) = &shape.material.dielectric {
        let (inside, outside) = (boundary.interior_ior, boundary.exterior_ior);
        words.push(format!("boundary of n = {inside} inside and {outside} outside"));
    }
    if words.is_empty() { "black".into() } else { words.join(" and ") }
}

/// A number for people, in three figures or more whatever its size.
fn figure(x: f64) -> String {
    if x == 0.0 || (0.01..1e7).contains(&x.abs()) { format!("{x:.4}") } else { format!("{x:.4e}") }
}

/// The same for people.
fn report(scene: &Scene, absolute: f64, common: &Common) -> String {
    let factor = common.unit_factor();
    let [flux_unit, irradiance_unit, radiance_unit] = common.units();
    let mut text = String::new();
    let mut line = |s: String| text += &(s + "\n");
    line(format!("scene '{}': {} shapes", scene.name, scene.shapes.len()));
    for shape in &scene.shapes {
        let material = &shape.material;
        let (front, back) = (side(shape, &material.front), side(shape, &material.back));
        let sides = if front == back { front } else { format!("{front}; back {back}") };
        line(format!(
            "  {} ({}, {} m²): {sides}",
            shape.id,
            kind(&shape.surface),
            figure(shape.surface.area())
        ));
        if !shape.radiance.is_black() {
            let flux = shape.emitted_flux() * factor;
            line(format!(
                "    lamp: {} {flux_unit}, radiance {:?} {radiance_unit}",
                figure(flux.luminance()),
                (shape.radiance * factor).0
            ));
        }
    }
    let flux = figure(scene.emitted_flux().luminance() * factor);
    line(format!("emitted flux {flux} {flux_unit}"));
    line(format!("surface area {} m² (both sides)", figure(scene.surface_area())));
    line(format!(
        "tolerance at a receiver: {} of its irradiance, not below {:.3e} {irradiance_unit}",
        common.accuracy,
        absolute * factor
    ));
    match scene.sensors.first() {
        Some(s) => line(format!("picture of {} × {} pixels", s.film.width, s.film.height)),
        None => line("no sensor: probe works, render does not".into()),
    }
    if let Some(depth) = scene.max_depth {
        let edges = if depth == 1 { "edge" } else { "edges" };
        line(format!("paths have at most {depth} {edges} (max_depth)"));
    }
    text
}
