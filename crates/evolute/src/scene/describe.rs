//! Elements → description: parameters, included files, ids and references, values.

use std::path::{Path, PathBuf};

use super::description::{Child, Kind, Object, Property, SceneDescription, Spectrum, Value};
use super::message::{Checked, Complaint, listed, nearest, quoted};

use super::number;
use super::references::References;
use super::source::{MAX_SCENE_BYTES, Sources, Span, read_bytes};
use super::spectrum;
use super::text::{Parameters, Text};
use super::transform_tag;
use super::xml::{self, Element};

/// Deepest chain of files that include each other, as in Mitsuba 3.
const MAX_INCLUDES_DEEP: usize = 15;

/// Most files of a scene: keeps a few files that include each other many times from growing
/// exponentially, long before the limits on bytes and elements do.
const MAX_FILES: usize = 1_000;

/// Tags that give a property a value.
const VALUE_TAGS: [&str; 9] =
    ["float", "integer", "boolean", "string", "point", "vector", "rgb", "spectrum", "transform"];

/// Tags that act on the description itself.
const OTHER_TAGS: [&str; 5] = ["default", "include", "ref", "alias", "path"];

/// Reads text and everything it includes into a description. `sources` has the scene's own text as
/// its first file; `path` is where that was read from, if from a file.
pub(super) fn describe(
    sources: Sources,
    path: Option<PathBuf>,
    parameters: &[(String, String)],
) -> Result<SceneDescription, (Complaint, Sources)> {
    let name = Path::new(&sources.file(0).name)
        .file_stem()
        .map_or_else(|| "scene".to_string(), |s| s.to_string_lossy().into_owned());
    let mut describer = Describer {
        sources,
        parameters: Parameters::default(),
        budget: xml::MAX_ELEMENTS,
        open_files: path.into_iter().collect(),
        objects: Vec::new(),
        folders: Vec::new(),
        references: References::default(),
    };
    match describer.whole(parameters) {
        Ok(()) => Ok(SceneDescription {
            name,
            sources: describer.sources,
            objects: describer.objects,
            folders: describer.folders,
        }),
        Err(complaint) => Err((complaint, describer.sources)),
    }
}

/// State while a scene is read.
struct Describer {
    sources: Sources,
    parameters: Parameters,
    /// Elements that may still be read.
    budget: usize,
    /// The files being read, each included by the one before, without links and dots.
    open_files: Vec<PathBuf>,
    objects: Vec<Object>,
    folders: Vec<PathBuf>,
    references: References,
}

/// The attributes of one element, parameters replaced.
pub(super) struct Attributes {
    tag: String,
    pub(super) span: Span,
    list: Vec<(String, Text)>,
}

impl Attributes {
    pub(super) fn get(&self, name: &str) -> Option<&Text> {
        self.list.iter().find(|(n, _)| n == name).map(|(_, t)| t)
    }

    /// # Errors
    /// When it is missing.
    pub(super) fn require(&self, name: &str) -> Checked<&Text> {
        self.get(name).ok_or_else(|| {
            Complaint::at(self.span, format!("<{}> needs the attribute \"{name}\"", self.tag))
                .help(format!("write <{} … {name}=\"…\"/>", self.tag))
        })
    }
}

impl Describer {
    fn whole(&mut self, parameters: &[(String, String)]) -> Checked<()> {
        self.parameters = Parameters::given(parameters)?;
        let root = xml::read(&self.sources, 0, &mut self.budget)?;
        let tag = self.sources.text(root.name);
        if tag != "scene" {
            return Err(Complaint::at(root.name, format!("the root element is <{tag}>"))
                .help("a scene begins with <scene version=\"3.0.0\"> and ends with </scene>"));
        }
        let attributes = self.attributes(&root, &["version", "type", "id", "name"])?;
        self.version(&attributes)?;
        self.objects.push(Object {
            kind: Kind::Scene,
            plugin: Text::constant("scene", root.name),
            id: None,
            span: root.name,
            properties: Vec::new(),
            children: Vec::new(),
        });
        for child in &root.children {
            self.element(child, 0)?;
        }
        self.references.resolve(&mut self.objects)?;
        self.parameters.all_used()
    }

