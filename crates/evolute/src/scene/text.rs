//! Attribute values: `$name` replaced, character references resolved, every byte's origin kept.

use std::collections::BTreeMap;
use std::ops::Range;

use super::message::{Checked, Complaint, listed, nearest, quoted};

use super::source::{Sources, Span};

/// Longest value after substitution [bytes]: longer than any formula or list of a scene, and a stop
/// for defaults that double each other.
const MAX_VALUE_BYTES: usize = 1 << 16;

/// All values of a scene together after substitution [bytes].
const MAX_TOTAL_BYTES: usize = 64 << 20;

/// An attribute value as it is meant, with the place of each of its bytes in the file.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) value: String,
    /// The whole value in the file.
    pub(super) span: Span,
    /// Where runs of the value come from, in order; empty if the file has the very same bytes.
    runs: Vec<Run>,
}

/// A run of the value that was copied, or that stands for a reference or a parameter.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// First byte in the value.
    at: usize,
    /// Its origin.
    span: Span,
    /// Whether bytes correspond one to one.
    copied: bool,
}

impl Text {
    /// A value that stands in no attribute, with the place that stands for it.
    pub(super) fn constant(value: &str, span: Span) -> Self {
        Self { value: value.to_string(), span, runs: Vec::new() }
    }

    /// The place of a range of bytes of the value.
    pub(super) fn locate(&self, range: Range<usize>) -> Span {
        if self.runs.is_empty() {
            return self.span.part(range.start, range.end);
        }
        let start = self.place(range.start).start;
        let end = match range.end.checked_sub(1) {
            Some(last) if last >= range.start => {
                let run = self.place(last);
                if run.start == run.end { run.end + 1 } else { run.end }
            }
            _ => start,
        };
        Span { start, end: end.clamp(start, self.span.end), ..self.span }
    }

    /// The place of one byte: a byte of a copied run, or the whole reference or parameter.
    fn place(&self, at: usize) -> Span {
        let Some(run) = self.runs.iter().rev().find(|r| r.at <= at) else { return self.span };
        if run.copied { run.span.part(at - run.at, at - run.at + 1) } else { run.span }
    }
}

/// Parameters of a scene: `-D name=value` and `<default>`.
#[derive(Debug, Default)]
pub(super) struct Parameters {
    values: BTreeMap<String, Parameter>,
    longest: usize,
    total: usize,
}

#[derive(Debug)]
struct Parameter {
    value: String,
    given: bool,
    used: bool,
}

impl Parameters {
    /// Parameters given from outside; they go before every `<default>`.
    ///
    /// # Errors
    /// A name that is not letters, digits and underscores, or that is given twice.
    pub(super) fn given(list: &[(String, String)]) -> Checked<Self> {
        let mut parameters = Self::default();
        for (name, value) in list {
            if !is_name(name) {
                return Err(Complaint::nowhere(format!(
                    "the parameter name {} is not made of letters, digits and underscores",
                    quoted(name)
                )));
            }
            parameters.longest = parameters.longest.max(name.len());
            let parameter = Parameter { value: value.clone(), given: true, used: false };
            if parameters.values.insert(name.clone(), parameter).is_some() {
                return Err(Complaint::nowhere(format!(
                    "the parameter {} is given twice",
                    quoted(name)
                )));
            }
        }
        Ok(parameters)
    }

    /// A `<default>`: acts from here on, unless the name has a value already, as in Mitsuba 3.
    ///
    /// # Errors
    /// A name that is not letters, digits and underscores.
    pub(super) fn set_default(&mut self, name: &Text, value: &Text) -> Checked<()> {
        if !is_name(&name.value) {
            return Err(Complaint::at(
                name.span,
                format!("{} cannot be the name of a parameter", quoted(&name.value)),
            )
            .help("use letters, digits and underscores, at most 64 of them"));
        }
        self.longest = self.longest.max(name.value.len());
        self.values.entry(name.value.clone()).or_insert_with(|| Parameter {
            value: value.value.clone(),
            given: false,
            used: false,
        });
        Ok(())
    }

