//! sensor, film and filter plugins → [`Sensor`].

use crate::geometry::{Transform, math};

use super::description::{Kind, Object, SceneDescription};
use super::message::{Checked, Complaint, shown};
use super::model::{Film, ReconstructionFilter, Sensor};
use super::properties::{with_unit, word};

/// Widest and highest film [pixels]; what picture formats and memory can take.
const MAX_SIDE: i64 = 32_768;

/// Most pixels of a film: 8k by 8k. Each carries some twenty numbers of layers, 5 GB in all.
const MAX_PIXELS: i64 = 1 << 26;

/// Diagonal of a 24×36 mm negative [mm], which focal lengths refer to.
const NEGATIVE_DIAGONAL: f64 = 43.266_615_305_567_87;

/// A `perspective` sensor.
pub(super) fn sensor(
    description: &SceneDescription,
    object: &Object,
    notices: &mut Vec<String>,
) -> Checked<Sensor> {
    let to_world = object.to_world()?;
    rigid(&to_world, object)?;
    let film = film(description, object, notices)?;
    for time in ["shutter_open", "shutter_close"] {
        object.float(time)?;
    }
    let near = object.length("near_clip")?.unwrap_or(1e-2);
    let far = object.length("far_clip")?.unwrap_or(1e4);
    if near >= far {
        let place = if object.property("near_clip").is_some() { "near_clip" } else { "far_clip" };
        return Err(Complaint::at(
            object.place(place),
            format!("near_clip, {near}, must be smaller than far_clip, {far}"),
        )
        .help("nothing would be seen: raise far_clip or lower near_clip"));
    }
    let offset = |name: &str| {
        let range = object.float_where(name, "between −10 and 10", |x| x.abs() <= 10.0);
        range.map(|x| x.unwrap_or(0.0))
    };
    Ok(Sensor {
        world_from_camera: to_world,
        fov_x: fov_x(object, &film)?,
        near_clip: near,
        far_clip: far,
        principal_point_offset: [
            offset("principal_point_offset_x")?,
            offset("principal_point_offset_y")?,
        ],
        film,
    })
}

/// A camera is moved, turned and mirrored, not scaled.
fn rigid(to_world: &Transform, object: &Object) -> Checked<()> {
    let gram = to_world.linear().transpose() * to_world.linear();
    // Six digits: matrices in files are often rounded to that.
    if (gram - crate::geometry::Matrix3::identity()).amax() <= 1e-5 {
        return Ok(());
    }
    Err(Complaint::at(object.place("to_world"), "a camera cannot be scaled or sheared")
        .help("move and turn it: <lookat …/>, <translate …/>, <rotate …/>"))
}

/// Field of view across the width [rad].
fn fov_x(object: &Object, film: &Film) -> Checked<f64> {
    let (width, height) = (f64::from(film.width), f64::from(film.height));
    let diagonal = (width * width + height * height).sqrt();
    let (half_tangent, side, place) = match (object.float("fov")?, object.string("focal_length")?) {
        (Some(_), Some(length)) => {
            return Err(Complaint::at(length.span, "both \"fov\" and \"focal_length\"")
                .related(object.place("fov"), "the field of view")
                .help("one follows from the other: remove one"));
        }
        (Some(fov), None) => {
            if !(fov > 0.0 && fov < 180.0) {
                return Err(Complaint::at(
                    object.place("fov"),
                    format!("\"fov\" must be between 0 and 180 degrees, but it is {}", shown(fov)),
                )
                .help("40 is usual"));
            }
            let axes = ["x", "y", "diagonal", "smaller", "larger"];
            let axis = object.string("fov_axis")?.map_or(Ok("x"), |text| word(text, &axes))?;
            let side = match axis {
                "x" => width,
                "y" => height,
                "diagonal" => diagonal,
                "smaller" => width.min(height),
                _ => width.max(height),
            };
            (math::tan(fov.to_radians() / 2.0), side, "fov")
        }
        (None, length) => {
            if let Some(axis) = object.property("fov_axis") {
                return Err(Complaint::at(axis.span, "\"fov_axis\" without \"fov\"")
                    .help("a focal length means the diagonal: remove fov_axis, or give fov"));
            }
            // 50 mm, as in Mitsuba 3.
            let length = match length {
                Some(text) => {
                    let length = with_unit(text, "mm")?;
                    if length <= 0.0 {
                        return Err(Complaint::at(
                            text.span,
                            "a focal length must be greater than zero",
                        ));
                    }
                    length
                }
                None => 50.0,
            };
            (NEGATIVE_DIAGONAL / (2.0 * length), diagonal, "focal_length")
        }
    };
    let fov = 2.0 * math::atan(half_tangent * width / side);
    // At 179.99° a picture of 1000 pixels spans ten thousand units at distance one.
    if fov > 0.0 && fov < 179.99_f64.to_radians() {
        Ok(fov)
    } else {
        Err(Complaint::at(
            object.place(place),
            "the field of view across the picture is not between 0 and 180 degrees",
        ))
    }
}

