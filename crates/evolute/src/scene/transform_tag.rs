//! The steps inside a `<transform>`.

use crate::geometry::{Point3, Transform, Vector3};

use super::describe::Attributes;
use super::message::{Checked, Complaint, quoted};
use super::number;
use super::placement;

/// How far the axis of a rotation may be from length 1: three digits, as in 0.707.
const UNIT_TOLERANCE: f64 = 1e-3;

/// Their tags.
pub(super) const NAMES: [&str; 5] = ["translate", "rotate", "scale", "lookat", "matrix"];

/// The attributes a step takes; `None` if there is no such step.
pub(super) fn attributes(tag: &str) -> Option<&'static [&'static str]> {
    match tag {
        "translate" | "scale" => Some(&["value", "x", "y", "z"]),
        "rotate" => Some(&["value", "x", "y", "z", "angle"]),
        "lookat" => Some(&["origin", "target", "up"]),
        "matrix" => Some(&["value"]),
        _ => None,
    }
}

/// All steps, the first of the file first.
///
/// # Errors
/// The first step that is wrong.
pub(super) fn product(steps: &[(String, Attributes)]) -> Checked<Transform> {
    steps.iter().try_fold(Transform::identity(), |so_far, (tag, attributes)| {
        placement::compose(&step(tag, attributes)?, &so_far, attributes.span)
    })
}

/// One step.
fn step(tag: &str, attributes: &Attributes) -> Checked<Transform> {
    let say = |message: &str| Complaint::at(attributes.span, message);
    match tag {
        "translate" => Ok(Transform::translation(triple(attributes, Some(0.0))?.into())),
        "scale" => {
            let factors = triple(attributes, Some(1.0))?;
            Transform::scaling(factors.into()).ok_or_else(|| {
                say("a scale by 0 flattens the object to nothing")
                    .help("every factor must differ from 0")
            })
        }
        "rotate" => {
            let angle = number::float(attributes.require("angle")?)?;
            let axis: Vector3 = triple(attributes, Some(0.0))?.into();
            let without_axis = || {
                say("a rotation needs an axis: x, y and z must not all be 0")
                    .help("write <rotate x=\"1\" angle=\"90\"/>, degrees, right-handed")
            };
            // (Nothing divided by nothing is no number, and has a length that is not nothing.)
            let some = Some(axis).filter(|axis| axis.amax() > 0.0);
            let unit = some
                .and_then(|axis| (axis / axis.amax()).try_normalize(0.0))
                .ok_or_else(without_axis)?;
            // Mitsuba 3 does not normalise the axis, and what it makes of a longer one is no
            // rotation. Neither its answer nor another would be what was meant.
            if (axis - unit).amax() > UNIT_TOLERANCE {
                return Err(say("the axis of a rotation must have length 1").help(format!(
                    "for this direction write x=\"{:.6}\" y=\"{:.6}\" z=\"{:.6}\"",
                    unit.x, unit.y, unit.z
                )));
            }
            placement::rotation(unit, angle).ok_or_else(without_axis)
        }
        "lookat" => {
            let point = |name: &str| number::triple(attributes.require(name)?).map(Point3::from);
            let up = attributes.get("up").map(number::triple).transpose()?.map(Vector3::from);
            placement::look_at(point("origin")?, point("target")?, up).ok_or_else(|| {
                say("this lookat has no direction")
                    .help("target must differ from origin, and up must not point along the line between them")
            })
        }
        _ => {
            let value = attributes.require("value")?;
            let numbers = number::list(value, 16)?;
            placement::matrix(&numbers).ok_or_else(|| {
                Complaint::at(value.span, "this is no matrix that can be inverted").help(
                    "write 16 numbers, row by row, the last row 0 0 0 1; or 9 without the translation",
                )
            })
        }
    }
}

/// Three numbers, as `value` or as x, y and z; where one of these is missing, `missing`.
///
/// # Errors
/// When both or neither are given, or one of x, y, z is missing where none may be.
pub(super) fn triple(attributes: &Attributes, missing: Option<f64>) -> Checked<[f64; 3]> {
    let parts = ["x", "y", "z"].map(|n| attributes.get(n));
    match (attributes.get("value"), parts.iter().flatten().next()) {
        (Some(_), Some(part)) => Err(Complaint::at(part.span, "both \"value\" and x, y, z")
            .help("give either value=\"1, 2, 3\" or x=\"1\" y=\"2\" z=\"3\"")),
        (Some(value), None) => number::triple(value),
        (None, None) if missing.is_none() => attributes.require("value").and_then(number::triple),
        (None, _) => {
            let mut numbers = [0.0; 3];
            for (number, (name, part)) in numbers.iter_mut().zip(["x", "y", "z"].iter().zip(parts))
            {
                *number = match (part, missing) {
                    (Some(text), _) => number::float(text)?,
                    (None, Some(default)) => default,
                    (None, None) => {
                        return Err(Complaint::at(
                            attributes.span,
                            format!("the attribute {} is missing", quoted(name)),
                        )
                        .help("give x, y and z"));
                    }
                };
            }
            Ok(numbers)
        }
    }
}
