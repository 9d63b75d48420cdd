//! XML text → elements and attributes with their positions.
//!
//! The reader is `quick-xml`; what it does not check is checked here: one root, nothing but space
//! beside elements, no document type (and so no entities of one's own), no end of the file inside an
//! element, nesting that no recursion runs out of stack on.

use quick_xml::errors::{Error, IllFormedError, SyntaxError};
use quick_xml::events::attributes::AttrError;
use quick_xml::events::{BytesStart, Event};
use quick_xml::reader::Reader;

use super::message::{Checked, Complaint, quoted};
use super::source::{Sources, Span};

/// Deepest nesting: a bsdf in a bsdf in a shape in the scene is 4, so this is plenty, and small
/// enough that recursion over the tree needs no thought.
pub(super) const MAX_DEPTH: usize = 64;

/// Most elements of a scene, all files together: some 60 MB of tree.
pub(super) const MAX_ELEMENTS: usize = 250_000;

/// An element; its text is in the sources.
#[derive(Clone, Debug)]
pub(super) struct Element {
    /// Its name in the opening tag.
    pub(super) name: Span,
    pub(super) attributes: Vec<Attribute>,
    pub(super) children: Vec<Element>,
}

/// An attribute; the value's span is without the quotes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attribute {
    pub(super) name: Span,
    pub(super) value: Span,
}

/// Reads a text of `sources` and gives its root. `budget` is how many elements may still be read.
///
/// # Errors
/// Anything that is not well-formed, a document type, an empty text, more than the limits allow.
pub(super) fn read(sources: &Sources, file: u32, budget: &mut usize) -> Checked<Element> {
    let whole = sources.file(file).text.as_str();
    // quick-xml takes a byte-order mark away and counts without it; positions count with it.
    let text = whole.strip_prefix('\u{feff}').unwrap_or(whole);
    let mut document =
        DocumentReader { file, base: whole.len() - text.len(), text, open: Vec::new(), root: None };
    let mut reader = Reader::from_str(text);
    reader.config_mut().check_comments = true;
    let mut first = true;
    loop {
        let start = reader.buffer_position() as usize;
        let event = match reader.read_event() {
            Ok(event) => event,
            Err(error) => {
                let at = reader.error_position() as usize;
                let at = if matches!(error, Error::IllFormed(_)) { start } else { at };
                return Err(document.ill_formed(sources, &error, at));
            }
        };
        let span = document.span(start, reader.buffer_position() as usize);
        match event {
            Event::Start(tag) => document.enter(sources, &tag, budget)?,
            Event::Empty(tag) => {
                document.enter(sources, &tag, budget)?;
                document.leave();
            }
            Event::End(_) => document.leave(),
            Event::Text(text) => {
                // Where the text itself begins, after the space before it.
                let skip = text.len() - text.trim_start().len();
                if skip < text.len() {
                    let length = text.trim_end().len();
                    return Err(stray(sources, span.part(skip, length)));
                }
            }
            Event::CData(_) | Event::GeneralRef(_) => return Err(stray(sources, span)),
            Event::DocType(_) => {
                return Err(Complaint::at(span.part(0, 9), "a document type is not allowed").help(
                    "scene files need none: remove the <!DOCTYPE …> and every entity it defines; \
                           for values used more than once take <default name=\"…\" value=\"…\"/>",
                ));
            }
            Event::Decl(declaration) => {
                if !first {
                    return Err(Complaint::at(span, "the XML declaration is not at the beginning")
                        .help("<?xml …?> may stand in the first line only: remove this one"));
                }
                if let Some(Ok(encoding)) = declaration.encoding()
                    && !["utf-8", "utf8", "us-ascii", "ascii"]
                        .contains(&encoding.to_ascii_lowercase().as_str())
                {
                    return Err(Complaint::at(
                        span,
                        format!("the encoding {} is not read", quoted(&encoding)),
                    )
                    .help("save the file as UTF-8"));
                }
            }
            Event::Comment(_) | Event::PI(_) => {}
            Event::Eof => break,
        }
        first = false;
    }
    if let Some(element) = document.open.last() {
        let name = quoted_tag(sources, element.name);
        return Err(Complaint::at(
            element.name,
            format!("{name} is not closed: the file ends inside it"),
        )
        .label("opened here")
        .help(format!("close it with </{}>", sources.text(element.name))));
    }
    document.root.ok_or_else(|| {
        Complaint::at(
            Span { file, start: 0, end: 0 },
            "the file is empty: there is no element in it",
        )
        .help("a scene begins with <scene version=\"3.0.0\"> and ends with </scene>")
    })
}

/// What has been read of a document so far.
struct DocumentReader<'t> {
    file: u32,
    /// Bytes of the file before `text`.
    base: usize,
    text: &'t str,
    /// The elements that are open, outermost first.
    open: Vec<Element>,
    root: Option<Element>,
}

