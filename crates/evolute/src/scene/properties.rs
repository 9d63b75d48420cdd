//! Typed, checked access to an object's properties.

use crate::geometry::{Point3, Rgb, Transform};

use super::description::{Object, Property, Spectrum, Value};
use super::message::{Checked, Complaint, quoted, shown};
use super::number;
use super::placement::MAX_COORDINATE;
use super::source::Span;
use super::spectrum::{self, Quantity};
use super::text::Text;

/// Smallest length [m]: far below the wavelength of light, where rays mean nothing; squares of it
/// are still far from the least double.
const MIN_LENGTH: f64 = 1e-12;

impl Object {
    /// The property of a name.
    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name.value == name)
    }

    /// Where a property stands, or the object if it is not given.
    pub(super) fn place(&self, name: &str) -> Span {
        self.property(name).map_or(self.span, |p| p.span)
    }

    /// A number.
    pub(super) fn float(&self, name: &str) -> Checked<Option<f64>> {
        self.read(name, "a number: <float … value=\"1.5\"/>", |value| match value {
            Value::Float(x) => Some(*x),
            Value::Integer(i) => Some(*i as f64),
            _ => None,
        })
    }

    /// A number in a range given in words.
    pub(super) fn float_where(
        &self,
        name: &str,
        rule: &str,
        fine: impl Fn(f64) -> bool,
    ) -> Checked<Option<f64>> {
        match self.float(name)? {
            Some(x) if !fine(x) => Err(Complaint::at(
                self.place(name),
                format!("{} must be {rule}, but it is {}", quoted(name), shown(x)),
            )
            .help(format!("change the value, or leave {} out for its default", quoted(name)))),
            other => Ok(other),
        }
    }

    /// A length [m] greater than zero.
    pub(super) fn length(&self, name: &str) -> Checked<Option<f64>> {
        self.float_where(name, "greater than zero", |x| x > 0.0)?;
        self.float_where(name, &format!("between {MIN_LENGTH:e} and {MAX_COORDINATE:e} m"), |x| {
            (MIN_LENGTH..=MAX_COORDINATE).contains(&x)
        })
    }

    /// A whole number.
    pub(super) fn integer(&self, name: &str) -> Checked<Option<i64>> {
        self.read(name, "a whole number: <integer … value=\"64\"/>", |value| match value {
            Value::Integer(i) => Some(*i),
            _ => None,
        })
    }

    /// A whole number in a range.
    pub(super) fn integer_in(&self, name: &str, least: i64, most: i64) -> Checked<Option<i64>> {
        match self.integer(name)? {
            Some(i) if !(least..=most).contains(&i) => Err(Complaint::at(
                self.place(name),
                format!("{} must be between {least} and {most}, but it is {i}", quoted(name)),
            )),
            other => Ok(other),
        }
    }

    /// `true` or `false`.
    pub(super) fn boolean(&self, name: &str) -> Checked<Option<bool>> {
        self.read(name, "a boolean: <boolean … value=\"true\"/>", |value| match value {
            Value::Boolean(b) => Some(*b),
            _ => None,
        })
    }

    /// A text.
    pub(super) fn string(&self, name: &str) -> Checked<Option<&Text>> {
        self.read(name, "a string: <string … value=\"…\"/>", |value| match value {
            Value::String(text) => Some(text),
            _ => None,
        })
    }

    /// A point [m].
    pub(super) fn point(&self, name: &str) -> Checked<Option<Point3>> {
        let point =
            self.read(name, "a point: <point … x=\"0\" y=\"0\" z=\"0\"/>", |value| match value {
                Value::Point(p) => Some(Point3::from(*p)),
                _ => None,
            })?;
        match point {
            Some(p) if p.coords.amax() > MAX_COORDINATE => Err(Complaint::at(
                self.place(name),
                format!("{} is farther away than {MAX_COORDINATE:e} m", quoted(name)),
            )),
            other => Ok(other),
        }
    }

    /// Where the object stands; nowhere else if it does not say.
    pub(super) fn to_world(&self) -> Checked<Transform> {
        let given = self.read(
            "to_world",
            "a transform: <transform name=\"to_world\">…</transform>",
            |value| match value {
                Value::Transform(t) => Some(*t),
                _ => None,
            },
        )?;
        Ok(given.unwrap_or_else(Transform::identity))
    }

    /// A colour: `float`, `rgb` or `spectrum`; every channel ≥ 0 and finite.
    pub(super) fn colour(&self, name: &str, quantity: Quantity) -> Checked<Option<Rgb>> {
        let colour =
            self.read(name, "a colour: <rgb … value=\"0.5, 0.5, 0.5\"/>", |value| match value {
                Value::Float(x) => Some(Rgb::grey(*x)),
                Value::Integer(i) => Some(Rgb::grey(*i as f64)),
                Value::Rgb(rgb) => Some(Rgb(*rgb)),
                Value::Spectrum(spectrum) => Some(spectrum::colour(spectrum, quantity)),
                _ => None,
            })?;
        let Some(colour) = colour else { return Ok(None) };
        let say = |rule: &str| Complaint::at(self.place(name), format!("{} {rule}", quoted(name)));
        // Channels are squared, and summed over chains: far from the end of the doubles' range.
        const MOST: f64 = 1e100;
        if colour.0.iter().any(|c| c.is_nan() || *c > MOST) {
            return Err(say("is too large a number").help("the unit of radiance is W/(m² sr)"));
        }
        let negative = match self.property(name).map(|p| &p.value) {
            Some(Value::Spectrum(Spectrum::Samples(samples))) => samples.iter().any(|s| s.1 < 0.0),
            _ => colour.0.iter().any(|c| *c < 0.0),
        };
        if negative {
            return Err(say("must not be negative").help("0 is the least: no light"));
        }
        Ok(Some(colour))
    }

    /// A reflectance or transmittance: a colour with channels of at most 1.
    pub(super) fn reflectance(&self, name: &str) -> Checked<Option<Rgb>> {
        let colour = self.colour(name, Quantity::Factor)?;
        let place = self.property(name);
        match (colour, place.map(|p| &p.value)) {
            // A saturated spectrum may leave the gamut by one channel; Mitsuba clamps it too.
            (Some(colour), Some(Value::Spectrum(Spectrum::Samples(samples))))
                if samples.iter().all(|s| s.1 <= 1.0) =>
            {
                Ok(Some(colour.map(|c| c.min(1.0))))
            }
            (Some(colour), _) if colour.max() > 1.0 => Err(Complaint::at(
                self.place(name),
                format!(
                    "{} must be between 0 and 1: nothing sends back more light than it gets",
                    quoted(name)
                ),
            )
            .help("shares of the light, a channel: value=\"0.5, 0.5, 0.5\"")),
            _ => Ok(colour),
        }
    }

    /// An index of refraction by number or name.
    pub(super) fn index(&self, name: &str) -> Checked<Option<f64>> {
        let Some(property) = self.property(name) else { return Ok(None) };
        if let Value::String(text) = &property.value {
            return super::index::dielectric(text).map(Some);
        }
        // The rarest and the densest there are lie between 1 and 4; this leaves room for experiments.
        self.read(
            name,
            "an index: <float … value=\"1.5\"/>, or a name: <string … value=\"bk7\"/>",
            |value| match value {
                Value::Float(x) => Some(*x),
                Value::Integer(i) => Some(*i as f64),
                _ => None,
            },
        )?;
        self.float_where(name, "between 0.01 and 100", |x| (0.01..=100.0).contains(&x))
    }

    /// Every number that is none of `names`, with its name: constants of formulas.
    pub(super) fn constants(&self, names: &[&str]) -> Checked<Vec<(String, f64)>> {
        let others = self.properties.iter().filter(|p| !names.contains(&p.name.value.as_str()));
        others
            .map(|p| match &p.value {
                Value::Float(x) => Ok((p.name.value.clone(), *x)),
                Value::Integer(i) => Ok((p.name.value.clone(), *i as f64)),
                other => Err(Complaint::at(
                    p.name.span,
                    format!("unknown property {} of type {}", quoted(&p.name.value), other.tag()),
                )
                .maybe_meant(super::message::nearest(&p.name.value, names.iter().copied()))
                .help("constants of formulas are numbers: <float name=\"…\" value=\"…\"/>")),
            })
            .collect()
    }

    fn read<'a, T>(
        &'a self,
        name: &str,
        wanted: &str,
        get: impl Fn(&'a Value) -> Option<T>,
    ) -> Checked<Option<T>> {
        let Some(property) = self.property(name) else { return Ok(None) };
        match get(&property.value) {
            Some(value) => Ok(Some(value)),
            None => Err(Complaint::at(
                property.span,
                format!("{} is given as a <{}>", quoted(name), property.value.tag()),
            )
            .help(format!("it must be {wanted}"))),
        }
    }
}

/// A text that must be one of a few words.
pub(super) fn word<'a>(text: &Text, known: &[&'a str]) -> Checked<&'a str> {
    let given = text.value.trim();
    known.iter().copied().find(|k| *k == given).ok_or_else(|| {
        Complaint::at(
            text.span,
            format!("{} is not one of the words that may stand here", quoted(given)),
        )
        .maybe_meant(super::message::nearest(given, known.iter().copied()))
        .help(format!("write {}", super::message::listed(known.iter().copied(), "or")))
    })
}

/// A number in a text, with a unit that may be left out.
pub(super) fn with_unit(text: &Text, unit: &str) -> Checked<f64> {
    let range = number::trimmed(&text.value, 0..text.value.len());
    let end = range.start + text.value[range.clone()].trim_end_matches(unit).trim_end().len();
    number::float_in(text, range.start..end)
        .map_err(|complaint| complaint.help(format!("write a number with {unit}: \"35{unit}\"")))
}
