//! Description → plain Mitsuba 3 XML: parameters replaced, files included, transforms multiplied out.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::PathBuf;

use super::description::{Kind, Object, Property, SceneDescription, Spectrum, Value};
use super::load::find_file;
use super::message::{Checked, SceneError};
use super::model::ShapeId;
use crate::geometry::{Point3, Transform};

/// A scene as text that Mitsuba 3 loads as it is, and the files that have to lie beside it.
#[derive(Clone, Debug)]
pub struct PlainScene {
    /// The scene's name: that of the file that it was read from, without folder and extension.
    pub name: String,
    /// XML of version 3.0.0.
    pub text: String,
    /// Shapes that the text has as `ply`: surfaces that Mitsuba 3 does not know.
    pub surfaces: Vec<PlainSurface>,
    /// Files that the scene itself refers to.
    pub copies: Vec<PlainCopy>,
}

/// A surface that has to be written as a mesh in the world frame, its front as the surface's.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlainSurface {
    /// The shape in [`super::Scene::shapes`].
    pub shape: ShapeId,
    /// Name of the PLY file, without a folder.
    pub file: String,
}

/// A file that has to be copied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlainCopy {
    /// Where it is.
    pub from: PathBuf,
    /// Its name beside the text, without a folder.
    pub file: String,
}

impl SceneDescription {
    /// The scene in the words of Mitsuba 3 alone. Objects keep their order and ids; a `parametric` becomes
    /// the `ply` of a mesh in the world frame, without a transform and without `flip_normals`. Comments,
    /// parameters, aliases and the layout of included files are gone. Wants a scene that
    /// [`SceneDescription::scene`] accepts.
    ///
    /// # Errors
    /// A mesh file that is not found any more.
    pub fn plain(&self) -> Result<PlainScene, SceneError> {
        let writer = Writer {
            description: self,
            text: String::new(),
            names: BTreeSet::new(),
            surfaces: Vec::new(),
            copies: Vec::new(),
        };
        writer.whole().map_err(|complaint| complaint.render(&self.sources))
    }
}

/// State while a scene is written.
struct Writer<'d> {
    description: &'d SceneDescription,
    text: String,
    /// Names of files that are taken, in lower case: some file systems do not tell the cases apart.
    names: BTreeSet<String>,
    surfaces: Vec<PlainSurface>,
    copies: Vec<PlainCopy>,
}