    /// One element inside an object.
    fn element(&mut self, element: &Element, owner: usize) -> Checked<()> {
        let tag = self.sources.text(element.name).to_string();
        match tag.as_str() {
            "scene" => Err(Complaint::at(element.name, "a <scene> inside a scene")
                .help("to put a file's objects here write <include filename=\"…\"/>")),
            "default" => {
                let attributes = self.leaf(element, &["name", "value"])?;
                self.parameters
                    .set_default(attributes.require("name")?, attributes.require("value")?)
            }
            "include" => self.include(element, owner),
            "ref" => {
                let attributes = self.leaf(element, &["id", "name"])?;
                let id = attributes.require("id")?.clone();
                // Resolved when everything is read; until then the scene stands in.
                let children = &mut self.objects[owner].children;
                self.references.refer(owner, children.len(), id.clone());
                children.push(Child { object: 0, span: id.span });
                Ok(())
            }
            "alias" => {
                let attributes = self.leaf(element, &["id", "as"])?;
                let (id, new) = (attributes.require("id")?, attributes.require("as")?);
                self.references.alias(new.clone(), id.clone());
                Ok(())
            }
            "path" => {
                let attributes = self.leaf(element, &["value"])?;
                let value = attributes.require("value")?;
                if owner != 0 {
                    return Err(Complaint::at(
                        element.name,
                        "<path> belongs directly into the scene",
                    ));
                }
                let folder = self.sources.file(value.span.file).folder.join(&value.value);
                if !folder.is_dir() {
                    return Err(Complaint::at(
                        value.span,
                        format!("there is no folder {}", quoted(&folder.to_string_lossy())),
                    ));
                }
                self.folders.push(folder);
                Ok(())
            }
            _ if VALUE_TAGS.contains(&tag.as_str()) => self.property(&tag, element, owner),
            _ if transform_tag::NAMES.contains(&tag.as_str()) => {
                Err(Complaint::at(element.name, format!("<{tag}> belongs inside a <transform>"))
                    .help(format!("write <transform name=\"to_world\"><{tag} …/></transform>")))
            }
            _ => match Kind::of_tag(&tag) {
                Some(kind) => self.object(kind, element, owner, false),
                None => {
                    let tags = Kind::TAGS.iter().map(|(_, t)| *t);
                    Err(Complaint::at(element.name, format!("unknown element <{tag}>"))
                        .maybe_meant(nearest(
                            &tag,
                            tags.chain(VALUE_TAGS).chain(OTHER_TAGS).chain(transform_tag::NAMES),
                        )))
                }
            },
        }
    }

    /// An object inside another; `root` if it is the root of an included file.
    fn object(&mut self, kind: Kind, element: &Element, owner: usize, root: bool) -> Checked<()> {
        let allowed: &[&str] =
            if root { &["type", "id", "name", "version"] } else { &["type", "id", "name"] };
        let attributes = self.attributes(element, allowed)?;
        if root {
            self.version(&attributes)?;
        }
        let plugin = attributes.require("type")?.clone();
        let id = attributes.get("id").filter(|id| !id.value.is_empty()).cloned();
        let index = self.objects.len();
        if let Some(id) = &id {
            self.references.name(id, index)?;
        }
        self.objects.push(Object {
            kind,
            plugin,
            id,
            span: element.name,
            properties: Vec::new(),
            children: Vec::new(),
        });
        self.objects[owner].children.push(Child { object: index, span: element.name });
        for child in &element.children {
            self.element(child, index)?;
        }
        Ok(())
    }

