//! shape plugins → [`Shape`]s.

use crate::formula::{Formula, check_constant_name};
use crate::geometry::{Point3, Rgb, Transform};
use crate::surface::{Cylinder, Disk, Mesh, Parametric, Rectangle, Sphere, Surface, SurfaceError};

use super::description::{Kind, Object, SceneDescription};
use super::material::Materials;
use super::mesh_file;
use super::message::{Checked, Complaint, quoted};
use super::model::Shape;
use super::placement::MAX_COORDINATE;
use super::spectrum::Quantity;

/// One shape, the `number`th of the scene, from 1.
pub(super) fn shape(
    description: &SceneDescription,
    materials: &mut Materials<'_>,
    object: &Object,
    number: usize,
) -> Checked<Shape> {
    let surface = surface(description, object)?;
    let bounds = surface.bounds();
    let far = bounds
        .corners()
        .iter()
        .any(|p| p.coords.iter().any(|x| x.is_nan() || x.abs() > MAX_COORDINATE));
    if far {
        return Err(Complaint::at(
            object.place("to_world"),
            format!("the shape reaches farther than {MAX_COORDINATE:e} m"),
        )
        .help("keep coordinates within that range; metres are the unit"));
    }
    let radiance = emission(description, object)?;
    if radiance.is_some() && !(surface.area() > 0.0 && surface.area().is_finite()) {
        return Err(Complaint::at(object.span, "a lamp without area")
            .help("an area emitter needs a shape with a positive area"));
    }
    let id = match &object.id {
        Some(id) => id.value.clone(),
        None => format!("shape {number}, {}", object.plugin.value),
    };
    let material = materials.of_shape(object, radiance.is_some())?;
    Ok(Shape { id, surface, material, radiance: radiance.unwrap_or(Rgb::BLACK) })
}

/// What the shape emits, if it has an emitter.
fn emission(description: &SceneDescription, object: &Object) -> Checked<Option<Rgb>> {
    let emitters: Vec<_> = description.children_of(object, Kind::Emitter).collect();
    match emitters.as_slice() {
        [] => Ok(None),
        [only] => radiance(&description.objects[only.object]).map(Some),
        [first, second, ..] => Err(Complaint::at(second.span, "a second emitter in a shape")
            .related(first.span, "the first")
            .help("add the two radiances up in one")),
    }
}

/// The radiance of an `area` emitter [W/(m² sr)]; 1 if it does not say, as in Mitsuba 3.
pub(super) fn radiance(emitter: &Object) -> Checked<Rgb> {
    Ok(emitter.colour("radiance", Quantity::Power)?.unwrap_or(Rgb::WHITE))
}

/// The geometry of a shape.
fn surface(description: &SceneDescription, object: &Object) -> Checked<Surface> {
    let to_world = object.to_world()?;
    let flip = object.boolean("flip_normals")?.unwrap_or(false);
    let refused = |property: &'static str| {
        move |error: SurfaceError| Complaint::at(object.place(property), error.to_string())
    };
    match object.plugin.value.as_str() {
        "rectangle" => {
            Rectangle::new(to_world, flip).map(Surface::Rectangle).map_err(refused("to_world"))
        }
        "disk" => Disk::new(to_world, flip).map(Surface::Disk).map_err(refused("to_world")),
        "cube" => Mesh::cube(to_world, flip).map(Surface::Mesh).map_err(refused("to_world")),
        "sphere" => {
            let centre = object.point("center")?.unwrap_or(Point3::origin());
            let radius = object.length("radius")?.unwrap_or(1.0);
            Sphere::new(centre, radius, to_world, flip)
                .map(Surface::Sphere)
                .map_err(refused("to_world"))
        }
        "cylinder" => {
            let p0 = object.point("p0")?.unwrap_or(Point3::origin());
            let p1 = object.point("p1")?.unwrap_or(Point3::new(0.0, 0.0, 1.0));
            let radius = object.length("radius")?.unwrap_or(1.0);
            if p0 == p1 {
                return Err(Complaint::at(object.place("p1"), "the cylinder has no length")
                    .help("p0 and p1 are the ends of its axis and must differ"));
            }
            Cylinder::new(p0, p1, radius, to_world, flip)
                .map(Surface::Cylinder)
                .map_err(refused("to_world"))
        }
        "obj" | "ply" => mesh_file::mesh(description, object, to_world, flip).map(Surface::Mesh),
        _ => parametric(object, to_world, flip),
    }
}

/// A surface by formulas of s and t.
fn parametric(object: &Object, to_world: Transform, flip_normals: bool) -> Checked<Surface> {
    let names = ["x", "y", "z", "to_world", "flip_normals"];
    let constants = object.constants(&names)?;
    for property in &object.properties {
        let name = &property.name;
        if !names.contains(&name.value.as_str()) {
            check_constant_name(&name.value, &PARAMETERS)
                .map_err(|why| Complaint::at(name.span, why))?;
        }
    }
    let formula = |name: &str| {
        let text = object.string(name)?.ok_or_else(|| {
            Complaint::at(object.span, format!("\"parametric\" needs the formula {}", quoted(name)))
                .help(format!(
                    "write <string name=\"{name}\" value=\"…\"/>, a formula of s and t in [0, 1]"
                ))
        })?;
        Formula::parse(&text.value, &PARAMETERS, &constants)
            .map_err(|error| Complaint::at(text.locate(error.span), error.message))
    };
    let [x, y, z] = [formula("x")?, formula("y")?, formula("z")?];
    Parametric::new(x, y, z, to_world, flip_normals)
        .map(Surface::Parametric)
        .map_err(|error| Complaint::at(object.span, error.to_string()))
}

/// The variables of a parametric surface.
const PARAMETERS: [&str; 2] = ["s", "t"];