    /// The names given from outside that nothing has used.
    ///
    /// # Errors
    /// The first of them, with the nearest parameter of the scene.
    pub(super) fn all_used(&self) -> Checked<()> {
        let Some((name, _)) = self.values.iter().find(|(_, p)| p.given && !p.used) else {
            return Ok(());
        };
        let others =
            || self.values.iter().filter(|(_, p)| !p.given || p.used).map(|(n, _)| n.as_str());
        let complaint =
            Complaint::nowhere(format!("the scene does not use the parameter {}", quoted(name)))
                .maybe_meant(nearest(name, others()));
        Err(match others().next() {
            Some(_) => {
                complaint.help(format!("its parameters are {}", listed(others().take(20), "and")))
            }
            None => complaint.help("it has no parameters"),
        })
    }

    /// The value of an attribute as it is meant.
    ///
    /// # Errors
    /// An unknown parameter or character reference, a value that grows too long.
    pub(super) fn expand(&mut self, sources: &Sources, span: Span) -> Checked<Text> {
        let raw = sources.text(span);
        if !raw.contains(['$', '&', '\t', '\r', '\n']) {
            self.count(raw.len(), span)?;
            return Ok(Text { value: raw.to_string(), span, runs: Vec::new() });
        }
        let mut value = String::new();
        let mut runs = Vec::new();
        let mut at = 0;
        while let Some(c) = raw[at..].chars().next() {
            let rest = &raw[at..];
            let taken = match c {
                '&' => {
                    let taken = rest.find(';').map_or(rest.len(), |i| i + 1);
                    let origin = span.part(at, at + taken);
                    runs.push(Run { at: value.len(), span: origin, copied: false });
                    value.push(
                        character(&rest[..taken]).ok_or_else(|| unknown_reference(rest, origin))?,
                    );
                    taken
                }
                '$' => {
                    let taken = 1 + self
                        .match_name(&rest[1..])
                        .ok_or_else(|| self.undefined(rest, span, at))?;
                    runs.push(Run {
                        at: value.len(),
                        span: span.part(at, at + taken),
                        copied: false,
                    });
                    if let Some(parameter) = self.values.get_mut(&rest[1..taken]) {
                        parameter.used = true;
                        value.push_str(&parameter.value);
                    }
                    taken
                }
                // White space in attributes is blanks, as XML says.
                '\t' | '\r' | '\n' => {
                    runs.push(Run { at: value.len(), span: span.part(at, at + 1), copied: true });
                    value.push(' ');
                    1
                }
                _ => {
                    let taken = rest.find(['$', '&', '\t', '\r', '\n']).unwrap_or(rest.len());
                    runs.push(Run {
                        at: value.len(),
                        span: span.part(at, at + taken),
                        copied: true,
                    });
                    value.push_str(&rest[..taken]);
                    taken
                }
            };
            at += taken;
            if value.len() > MAX_VALUE_BYTES {
                return Err(Complaint::at(
                    span,
                    "this value is too long once its parameters are replaced",
                )
                .help(format!("at most {MAX_VALUE_BYTES} bytes")));
            }
        }
        self.count(value.len(), span)?;
        Ok(Text { value, span, runs })
    }

    fn count(&mut self, bytes: usize, span: Span) -> Checked<()> {
        self.total += bytes;
        if self.total > MAX_TOTAL_BYTES {
            return Err(Complaint::at(
                span,
                "the scene is too large once its parameters are replaced",
            ));
        }
        Ok(())
    }

    /// Length of the longest known name at the start of `text`.
    fn match_name(&self, text: &str) -> Option<usize> {
        (1..=self.longest.min(text.len()))
            .rev()
            .find(|n| text.is_char_boundary(*n) && self.values.contains_key(&text[..*n]))
    }

    fn undefined(&self, rest: &str, span: Span, at: usize) -> Complaint {
        let length = rest[1..].find(|c: char| !is_name_character(c)).unwrap_or(rest.len() - 1);
        let name = &rest[1..1 + length];
        let place = span.part(at, at + 1 + length);
        if name.is_empty() {
            return Complaint::at(place, "a \"$\" without the name of a parameter");
        }
        Complaint::at(place, format!("the parameter {} has no value", quoted(&format!("${name}"))))
            .maybe_meant(nearest(name, self.values.keys().map(String::as_str)))
            .help(format!(
                "give it one before this line, <default name=\"{name}\" value=\"…\"/>, or with -D {name}=…"
            ))
    }
}

