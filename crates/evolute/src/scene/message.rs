//! Messages: what is wrong, where, and what would be right.

use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

use codespan_reporting::diagnostic::{Diagnostic, Label};
use codespan_reporting::files::{Error as FilesError, Files};
use codespan_reporting::term;

use super::source::{Location, Sources, Span};

/// Why a scene was refused: one message, with file, line, column and the offending text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{rendered}")]
pub struct SceneError {
    message: String,
    location: Option<Location>,
    rendered: String,
}

impl SceneError {
    /// The first line without position or excerpt.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Where the offending text stands; `None` if the fault lies in no text (a file that is not
    /// there, a parameter nobody asked for).
    pub fn location(&self) -> Option<&Location> {
        self.location.as_ref()
    }
}

/// A fault found while reading, before it is rendered with its text.
#[derive(Debug)]
pub(super) struct Complaint(Box<Parts>);

#[derive(Debug)]
struct Parts {
    message: String,
    span: Option<Span>,
    label: String,
    related: Option<(Span, String)>,
    notes: Vec<String>,
}

/// What every function that reads a scene returns.
pub(super) type Checked<T> = Result<T, Complaint>;

impl Complaint {
    /// A fault at a place in a text; `message` is a sentence about the rule that was broken.
    pub(super) fn at(span: Span, message: impl Into<String>) -> Self {
        let mut complaint = Self::nowhere(message);
        complaint.0.span = Some(span);
        complaint
    }

    /// A fault that stands in no text.
    pub(super) fn nowhere(message: impl Into<String>) -> Self {
        Self(Box::new(Parts {
            message: message.into(),
            span: None,
            label: String::new(),
            related: None,
            notes: Vec::new(),
        }))
    }

    /// A few words beside the underlined text.
    pub(super) fn label(mut self, text: impl Into<String>) -> Self {
        self.0.label = text.into();
        self
    }

    /// A second place that has to do with the fault.
    pub(super) fn related(mut self, span: Span, text: impl Into<String>) -> Self {
        self.0.related = Some((span, text.into()));
        self
    }

    /// What would be right.
    pub(super) fn help(mut self, text: impl Into<String>) -> Self {
        self.0.notes.push(text.into());
        self
    }

    /// `did you mean "…"?` if a known name is near.
    pub(super) fn maybe_meant(self, name: Option<&str>) -> Self {
        match name {
            Some(name) => self.help(format!("did you mean \"{name}\"?")),
            None => self,
        }
    }

    /// The message with its excerpt, as text without colours.
    pub(super) fn render(self, sources: &Sources) -> SceneError {
        let parts = *self.0;
        let mut excerpts = Excerpts(Vec::new());
        let mut labels = Vec::new();
        if let Some(span) = parts.span {
            let range = excerpts.add(sources, span);
            labels.push(Label::primary(0, range).with_message(parts.label));
            if let Some((span, text)) = parts.related {
                let range = excerpts.add(sources, span);
                labels.push(Label::secondary(1, range).with_message(text));
            }
        }
        let diagnostic = Diagnostic::error()
            .with_message(parts.message.clone())
            .with_labels(labels)
            .with_notes(parts.notes.clone());
        let location = parts.span.map(|span| sources.location(span));
        let rendered = term::emit_into_string(&term::Config::default(), &excerpts, &diagnostic)
            .map(|text| text.trim_end().to_string())
            .unwrap_or_else(|_| plain(&parts.message, location.as_ref(), &parts.notes));
        SceneError { message: parts.message, location, rendered }
    }
}

/// The message without an excerpt.
fn plain(message: &str, location: Option<&Location>, notes: &[String]) -> String {
    let mut text = match location {
        Some(l) => format!("error: {}:{}:{}: {message}", l.file, l.line, l.column),
        None => format!("error: {message}"),
    };
    for note in notes {
        text.push('\n');
        text.push_str(note);
    }
    text
}

/// Text of the user's in a message: quoted, control characters made visible, long texts cut.
pub(super) fn quoted(text: &str) -> impl fmt::Display {
    // Enough for any name of the language and for a formula's first terms.
    const LONGEST: usize = 60;
    let mut shown: String = text.chars().take(LONGEST).map(harmless).collect();
    if text.chars().nth(LONGEST).is_some() {
        shown.push('…');
    }
    format!("\"{shown}\"")
}

/// `a, b and c`, with the word given.
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a str>, word: &str) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    match names.as_slice() {
        [] => "nothing".to_string(),
        [only] => (*only).to_string(),
        [first @ .., last] => format!("{} {word} {last}", first.join(", ")),
    }
}

/// A number as one would write it: `0.5`, `1e308`.
pub(super) fn shown(x: f64) -> String {
    if x == 0.0 || (1e-4..1e9).contains(&x.abs()) { format!("{x}") } else { format!("{x:e}") }
}

/// The known name nearest to a misspelt one, if it is near.
pub(super) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Comparing costs the product of both lengths, so long names and endless lists (ids of a large
    // scene) are left out; no name of the language has half that many letters.
    const LONGEST: usize = 64;
    const MOST: usize = 10_000;
    if name.len() > LONGEST {
        return None;
    }
    let known = known.into_iter().filter(|k| k.len() <= LONGEST).take(MOST);
    crate::formula::nearest_name(name, known)
}