    /// A named value.
    fn property(&mut self, tag: &str, element: &Element, owner: usize) -> Checked<()> {
        let triple = ["name", "value", "x", "y", "z"];
        let attributes = match tag {
            "transform" => self.attributes(element, &["name"])?,
            "point" | "vector" => self.leaf(element, &triple)?,
            "spectrum" => self.leaf(element, &["name", "value", "filename", "type", "id"])?,
            _ => self.leaf(element, &["name", "value"])?,
        };
        let name = attributes.require("name")?.clone();
        let span = attributes.get("value").map_or(element.name, |v| v.span);
        let value = || attributes.require("value");
        let value = match tag {
            "float" => Value::Float(number::float(value()?)?),
            "integer" => Value::Integer(number::integer(value()?)?),
            "boolean" => Value::Boolean(number::boolean(value()?)?),
            "string" => Value::String(value()?.clone()),
            "point" | "vector" => Value::Point(transform_tag::triple(&attributes, None)?),
            "rgb" => Value::Rgb(spectrum::rgb(value()?)?),
            "spectrum" => Value::Spectrum(self.spectrum(&attributes)?),
            _ => {
                let mut steps = Vec::new();
                for step in &element.children {
                    let tag = self.sources.text(step.name).to_string();
                    let allowed = transform_tag::attributes(&tag).ok_or_else(|| {
                        Complaint::at(step.name, format!("unknown transform step <{tag}>"))
                            .maybe_meant(nearest(&tag, transform_tag::NAMES))
                            .help(format!("steps are {}", listed(transform_tag::NAMES, "and")))
                    })?;
                    steps.push((tag, self.leaf(step, allowed)?));
                }
                Value::Transform(transform_tag::product(&steps)?)
            }
        };
        let properties = &mut self.objects[owner].properties;
        if let Some(before) = properties.iter().find(|p| p.name.value == name.value) {
            return Err(Complaint::at(
                name.span,
                format!("{} is given twice", quoted(&name.value)),
            )
            .related(before.name.span, "the first time"));
        }
        properties.push(Property { name, span, value });
        Ok(())
    }

    /// A spectrum's value, or the table in the file it names.
    fn spectrum(&self, attributes: &Attributes) -> Checked<Spectrum> {
        if let Some(plugin) = attributes.get("type") {
            return Err(Complaint::at(
                plugin.span,
                format!("spectrum plugins such as {} are not known here", quoted(&plugin.value)),
            )
            .help("write <spectrum name=\"…\" value=\"400:0.1, 700:0.2\"/>, or one number for all wavelengths"));
        }
        match (attributes.get("value"), attributes.get("filename")) {
            (Some(value), None) => spectrum::spectrum(value),
            (None, Some(name)) => {
                let path = super::load::find_file(&self.sources, &self.folders, name)?;
                let bytes = read_bytes(&path, spectrum::MAX_TABLE_BYTES)
                    .map_err(|why| cannot_read(name, &path, &why))?;
                spectrum::table(&String::from_utf8_lossy(&bytes), name)
            }
            _ => Err(Complaint::at(
                attributes.span,
                "<spectrum> needs either \"value\" or \"filename\"",
            )),
        }
    }

    /// The contents of another file.
    fn include(&mut self, element: &Element, owner: usize) -> Checked<()> {
        let attributes = self.leaf(element, &["filename"])?;
        let name = attributes.require("filename")?;
        let path = super::load::find_file(&self.sources, &self.folders, name)?;
        let real = path.canonicalize().map_err(|e| cannot_read(name, &path, &e.to_string()))?;
        if self.open_files.contains(&real) {
            return Err(Complaint::at(
                name.span,
                format!("{} includes itself", quoted(&name.value)),
            )
            .label("a loop of files that include each other")
            .help("remove one of the <include …/>s of the loop"));
        }
        if self.open_files.len() > MAX_INCLUDES_DEEP {
            return Err(Complaint::at(
                name.span,
                format!("files include each other more than {MAX_INCLUDES_DEEP} deep"),
            )
            .help("include the files from the scene itself"));
        }
        if self.sources.names().count() >= MAX_FILES {
            return Err(Complaint::at(
                name.span,
                format!("the scene includes more than {MAX_FILES} files"),
            )
            .help("files that include each other multiply: include each once, from the scene"));
        }
        let left = MAX_SCENE_BYTES.saturating_sub(self.sources.total_bytes());
        let bytes = read_bytes(&path, left).map_err(|why| cannot_read(name, &path, &why))?;
        let file = add_text(&mut self.sources, &path, bytes)?;
        let root = xml::read(&self.sources, file, &mut self.budget)?;
        self.open_files.push(real);
        let tag = self.sources.text(root.name).to_string();
        match Kind::of_tag(&tag) {
            Some(Kind::Scene) if owner == 0 => {
                let attributes = self.attributes(&root, &["version", "type", "id", "name"])?;
                self.version(&attributes)?;
                for child in &root.children {
                    self.element(child, owner)?;
                }
            }
            Some(Kind::Scene) => {
                return Err(Complaint::at(
                    name.span,
                    "a file with a <scene> cannot be included inside an object",
                )
                .related(root.name, "its root")
                .help("include it directly in the scene, or make the object its root element"));
            }
            Some(kind) => self.object(kind, &root, owner, true)?,
            None => {
                return Err(Complaint::at(root.name, format!("the root element is <{tag}>"))
                    .related(name.span, "included here")
                    .help("an included file's root is a <scene> or an object such as <shape>"));
            }
        }
        self.open_files.pop();
        Ok(())
    }

