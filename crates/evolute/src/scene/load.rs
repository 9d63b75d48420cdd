//! From a file, or a text, to a checked scene.

use std::path::{Path, PathBuf};

use super::describe::{add_text, describe};
use super::description::SceneDescription;
use super::message::{Checked, Complaint, SceneError, quoted};
use super::model::Scene;
use super::source::{MAX_SCENE_BYTES, Sources, read_bytes};
use super::text::Text;

/// A scene, and what there is to say about its file.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: Scene,
    /// Sentences for the user about what was read and is not used (an integrator, say); the library
    /// prints nothing.
    pub notices: Vec<String>,
    /// The scene texts that were read: the file itself first, then the files it includes.
    pub files: Vec<String>,
}

/// Loads and checks a scene file. `parameters` are names and values for the `$name`s in it, before
/// every `<default>` (`-D` of the command line).
///
/// Reads at most 32 MB of XML, 250,000 elements, nested 64 deep, in files included 15 deep; file
/// names in it are relative to the file they stand in.
///
/// # Errors
/// The first fault: one message with its place, the offending text and what would be right.
pub fn load_file(
    path: impl AsRef<Path>,
    parameters: &[(String, String)],
) -> Result<Loaded, SceneError> {
    SceneDescription::from_file(path, parameters)?.load()
}

/// Loads and checks a scene that is at hand as text; `name` stands for it in messages. File names
/// in it are relative to the current folder.
///
/// # Errors
/// As [`load_file`].
pub fn load_str(
    name: &str,
    text: &str,
    parameters: &[(String, String)],
) -> Result<Loaded, SceneError> {
    SceneDescription::from_text(name, text, parameters)?.load()
}

impl SceneDescription {
    /// Reads a scene file without checking it against what plugins want.
    ///
    /// # Errors
    /// Files that cannot be read, XML that is not well-formed, values that are not of their type,
    /// unknown parameters and references.
    pub fn from_file(
        path: impl AsRef<Path>,
        parameters: &[(String, String)],
    ) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let mut sources = Sources::default();
        let read = read_bytes(path, MAX_SCENE_BYTES)
            .map_err(|why| {
                let name = path.to_string_lossy();
                Complaint::nowhere(format!(
                    "cannot read the scene {}: {why}; name a scene in Mitsuba 3's XML",
                    quoted(&name)
                ))
            })
            .and_then(|bytes| add_text(&mut sources, path, bytes));
        match read {
            Ok(_) => described(sources, path.canonicalize().ok(), parameters),
            Err(complaint) => Err(complaint.render(&sources)),
        }
    }

    /// Reads a scene that is at hand as text.
    ///
    /// # Errors
    /// As [`SceneDescription::from_file`].
    pub fn from_text(
        name: &str,
        text: &str,
        parameters: &[(String, String)],
    ) -> Result<Self, SceneError> {
        let mut sources = Sources::default();
        if text.len() as u64 > MAX_SCENE_BYTES {
            let message = format!("the scene is longer than {} MB", MAX_SCENE_BYTES >> 20);
            return Err(Complaint::nowhere(message).render(&sources));
        }
        sources.add(name.to_string(), text.to_string(), PathBuf::new());
        described(sources, None, parameters)
    }

    /// The checked scene with everything there is to say about its files.
    fn load(self) -> Result<Loaded, SceneError> {
        let (scene, notices) = self.scene()?;
        let files = self.files().map(str::to_string).collect();
        Ok(Loaded { scene, notices, files })
    }
}

fn described(
    sources: Sources,
    path: Option<PathBuf>,
    parameters: &[(String, String)],
) -> Result<SceneDescription, SceneError> {
    describe(sources, path, parameters).map_err(|(complaint, sources)| complaint.render(&sources))
}

/// A file named in a scene: beside the file that names it, else beside the scene's own file, else
/// in the folders named by `<path>`.
///
/// # Errors
/// When it is in none of them.
pub(super) fn find_file(sources: &Sources, folders: &[PathBuf], name: &Text) -> Checked<PathBuf> {
    if name.value.is_empty() {
        return Err(Complaint::at(name.span, "an empty file name"));
    }
    let near = &sources.file(name.span.file).folder;
    let main = &sources.file(0).folder;
    let candidates = [near, main].into_iter().chain(folders).map(|f| f.join(&name.value));
    let mut candidates: Vec<PathBuf> = candidates.collect();
    candidates.dedup();
    candidates.iter().find(|p| p.is_file()).cloned().ok_or_else(|| {
        let message = if candidates.iter().any(|p| p.exists()) {
            format!("{} is there, but it is no file", quoted(&name.value))
        } else {
            format!("there is no file {}", quoted(&name.value))
        };
        let complaint = Complaint::at(name.span, message);
        let looked: Vec<String> =
            candidates.iter().map(|p| quoted(&p.to_string_lossy()).to_string()).collect();
        if looked.is_empty() {
            complaint
        } else {
            complaint.help(format!("looked for {}", looked.join(", ")))
        }
    })
}