/// The film inside a sensor; Mitsuba 3's default if there is none.
fn film(
    description: &SceneDescription,
    sensor: &Object,
    notices: &mut Vec<String>,
) -> Checked<Film> {
    let films: Vec<_> = description.children_of(sensor, Kind::Film).collect();
    let object = match films.as_slice() {
        [] => return Ok(Film { width: 768, height: 576, filter: DEFAULT_FILTER }),
        [only] => &description.objects[only.object],
        [first, second, ..] => {
            return Err(Complaint::at(second.span, "a second film in a sensor")
                .related(first.span, "the first"));
        }
    };
    let width = object.integer_in("width", 1, MAX_SIDE)?.unwrap_or(768);
    let height = object.integer_in("height", 1, MAX_SIDE)?.unwrap_or(576);
    if width * height > MAX_PIXELS {
        let place = if object.property("height").is_some() { "height" } else { "width" };
        return Err(Complaint::at(
            object.place(place),
            format!("a picture of {width} by {height} pixels is too large"),
        )
        .help(format!("at most {MAX_PIXELS} pixels in all")));
    }
    for (name, whole) in
        [("crop_offset_x", 0), ("crop_offset_y", 0), ("crop_width", width), ("crop_height", height)]
    {
        if object.integer(name)?.is_some_and(|given| given != whole) {
            return Err(Complaint::at(object.place(name), "pictures are not cropped here")
                .help("remove the crop_… properties, and cut the picture afterwards"));
        }
    }
    for name in ["sample_border", "compensate"] {
        object.boolean(name)?;
    }
    for name in ["file_format", "pixel_format", "component_format"] {
        object.string(name)?;
    }
    let filter = match description.children_of(object, Kind::Filter).next() {
        Some(child) => filter(&description.objects[child.object], notices)?,
        None => DEFAULT_FILTER,
    };
    Ok(Film { width: width as u32, height: height as u32, filter })
}

/// Mitsuba 3's.
const DEFAULT_FILTER: ReconstructionFilter = ReconstructionFilter::Gaussian { stddev: 0.5 };

/// A reconstruction filter. Those with negative lobes are answered by the gaussian, with a notice.
pub(super) fn filter(object: &Object, notices: &mut Vec<String>) -> Checked<ReconstructionFilter> {
    // Wider filters only blur, and cost their radius squared.
    let size = |name: &str, default: f64| {
        let range =
            object.float_where(name, "between 0.01 and 10 pixels", |x| (0.01..=10.0).contains(&x));
        range.map(|x| x.unwrap_or(default))
    };
    Ok(match object.plugin.value.as_str() {
        "box" => ReconstructionFilter::Box,
        "tent" => ReconstructionFilter::Tent { radius: size("radius", 1.0)? },
        "gaussian" => ReconstructionFilter::Gaussian { stddev: size("stddev", 0.5)? },
        name => {
            notices.push(format!("the filter \"{name}\" is not known; pictures use the gaussian"));
            DEFAULT_FILTER
        }
    })
}