impl DocumentReader<'_> {
    fn span(&self, start: usize, end: usize) -> Span {
        let clamp = |offset: usize| (self.base + offset.min(self.text.len())) as u32;
        Span { file: self.file, start: clamp(start), end: clamp(end.max(start)) }
    }

    /// The span of a piece of the text, by its address in it.
    fn span_of(&self, piece: &str) -> Span {
        let offset = (piece.as_ptr() as usize).wrapping_sub(self.text.as_ptr() as usize);
        self.span(offset, offset.saturating_add(piece.len()))
    }

    /// An opening tag.
    fn enter(
        &mut self,
        sources: &Sources,
        tag: &BytesStart<'_>,
        budget: &mut usize,
    ) -> Checked<()> {
        let name = self.span_of(tag.name().0);
        if let Some(root) = &self.root {
            return Err(Complaint::at(name, "a second root element")
                .related(root.name, "the first")
                .help("an XML file has one: put everything inside it, or remove the second"));
        }
        if name.start == name.end {
            return Err(Complaint::at(name, "a tag without a name"));
        }
        if let Some(at) = tag.find('<') {
            let content = self.span_of(tag);
            return Err(Complaint::at(content.part(at, at + 1), "a \"<\" inside a tag")
                .related(name, "in this tag")
                .help(
                    "a closing quote or a \">\" is missing before it (inside a value write &lt;)",
                ));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(Complaint::at(
                name,
                format!("elements are nested more than {MAX_DEPTH} deep"),
            )
            .help("no scene needs that: give nested objects an id and use <ref id=\"…\"/>"));
        }
        *budget = budget.checked_sub(1).ok_or_else(|| {
            Complaint::at(name, format!("the scene has more than {MAX_ELEMENTS} elements"))
                .help("put geometry into PLY or OBJ files")
        })?;
        let mut attributes = Vec::new();
        for attribute in tag.attributes() {
            let attribute = attribute.map_err(|error| self.bad_attribute(tag, &error))?;
            attributes.push(Attribute {
                name: self.span_of(attribute.key.0),
                value: self.span_of(&attribute.value),
            });
        }
        if let Some(bad) = attributes.iter().find(|a| a.name.start == a.name.end) {
            return Err(Complaint::at(bad.name, "an attribute without a name")
                .related(name, format!("in {}", quoted_tag(sources, name))));
        }
        self.open.push(Element { name, attributes, children: Vec::new() });
        Ok(())
    }

    /// A closing tag; that it closes the right element, quick-xml has checked.
    fn leave(&mut self) {
        if let Some(element) = self.open.pop() {
            match self.open.last_mut() {
                Some(parent) => parent.children.push(element),
                None => self.root = Some(element),
            }
        }
    }

    /// Attribute errors count from after the tag's "<".
    fn bad_attribute(&self, tag: &BytesStart<'_>, error: &AttrError) -> Complaint {
        let content = self.span_of(tag);
        let at = |position: usize| content.part(position, position + 1);
        match *error {
            AttrError::ExpectedEq(p) => Complaint::at(at(p), "an attribute without \"=\"")
                .help("attributes are written name=\"value\"; a quote may be missing before this"),
            AttrError::ExpectedValue(p) => Complaint::at(at(p), "an attribute without a value")
                .help("attributes are written name=\"value\""),
            AttrError::UnquotedValue(p) => {
                Complaint::at(at(p), "an attribute value without quotes")
                    .help("attributes are written name=\"value\"")
            }
            AttrError::ExpectedQuote(p, quote) => Complaint::at(
                at(p),
                format!("an attribute value that is not closed with {}", char::from(quote)),
            ),
            AttrError::Duplicated(p, before) => Complaint::at(at(p), "an attribute given twice")
                .related(at(before), "the first time"),
        }
    }

    fn ill_formed(&self, sources: &Sources, error: &Error, at: usize) -> Complaint {
        let here = self.span(at, at + 1);
        let open = self.open.last();
        match error {
            Error::IllFormed(IllFormedError::MismatchedEndTag { expected, found }) => {
                let complaint = Complaint::at(
                    self.span(at, at + found.len() + 3),
                    format!("</{found}> closes <{expected}>"),
                )
                .help(format!("write </{expected}>, or close it before"));
                match open {
                    Some(element) => complaint.related(element.name, "opened here"),
                    None => complaint,
                }
            }
            Error::IllFormed(IllFormedError::UnmatchedEndTag(name)) => Complaint::at(
                self.span(at, at + name.len() + 3),
                format!("</{name}> closes nothing"),
            )
            .help("no element of that name is open here: remove the tag, or look for a \"/>\" too many"),
            Error::IllFormed(IllFormedError::DoubleHyphenInComment) => {
                Complaint::at(self.span(at, at + 4), "a comment contains \"--\"")
                    .help("XML allows two hyphens only at a comment's ends")
            }
            Error::IllFormed(IllFormedError::UnclosedReference) => {
                stray(sources, here).help("an \"&\" is written &amp;")
            }
            Error::Syntax(
                SyntaxError::UnclosedTag
                | SyntaxError::UnclosedSingleQuotedAttributeValue
                | SyntaxError::UnclosedDoubleQuotedAttributeValue,
            ) => Complaint::at(here, "a tag that is not closed: the file ends inside it")
                .label("begins here")
                .help("a \">\" or a closing quote is missing"),
            Error::Syntax(SyntaxError::UnclosedComment) => {
                Complaint::at(here, "a comment that is not closed").help("comments end with -->")
            }
            Error::Syntax(error) => Complaint::at(here, error.to_string()),
            other => Complaint::at(here, format!("this is not XML: {other}")),
        }
    }
}