fn is_name_character(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// 64 letters are more than any name needs and bound the search for the longest match.
fn is_name(name: &str) -> bool {
    (1..=64).contains(&name.len()) && name.chars().all(is_name_character)
}

/// What a reference such as `&lt;` or `&#65;` stands for.
fn character(reference: &str) -> Option<char> {
    let name = reference.strip_prefix('&')?.strip_suffix(';')?;
    match name {
        "amp" => Some('&'),
        "lt" => Some('<'),
        "gt" => Some('>'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let number = name.strip_prefix('#')?;
            let code = match number.strip_prefix('x') {
                Some(hex) => u32::from_str_radix(hex, 16),
                None => number.parse(),
            };
            char::from_u32(code.ok()?).filter(|c| *c != '\0')
        }
    }
}

fn unknown_reference(rest: &str, origin: Span) -> Complaint {
    // Without a ";" the reference would be everything up to the end.
    let shown = rest.find(';').map_or(1, |i| i + 1);
    Complaint::at(
        origin.part(0, shown),
        format!("{} is no character reference", quoted(&rest[..shown])),
    )
    .help("an \"&\" is written &amp;; known are &amp; &lt; &gt; &quot; &apos; and numbers such as &#65;")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn expand(raw: &str, parameters: &[(&str, &str)]) -> (Sources, Checked<Text>, Parameters) {
        let mut sources = Sources::default();
        let file = sources.add("a".into(), raw.into(), Default::default());
        let list: Vec<(String, String)> =
            parameters.iter().map(|(n, v)| (n.to_string(), v.to_string())).collect();
        let mut parameters = Parameters::given(&list).unwrap();
        let span = Span { file, start: 0, end: raw.len() as u32 };
        let text = parameters.expand(&sources, span);
        (sources, text, parameters)
    }

    #[test]
    fn the_longest_name_is_replaced_and_values_are_taken_as_they_are() {
        let (_, text, parameters) = expand("$rr$r-$rx", &[("r", "1"), ("rr", "2"), ("q", "3")]);
        assert_eq!(text.unwrap().value, "21-1x");
        assert!(parameters.all_used().is_err(), "q is unused");
        assert_eq!(expand("$a", &[("a", "$b"), ("b", "4")]).1.unwrap().value, "$b");
    }

    #[test]
    fn every_byte_keeps_its_place() {
        let (sources, text, _) = expand("x&lt;y+$speed*z\n+w", &[("speed", "(1+2)")]);
        let text = text.unwrap();
        assert_eq!(text.value, "x<y+(1+2)*z +w");
        let place = |range: Range<usize>| sources.text(text.locate(range)).to_string();
        assert_eq!(place(0..1), "x");
        assert_eq!(place(1..2), "&lt;");
        assert_eq!(place(2..3), "y");
        assert_eq!(place(5..6), "$speed", "inside the parameter");
        assert_eq!(place(9..11), "*z");
        assert_eq!(place(2..11), "y+$speed*z");
        assert_eq!(place(13..14), "w");
        assert_eq!(place(14..14), "", "the end");
        let plain = expand("a+b", &[]).1.unwrap();
        assert_eq!(plain.locate(2..3), Span { file: 0, start: 2, end: 3 });
    }

    #[test]
    fn unknown_names_and_references_are_refused_with_the_nearest() {
        let message = |raw: &str, parameters: &[(&str, &str)]| {
            let (sources, text, _) = expand(raw, parameters);
            text.expect_err(raw).render(&sources).to_string()
        };
        let text = message("1+$raduis", &[("radius", "1")]);
        assert!(text.contains("a:1:3") && text.contains("\"radius\""), "{text}");
        assert!(message("a$", &[]).contains("without the name"));
        assert!(message("&nbsp;", &[]).contains("character reference"));
        assert!(message("&#0;", &[]).contains("character reference"));
        assert!(message("a & b", &[]).contains("&amp;"));
    }

    #[test]
    fn doubling_defaults_are_stopped() {
        let mut sources = Sources::default();
        let mut parameters = Parameters::default();
        let mut add = |text: &str| {
            let file = sources.add("a".into(), text.into(), Default::default());
            (Span { file, start: 0, end: text.len() as u32 }, sources.clone())
        };
        let mut refused = false;
        for i in 0..60 {
            let (name, _) = add(&format!("p{i}"));
            let previous = if i == 0 { "xx".into() } else { format!("$p{0}$p{0}", i - 1) };
            let (value, all) = add(&previous);
            let name = parameters.expand(&all, name).unwrap();
            match parameters.expand(&all, value) {
                Ok(value) => parameters.set_default(&name, &value).unwrap(),
                Err(_) => {
                    refused = true;
                    break;
                }
            }
        }
        assert!(refused);
    }
}
