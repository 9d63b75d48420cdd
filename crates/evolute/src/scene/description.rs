//! A scene as it is written: objects, properties, references, with the position of each.

use std::path::PathBuf;

use crate::geometry::Transform;

use super::source::{Sources, Span};
use super::text::Text;

/// What an element makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Scene,
    Integrator,
    Sensor,
    Film,
    Sampler,
    Filter,
    Shape,
    Bsdf,
    Emitter,
    Texture,
    Medium,
    Phase,
    Volume,
}

impl Kind {
    /// All, with their tags.
    pub(super) const TAGS: [(Kind, &'static str); 13] = [
        (Kind::Scene, "scene"),
        (Kind::Integrator, "integrator"),
        (Kind::Sensor, "sensor"),
        (Kind::Film, "film"),
        (Kind::Sampler, "sampler"),
        (Kind::Filter, "rfilter"),
        (Kind::Shape, "shape"),
        (Kind::Bsdf, "bsdf"),
        (Kind::Emitter, "emitter"),
        (Kind::Texture, "texture"),
        (Kind::Medium, "medium"),
        (Kind::Phase, "phase"),
        (Kind::Volume, "volume"),
    ];

    pub(super) fn of_tag(tag: &str) -> Option<Kind> {
        Self::TAGS.iter().find(|(_, t)| *t == tag).map(|(k, _)| *k)
    }

    pub(super) fn tag(self) -> &'static str {
        Self::TAGS.iter().find(|(k, _)| *k == self).map_or("", |(_, t)| t)
    }
}

/// An object: a plugin with its properties and the objects inside it.
#[derive(Clone, Debug)]
pub(super) struct Object {
    pub(super) kind: Kind,
    /// The plugin's name (`type`); the scene itself has none.
    pub(super) plugin: Text,
    pub(super) id: Option<Text>,
    /// Its tag's name.
    pub(super) span: Span,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Child>,
}

/// An object inside another: written there, or referred to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    /// Index of the object.
    pub(super) object: usize,
    /// The tag or the reference's id.
    pub(super) span: Span,
}

/// A named value.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: Text,
    /// The value's place, or the tag's where the value has several parts.
    pub(super) span: Span,
    pub(super) value: Value,
}

/// Values, by the tag they were given with.
#[derive(Clone, Debug)]
pub(super) enum Value {
    Float(f64),
    Integer(i64),
    Boolean(bool),
    String(Text),
    /// `point` or `vector`: Mitsuba takes either for the other.
    Point([f64; 3]),
    Rgb([f64; 3]),
    Spectrum(Spectrum),
    Transform(Transform),
}

impl Value {
    /// The tag, for messages.
    pub(super) fn tag(&self) -> &'static str {
        match self {
            Self::Float(_) => "float",
            Self::Integer(_) => "integer",
            Self::Boolean(_) => "boolean",
            Self::String(_) => "string",
            Self::Point(_) => "point",
            Self::Rgb(_) => "rgb",
            Self::Spectrum(_) => "spectrum",
            Self::Transform(_) => "transform",
        }
    }
}

/// A spectrum as written.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Spectrum {
    /// The same at every wavelength.
    Uniform(f64),
    /// Wavelengths [nm], increasing, and values.
    Samples(Vec<(f64, f64)>),
}

/// A scene as it is written: the objects of an XML scene, with the position of every one of their
/// parts, parameters replaced, files included, references resolved; not yet checked against what
/// the plugins want. [`super::load_file`] makes it and checks it in one go.
#[derive(Clone, Debug)]
pub struct SceneDescription {
    pub(super) name: String,
    pub(super) sources: Sources,
    /// Every object; the first is the scene.
    pub(super) objects: Vec<Object>,
    /// Folders named by `<path>`.
    pub(super) folders: Vec<PathBuf>,
}

impl SceneDescription {
    /// The files it was read from: the scene first, then included ones.
    pub fn files(&self) -> impl Iterator<Item = &str> {
        self.sources.names()
    }

    /// The objects of a kind directly inside another.
    pub(super) fn children_of(&self, object: &Object, kind: Kind) -> impl Iterator<Item = Child> {
        object.children.iter().copied().filter(move |c| self.objects[c.object].kind == kind)
    }
}