/// Characters that would move a terminal's cursor or reorder its text become a replacement mark.
fn harmless(c: char) -> char {
    match c {
        '\t' => ' ',
        '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' => '\u{fffd}',
        c if c.is_control() => '\u{fffd}',
        c => c,
    }
}

/// One line of a text, or the part of a very long line around the place in question.
struct Excerpt {
    name: String,
    text: String,
    line: usize,
    column: usize,
}

/// The lines a message shows; what codespan-reporting takes for its files.
struct Excerpts(Vec<Excerpt>);

impl Excerpts {
    /// Takes in the line a span starts in, and gives the span's place in it.
    fn add(&mut self, sources: &Sources, span: Span) -> Range<usize> {
        // Lines wider than a terminal are shown from 40 characters before the place to 100 after
        // its start.
        const BEFORE: usize = 40;
        const AFTER: usize = 100;
        let file = sources.file(span.file);
        let (line, line_start) = sources.line_of(span);
        let before = file.text.get(line_start..span.start as usize).unwrap_or("");
        let after = file.text.get(span.start as usize..).unwrap_or("");
        let after = after.split(['\n', '\r']).next().unwrap_or("");
        let inside = ((span.end - span.start) as usize).min(after.len());

        let column = before.chars().count() + 1;
        let mut text: String = if column > BEFORE + AFTER {
            std::iter::once('…').chain(before.chars().skip(column - BEFORE).map(harmless)).collect()
        } else {
            before.chars().map(harmless).collect()
        };
        let start = text.len();
        let mut end = start;
        for (i, (offset, c)) in after.char_indices().enumerate() {
            if i == AFTER {
                text.push('…');
                break;
            }
            text.push(harmless(c));
            if offset < inside {
                end = text.len();
            }
        }
        self.0.push(Excerpt { name: file.name.clone(), text, line, column });
        start..end
    }

    fn get(&self, id: usize) -> Result<&Excerpt, FilesError> {
        self.0.get(id).ok_or(FilesError::FileMissing)
    }
}

impl<'a> Files<'a> for Excerpts {
    type FileId = usize;
    type Name = Cow<'a, str>;
    type Source = &'a str;

    fn name(&'a self, id: usize) -> Result<Self::Name, FilesError> {
        Ok(Cow::Borrowed(&self.get(id)?.name))
    }

    fn source(&'a self, id: usize) -> Result<&'a str, FilesError> {
        Ok(&self.get(id)?.text)
    }

    fn line_index(&'a self, _: usize, _: usize) -> Result<usize, FilesError> {
        Ok(0)
    }

    fn line_number(&'a self, id: usize, _: usize) -> Result<usize, FilesError> {
        Ok(self.get(id)?.line)
    }

    /// Each excerpt has one label, so the column asked for is the label's.
    fn column_number(&'a self, id: usize, _: usize, _: usize) -> Result<usize, FilesError> {
        Ok(self.get(id)?.column)
    }

    fn line_range(&'a self, id: usize, _: usize) -> Result<Range<usize>, FilesError> {
        Ok(0..self.get(id)?.text.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources(text: &str) -> Sources {
        let mut sources = Sources::default();
        sources.add("dir/a.xml".into(), text.into(), Default::default());
        sources
    }

    #[test]
    fn a_message_shows_file_line_column_text_and_help() {
        let sources = sources("<scene>\n  <float name=\"raduis\"/>\r\n</scene>");
        let error = Complaint::at(Span { file: 0, start: 23, end: 29 }, "unknown property")
            .label("here")
            .help("did you mean \"radius\"?")
            .render(&sources);
        let text = error.to_string();
        assert!(text.starts_with("error: unknown property"), "{text}");
        assert!(text.contains("dir/a.xml:2:16"), "{text}");
        assert!(text.contains("<float name=\"raduis\"/>"), "{text}");
        assert!(text.contains("^^^^^^ here"), "{text}");
        assert!(text.contains("did you mean \"radius\"?"), "{text}");
        assert!(!text.contains('\r') && !text.contains('\u{1b}'), "{text:?}");
        assert_eq!(error.location().map(|l| (l.line, l.column)), Some((2, 16)));
    }

    #[test]
    fn long_lines_are_cut_and_escape_codes_do_not_get_through() {
        let text = format!("{}\u{1b}[31mX{}", "a".repeat(1_000_000), "b".repeat(1_000_000));
        let sources = sources(&text);
        let at = Span { file: 0, start: 1_000_000, end: 2_000_000 };
        let error = Complaint::at(at, "bad").render(&sources);
        assert!(error.to_string().len() < 2_000);
        assert!(error.to_string().contains("dir/a.xml:1:1000001"), "{error}");
        assert!(!error.to_string().contains('\u{1b}'));
        assert!(quoted(&text).to_string().len() < 300);
    }

    #[test]
    fn spans_at_the_end_of_the_text_and_across_lines_are_rendered() {
        let sources = sources("ab\ncd");
        for (start, end) in [(5, 5), (0, 5), (2, 2), (3, 5)] {
            let error = Complaint::at(Span { file: 0, start, end }, "bad")
                .related(Span { file: 0, start: 0, end: 1 }, "opened here")
                .render(&sources);
            assert!(error.to_string().contains("opened here"), "{error}");
        }
    }
}