/// Text where only elements may be.
fn stray(sources: &Sources, span: Span) -> Complaint {
    Complaint::at(span, format!("text outside of tags: {}", quoted(sources.text(span)))).help(
        "values stand in attributes: <float name=\"radius\" value=\"1\"/>; comments are <!-- … -->",
    )
}

/// `<name>` for messages.
fn quoted_tag(sources: &Sources, name: Span) -> String {
    format!("<{}>", sources.text(name))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn parse(text: &str) -> Result<(Sources, Element), String> {
        let mut sources = Sources::default();
        let file = sources.add("a.xml".into(), text.into(), Default::default());
        match read(&sources, file, &mut MAX_ELEMENTS.clone()) {
            Ok(root) => Ok((sources, root)),
            Err(complaint) => Err(complaint.render(&sources).to_string()),
        }
    }

    fn message(text: &str) -> String {
        parse(text).map(|(_, root)| root).expect_err(text)
    }

    #[test]
    fn names_and_values_keep_their_places() {
        for text in
            ["<a>\r\n <b c='d'\n  e=\"f\"/></a>", "\u{feff}<a>\r\n <b c='d'\n  e=\"f\"/></a>"]
        {
            let (sources, root) = parse(text).unwrap();
            let b = &root.children[0];
            assert_eq!(sources.text(b.name), "b");
            assert_eq!(sources.text(b.attributes[0].value), "d");
            let f = b.attributes[1].value;
            assert_eq!(sources.text(f), "f");
            assert_eq!((sources.location(f).line, sources.location(f).column), (3, 6));
        }
    }

    #[test]
    fn what_is_not_well_formed_is_refused_where_it_stands() {
        for (text, place, says) in [
            ("", "1:1", "empty"),
            (" <!-- a --> ", "1:1", "empty"),
            ("<a/><b/>", "1:6", "second root"),
            ("<a>\n<b>", "2:2", "not closed"),
            ("<a>\n<b></a>", "2:4", "closes <b>"),
            ("<a/></a>", "1:5", "closes nothing"),
            ("<a>\n <!-- x -- y --></a>", "2:2", "\"--\""),
            ("<a><!-- x </a>", "1:4", "comment"),
            ("<a>\n hello\n</a>", "2:2", "text outside"),
            ("hello <a/>", "1:1", "text outside"),
            ("<a><![CDATA[x]]></a>", "1:4", "text outside"),
            ("<a>&lt;</a>", "1:4", "text outside"),
            ("<a>\n&</a>", "2:1", "text outside"),
            ("<a b></a>", "1:5", "without \"=\""),
            ("<a b=></a>", "1:", "without a value"),
            ("<a b=c></a>", "1:6", "without quotes"),
            ("<a b=\"1\" b=\"2\"/>", "1:10", "twice"),
            ("<a b=\"c/>\n<d/></a>", "1:1", "not closed"),
            ("<a b=\"c/>\n<d e=\"f\"/></a>", "1:1", "quote is missing"),
            ("<a b='c'\n<d/></a>", "2:1", "inside a tag"),
            ("<a", "1:1", "not closed"),
            ("< a/>", "1:2", "without a name"),
            ("<!DOCTYPE a [<!ENTITY l \"lol\">]><a>&l;</a>", "1:1", "document type"),
            ("<a/><?xml version=\"1.0\"?>", "1:5", "declaration"),
            ("<?xml version=\"1.0\" encoding=\"latin1\"?><a/>", "1:1", "encoding"),
        ] {
            let message = message(text);
            assert!(message.contains(&format!("a.xml:{place}")), "{text:?}: {message}");
            assert!(message.contains(says), "{text:?}: {message}");
        }
    }

    #[test]
    fn nesting_and_number_of_elements_are_limited() {
        let deep = |n: usize| format!("{}{}", "<a>".repeat(n), "</a>".repeat(n));
        assert!(parse(&deep(MAX_DEPTH)).is_ok());
        assert!(message(&deep(MAX_DEPTH + 1)).contains("nested"));
        assert!(message(&deep(1_000_000)).contains("nested"));
        let many = format!("<a>{}</a>", "<b/>".repeat(MAX_ELEMENTS));
        assert!(message(&many).contains("elements"));
    }
}
