//! The plugins that are known, their properties, and what may be inside them.

use super::description::{Kind, Object, SceneDescription};
use super::message::{Checked, Complaint, listed, nearest, quoted};

/// One plugin.
struct Plugin {
    kind: Kind,
    name: &'static str,
    properties: &'static [&'static str],
    /// Kinds of objects inside.
    children: &'static [Kind],
    /// Whether any other number is a property too: named constants of formulas.
    constants: bool,
}

impl Plugin {
    const fn new(
        kind: Kind,
        name: &'static str,
        properties: &'static [&'static str],
        children: &'static [Kind],
    ) -> Self {
        Self { kind, name, properties, children, constants: false }
    }
}

/// What a shape may hold. (`irradiancemeter`s and media are answered by their own kinds.)
const IN_SHAPE: &[Kind] = &[Kind::Bsdf, Kind::Emitter, Kind::Sensor];

const PLUGINS: &[Plugin] = &[
    Plugin::new(
        Kind::Scene,
        "scene",
        &[],
        &[Kind::Integrator, Kind::Sensor, Kind::Shape, Kind::Bsdf, Kind::Emitter],
    ),
    Plugin::new(
        Kind::Sensor,
        "perspective",
        &[
            "to_world",
            "fov",
            "fov_axis",
            "focal_length",
            "near_clip",
            "far_clip",
            "principal_point_offset_x",
            "principal_point_offset_y",
            "shutter_open",
            "shutter_close",
        ],
        &[Kind::Film, Kind::Sampler],
    ),
    Plugin::new(
        Kind::Film,
        "hdrfilm",
        &[
            "width",
            "height",
            "crop_offset_x",
            "crop_offset_y",
            "crop_width",
            "crop_height",
            "file_format",
            "pixel_format",
            "component_format",
            "sample_border",
            "compensate",
        ],
        &[Kind::Filter],
    ),
    Plugin::new(Kind::Sampler, "independent", &["sample_count", "seed"], &[]),
    Plugin::new(Kind::Sampler, "stratified", &["sample_count", "seed", "jitter"], &[]),
    Plugin::new(Kind::Sampler, "multijitter", &["sample_count", "seed", "jitter"], &[]),
    Plugin::new(Kind::Sampler, "orthogonal", &["sample_count", "seed", "jitter", "strength"], &[]),
    Plugin::new(Kind::Sampler, "ldsampler", &["sample_count", "seed"], &[]),
    Plugin::new(Kind::Filter, "box", &[], &[]),
    Plugin::new(Kind::Filter, "tent", &["radius"], &[]),
    Plugin::new(Kind::Filter, "gaussian", &["stddev"], &[]),
    Plugin::new(Kind::Filter, "mitchell", &["A", "B"], &[]),
    Plugin::new(Kind::Filter, "catmullrom", &[], &[]),
    Plugin::new(Kind::Filter, "lanczos", &["lobes"], &[]),
    Plugin::new(Kind::Shape, "rectangle", &["to_world", "flip_normals"], IN_SHAPE),
    Plugin::new(Kind::Shape, "disk", &["to_world", "flip_normals"], IN_SHAPE),
    Plugin::new(Kind::Shape, "sphere", &["center", "radius", "to_world", "flip_normals"], IN_SHAPE),
    Plugin::new(
        Kind::Shape,
        "cylinder",
        &["p0", "p1", "radius", "to_world", "flip_normals"],
        IN_SHAPE,
    ),
    Plugin::new(Kind::Shape, "cube", &["to_world", "flip_normals"], IN_SHAPE),
    Plugin::new(
        Kind::Shape,
        "obj",
        &["filename", "face_normals", "flip_tex_coords", "flip_normals", "to_world"],
        IN_SHAPE,
    ),
    Plugin::new(
        Kind::Shape,
        "ply",
        &["filename", "face_normals", "flip_tex_coords", "flip_normals", "to_world"],
        IN_SHAPE,
    ),
    Plugin {
        constants: true,
        ..Plugin::new(
            Kind::Shape,
            "parametric",
            &["x", "y", "z", "to_world", "flip_normals"],
            IN_SHAPE,
        )
    },
    Plugin::new(Kind::Bsdf, "diffuse", &["reflectance"], &[]),
    Plugin::new(
        Kind::Bsdf,
        "dielectric",
        &["int_ior", "ext_ior", "specular_reflectance", "specular_transmittance"],
        &[],
    ),
    Plugin::new(Kind::Bsdf, "conductor", &["material", "eta", "k", "specular_reflectance"], &[]),
    Plugin::new(Kind::Bsdf, "twosided", &[], &[Kind::Bsdf]),
    Plugin::new(Kind::Bsdf, "blendbsdf", &["weight"], &[Kind::Bsdf]),
    Plugin::new(Kind::Emitter, "area", &["radiance"], &[]),
];