    /// The attributes of an element that has no children.
    fn leaf(&mut self, element: &Element, allowed: &[&str]) -> Checked<Attributes> {
        if let Some(child) = element.children.first() {
            let tag = self.sources.text(element.name);
            return Err(Complaint::at(
                child.name,
                format!("<{}> inside <{tag}>", self.sources.text(child.name)),
            )
            .related(element.name, "nothing may be inside this")
            .help(format!("close it at once: <{tag} …/>")));
        }
        self.attributes(element, allowed)
    }

    /// The attributes of an element, each of which must be allowed.
    fn attributes(&mut self, element: &Element, allowed: &[&str]) -> Checked<Attributes> {
        let tag = self.sources.text(element.name).to_string();
        let mut list = Vec::with_capacity(element.attributes.len());
        for attribute in &element.attributes {
            let name = self.sources.text(attribute.name).to_string();
            if !allowed.contains(&name.as_str()) {
                return Err(Complaint::at(
                    attribute.name,
                    format!("unknown attribute {} of <{tag}>", quoted(&name)),
                )
                .maybe_meant(nearest(&name, allowed.iter().copied()))
                .help(format!("<{tag}> takes {}", listed(allowed.iter().copied(), "and"))));
            }
            list.push((name, self.parameters.expand(&self.sources, attribute.value)?));
        }
        Ok(Attributes { tag, span: element.name, list })
    }

    /// The version of a file: that of Mitsuba's scene format.
    fn version(&self, attributes: &Attributes) -> Checked<()> {
        let version = attributes.require("version")?;
        let parts: Vec<Option<u32>> =
            version.value.trim().split('.').map(|p| p.parse().ok()).collect();
        let say = |message: String| Complaint::at(version.span, message);
        match parts.as_slice() {
            [Some(2 | 3), Some(_), Some(_)] => Ok(()),
            [Some(0 | 1), Some(_), Some(_)] => Err(say(format!(
                "scenes of version {} have other names than today's",
                version.value.trim()
            ))
            .help("load the scene with Mitsuba 3 once and save it: it translates the names")),
            [Some(_), Some(_), Some(_)] => {
                Err(say(format!("version {} is not known", version.value.trim()))
                    .help("scenes here are of version 3.0.0"))
            }
            _ => Err(say(format!("{} is not a version", quoted(&version.value)))
                .help("write version=\"3.0.0\"")),
        }
    }
}

/// Takes a file's bytes into the sources.
///
/// # Errors
/// When they are not UTF-8, at the place where they stop to be.
pub(super) fn add_text(sources: &mut Sources, path: &Path, bytes: Vec<u8>) -> Checked<u32> {
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_path_buf);
    let name = path.to_string_lossy().into_owned();
    match String::from_utf8(bytes) {
        Ok(text) => Ok(sources.add(name, text, folder)),
        Err(error) => {
            let at = error.utf8_error().valid_up_to() as u32;
            let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
            let file = sources.add(name, text, folder);
            Err(Complaint::at(Span { file, start: at, end: at + 1 }, "this is not UTF-8 text")
                .help("save the file as UTF-8"))
        }
    }
}

/// A file that cannot be read.
pub(super) fn cannot_read(name: &Text, path: &Path, why: &str) -> Complaint {
    Complaint::at(name.span, format!("cannot read {}: {why}", quoted(&path.to_string_lossy())))
}