impl Writer<'_> {
    fn whole(mut self) -> Checked<PlainScene> {
        let name = self.description.name.clone();
        self.names.insert(format!("{name}.xml").to_lowercase());
        self.text += "<scene version=\"3.0.0\">\n";
        let mut shapes = 0;
        for child in &self.description.objects[0].children {
            self.child(child.object, child.span, 1, ShapeId(shapes))?;
            shapes += u32::from(self.description.objects[child.object].kind == Kind::Shape);
        }
        self.text += "</scene>\n";
        let Self { text, surfaces, copies, .. } = self;
        Ok(PlainScene { name, text, surfaces, copies })
    }

    /// An object inside another, or the reference to it. `shape` is its number if it is a shape.
    fn child(
        &mut self,
        index: usize,
        span: super::source::Span,
        depth: usize,
        shape: ShapeId,
    ) -> Checked<()> {
        let object = &self.description.objects[index];
        // Where an object stands itself, the child's place is the object's.
        match &object.id {
            Some(id) if span != object.span => {
                self.line(depth, &format!("<ref id=\"{}\"/>", escaped(&id.value)));
                Ok(())
            }
            _ => self.object(object, depth, shape),
        }
    }

    fn object(&mut self, object: &Object, depth: usize, shape: ShapeId) -> Checked<()> {
        let is_formula = object.kind == Kind::Shape && object.plugin.value == "parametric";
        let plugin = if is_formula { "ply" } else { object.plugin.value.as_str() };
        let tag = object.kind.tag();
        let id = match &object.id {
            Some(id) => format!(" id=\"{}\"", escaped(&id.value)),
            None => String::new(),
        };
        let head = format!("<{tag} type=\"{}\"{id}", escaped(plugin));
        if object.properties.is_empty() && object.children.is_empty() {
            self.line(depth, &(head + "/>"));
            return Ok(());
        }
        self.line(depth, &(head + ">"));
        if is_formula {
            let stem = match &object.id {
                Some(id) => id.value.clone(),
                None => format!("shape_{}", shape.0 + 1),
            };
            let file = self.free_name(&stem, "ply");
            self.file_name(depth + 1, &file);
            self.surfaces.push(PlainSurface { shape, file });
        } else {
            for property in &object.properties {
                self.property(object, property, depth + 1)?;
            }
        }
        for child in &object.children {
            self.child(child.object, child.span, depth + 1, shape)?;
        }
        self.line(depth, &format!("</{tag}>"));
        Ok(())
    }

    fn property(&mut self, object: &Object, property: &Property, depth: usize) -> Checked<()> {
        let names_file = object.kind == Kind::Shape && property.name.value == "filename";
        if let (true, Value::String(name)) = (names_file, &property.value) {
            let description = self.description;
            let from = find_file(&description.sources, &description.folders, name)?;
            let known = self.copies.iter().find(|c| c.from == from).map(|c| c.file.clone());
            let file = known.unwrap_or_else(|| {
                let part = |p: Option<&std::ffi::OsStr>| {
                    p.map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
                };
                let file = self.free_name(&part(from.file_stem()), &part(from.extension()));
                self.copies.push(PlainCopy { from, file: file.clone() });
                file
            });
            self.file_name(depth, &file);
            return Ok(());
        }
        let (name, tag) = (escaped(&property.name.value), property.value.tag());
        if let Value::Transform(t) = &property.value {
            self.line(depth, &format!("<{tag} name=\"{name}\">"));
            self.line(depth + 1, &format!("<matrix value=\"{}\"/>", matrix(t)));
            self.line(depth, &format!("</{tag}>"));
        } else {
            let value = escaped(&value(&property.value));
            self.line(depth, &format!("<{tag} name=\"{name}\" value=\"{value}\"/>"));
        }
        Ok(())
    }

    fn file_name(&mut self, depth: usize, file: &str) {
        let line = format!("<string name=\"filename\" value=\"{}\"/>", escaped(file));
        self.line(depth, &line);
    }

    fn line(&mut self, depth: usize, line: &str) {
        self.text.extend(std::iter::repeat_n("    ", depth));
        self.text += line;
        self.text.push('\n');
    }

    /// A file name that nothing else has: the stem's letters, digits, `-` and `_`, a number if need be.
    fn free_name(&mut self, stem: &str, extension: &str) -> String {
        let clean = |text: &str| -> String {
            let keep = |c: char| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' };
            // Longer names than this some file systems do not take.
            text.chars().take(64).map(keep).collect()
        };
        let (stem, extension) = (clean(stem), clean(extension));
        (1..)
            .map(|n| match n {
                1 => format!("{stem}.{extension}"),
                _ => format!("{stem}_{n}.{extension}"),
            })
            .find(|name| self.names.insert(name.to_lowercase()))
            .unwrap_or_default()
    }
}

/// A value as an attribute says it: the shortest text that reads back to the same number.
fn value(value: &Value) -> String {
    match value {
        Value::Float(x) => format!("{x:?}"),
        Value::Integer(i) => i.to_string(),
        Value::Boolean(b) => b.to_string(),
        Value::String(text) => text.value.clone(),
        Value::Point(numbers) | Value::Rgb(numbers) => listed(numbers.iter()),
        Value::Spectrum(Spectrum::Uniform(x)) => format!("{x:?}"),
        Value::Spectrum(Spectrum::Samples(samples)) => {
            let pairs: Vec<String> = samples.iter().map(|(w, x)| format!("{w:?}:{x:?}")).collect();
            pairs.join(", ")
        }
        Value::Transform(t) => matrix(t),
    }
}

/// Sixteen numbers, row by row.
fn matrix(t: &Transform) -> String {
    let (linear, origin) = (t.linear(), t.point(&Point3::origin()));
    let mut numbers = Vec::with_capacity(16);
    for i in 0..3 {
        numbers.extend([linear[(i, 0)], linear[(i, 1)], linear[(i, 2)], origin[i]]);
    }
    numbers.extend([0.0, 0.0, 0.0, 1.0]);
    listed(numbers.iter()).replace(',', "")
}

fn listed<'n>(numbers: impl Iterator<Item = &'n f64>) -> String {
    numbers.map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", ")
}

/// Text as an attribute's value.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out += "&amp;",
            '<' => out += "&lt;",
            '>' => out += "&gt;",
            '"' => out += "&quot;",
            // A parameter's sign, and white space that would become blanks.
            '$' | '\t' | '\r' | '\n' => {
                let _ = write!(out, "&#{};", u32::from(c));
            }
            _ => out.push(c),
        }
    }
    out
}
