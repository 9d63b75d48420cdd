//! The texts a scene comes from, and positions in them.

use std::io::Read;
use std::path::{Path, PathBuf};

/// Longest scene text in bytes, all included files together: the largest scenes written by
/// exporters are a few MB (their geometry lies in mesh files), and a mutated or hostile file must
/// not eat the machine.
pub(super) const MAX_SCENE_BYTES: u64 = 32 << 20;

/// A range of bytes in one of the texts of [`Sources`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) file: u32,
    pub(super) start: u32,
    pub(super) end: u32,
}

impl Span {
    /// The part `start..end` (bytes, relative to this span's start), cut to this span.
    pub(super) fn part(&self, start: usize, end: usize) -> Span {
        let length = (self.end - self.start) as usize;
        Span {
            start: self.start + start.min(length) as u32,
            end: self.start + end.clamp(start.min(length), length) as u32,
            ..*self
        }
    }
}

/// Where something stands: for messages.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Location {
    /// The file's name as it was asked for.
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

/// One text.
#[derive(Clone, Debug)]
pub(super) struct SourceFile {
    pub(super) name: String,
    pub(super) text: String,
    /// The folder that relative file names in this text start from.
    pub(super) folder: PathBuf,
}

/// All texts of a scene.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    files: Vec<SourceFile>,
}

impl Sources {
    /// Takes a text in and gives its index.
    pub(super) fn add(&mut self, name: String, text: String, folder: PathBuf) -> u32 {
        self.files.push(SourceFile { name, text, folder });
        (self.files.len() - 1) as u32
    }

    pub(super) fn file(&self, index: u32) -> &SourceFile {
        &self.files[index as usize]
    }

    /// The text a span covers.
    pub(super) fn text(&self, span: Span) -> &str {
        self.file(span.file).text.get(span.start as usize..span.end as usize).unwrap_or("")
    }

    /// Bytes of all texts together.
    pub(super) fn total_bytes(&self) -> u64 {
        self.files.iter().map(|f| f.text.len() as u64).sum()
    }

    /// File, line and column of a span's start.
    pub(super) fn location(&self, span: Span) -> Location {
        let file = self.file(span.file);
        let (line, line_start) = self.line_of(span);
        let column =
            file.text.get(line_start..span.start as usize).map_or(0, |t| t.chars().count());
        Location { file: file.name.clone(), line, column: column + 1 }
    }

    /// The number, from 1, and the first byte of the line that a span starts in.
    pub(super) fn line_of(&self, span: Span) -> (usize, usize) {
        let before = self.file(span.file).text.as_bytes().get(..span.start as usize).unwrap_or(&[]);
        let line = before.iter().filter(|b| **b == b'\n').count() + 1;
        let start = before.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
        (line, start)
    }

    /// The file names of all texts.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.files.iter().map(|f| f.name.as_str())
    }
}

/// Reads a whole file of at most `limit` bytes.
///
/// # Errors
/// A clause that completes "cannot read FILE: ".
pub(super) fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let file = std::fs::File::open(path).map_err(|e| match e.kind() {
        std::io::ErrorKind::NotFound => "there is no such file".to_string(),
        std::io::ErrorKind::PermissionDenied => "permission denied".to_string(),
        _ => e.to_string(),
    })?;
    let about = file.metadata().map_err(|e| e.to_string())?;
    if about.is_dir() {
        return Err("it is a folder".to_string());
    }
    if about.len() > limit {
        return Err(too_long(limit));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    // A device or pipe says nothing true about its length, hence the limit again.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if bytes.len() as u64 > limit {
        return Err(too_long(limit));
    }
    Ok(bytes)
}

fn too_long(limit: u64) -> String {
    format!("it is longer than {} MB, the most that is read", limit >> 20)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_count_from_one_in_characters() {
        let mut sources = Sources::default();
        let file = sources.add("a.xml".into(), "éx\r\n  <b/>".into(), PathBuf::new());
        let at = |start| sources.location(Span { file, start, end: start });
        assert_eq!((at(0).line, at(0).column), (1, 1));
        assert_eq!((at(2).line, at(2).column), (1, 2), "é is two bytes and one column");
        assert_eq!((at(7).line, at(7).column), (2, 3));
    }

    #[test]
    fn a_folder_is_not_read() {
        let message = read_bytes(Path::new("."), 10).expect_err("a folder");
        assert!(message.contains("folder"), "{message}");
    }
}