/// Plugins of Mitsuba 3 that are not known here, so that the message can say that the name is right
/// and the plugin missing.
const ELSEWHERE: &[(Kind, &[&str])] = &[
    (
        Kind::Sensor,
        &["thinlens", "orthographic", "radiancemeter", "irradiancemeter", "distant", "batch"],
    ),
    (Kind::Film, &["specfilm"]),
    (
        Kind::Shape,
        &[
            "bsplinecurve",
            "linearcurve",
            "sdfgrid",
            "shapegroup",
            "instance",
            "serialized",
            "ellipsoids",
            "ellipsoidsmesh",
            "merge",
        ],
    ),
    (
        Kind::Bsdf,
        &[
            "roughconductor",
            "roughdielectric",
            "thindielectric",
            "plastic",
            "roughplastic",
            "pplastic",
            "principled",
            "principledthin",
            "mask",
            "bumpmap",
            "normalmap",
            "null",
            "hair",
            "measured",
            "measured_polarized",
            "polarizer",
            "retarder",
            "circular",
            "phong",
        ],
    ),
    (
        Kind::Emitter,
        &[
            "point",
            "spot",
            "directional",
            "directionalarea",
            "constant",
            "envmap",
            "sunsky",
            "timed_sunsky",
            "projector",
        ],
    ),
];

/// Checks every object: its plugin, the names of its properties, what is inside it.
///
/// # Errors
/// The first fault in the order of the file.
pub(super) fn check(description: &SceneDescription) -> Checked<()> {
    description.objects.iter().try_for_each(|object| check_object(description, object))
}

fn check_object(description: &SceneDescription, object: &Object) -> Checked<()> {
    match object.kind {
        // Any integrator will do: light is computed in evolute's own way.
        Kind::Integrator => return Ok(()),
        // Samplers and the like inside an integrator never get here: see above. These kinds have
        // no plugins at all.
        Kind::Texture | Kind::Medium | Kind::Phase | Kind::Volume => {
            if inside_integrator(description, object) {
                return Ok(());
            }
            let tag = object.kind.tag();
            let complaint = Complaint::at(object.span, format!("a <{tag}> is not known here"));
            return Err(match object.kind {
                Kind::Texture => complaint.help(
                    "give a colour that is the same everywhere: <rgb name=\"…\" value=\"…\"/>",
                ),
                _ => complaint.help("light travels through clear media only: remove it"),
            });
        }
        _ => {}
    }
    let name = object.plugin.value.as_str();
    let Some(plugin) = PLUGINS.iter().find(|p| p.kind == object.kind && p.name == name) else {
        return Err(unknown_plugin(object));
    };
    let article = format!("{} {}", object.kind.tag(), quoted(name));
    for property in &object.properties {
        let given = property.name.value.as_str();
        if plugin.properties.contains(&given) || plugin.constants {
            continue;
        }
        let complaint = Complaint::at(
            property.name.span,
            format!("unknown property {} of {article}", quoted(given)),
        )
        .maybe_meant(nearest(given, plugin.properties.iter().copied()));
        return Err(match plugin.properties {
            [] => complaint.help("it has no properties"),
            known => complaint
                .help(format!("its properties are {}", listed(known.iter().copied(), "and"))),
        });
    }
    for child in &object.children {
        let inside = &description.objects[child.object];
        let allowed = plugin.children.contains(&inside.kind)
            // Without effect at the top, as in Mitsuba.
            || object.kind == Kind::Scene && matches!(inside.kind, Kind::Sampler | Kind::Film | Kind::Filter)
            // These have their own message.
            || matches!(inside.kind, Kind::Texture | Kind::Medium | Kind::Phase | Kind::Volume);
        if !allowed {
            return Err(Complaint::at(
                child.span,
                format!("a <{}> cannot be inside the {article}", inside.kind.tag()),
            )
            .related(object.span, "inside this")
            .help(match plugin.children {
                [] => "nothing can".to_string(),
                kinds => format!("{} can", listed(kinds.iter().map(|k| k.tag()), "or")),
            }));
        }
    }
    Ok(())
}

/// Whether an object is inside an integrator, where everything is left alone.
fn inside_integrator(description: &SceneDescription, object: &Object) -> bool {
    description.objects.iter().filter(|o| o.kind == Kind::Integrator).any(|integrator| {
        integrator.children.iter().any(|c| std::ptr::eq(&description.objects[c.object], object))
    })
}

fn unknown_plugin(object: &Object) -> Complaint {
    let name = object.plugin.value.as_str();
    let tag = object.kind.tag();
    let known = || PLUGINS.iter().filter(|p| p.kind == object.kind).map(|p| p.name);
    let complaint = Complaint::at(object.plugin.span, format!("unknown {tag} {}", quoted(name)));
    let elsewhere = ELSEWHERE.iter().any(|(k, names)| *k == object.kind && names.contains(&name));
    let complaint = if elsewhere {
        complaint.label("Mitsuba 3 has it, evolute does not")
    } else {
        complaint.maybe_meant(nearest(name, known()))
    };
    complaint.help(format!("known {tag} plugins: {}", listed(known(), "and")))
}
