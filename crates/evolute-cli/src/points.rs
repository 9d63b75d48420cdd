//! The table of receivers that `probe` reads.
//!
//! Comma-separated values (RFC 4180) in UTF-8 with a header line: the columns `x`, `y`, `z` [m],
//! `nx`, `ny`, `nz` in any order; every other column is carried through as text. Lines end in LF or
//! CRLF, a byte-order mark is skipped, empty lines are ignored.

use std::fmt::Display;

use evolute::geometry::{Point3, UnitVector3, Vector3};
use evolute::transfer::Receiver;

/// The columns that are read, in the order in which they are written again.
pub const COLUMNS: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];

const NAME_COLUMNS: &str =
    "the first line names the columns x,y,z,nx,ny,nz in any order; others are carried through";

/// A table of receivers.
#[derive(Debug, Default)]
pub struct Points {
    /// Where and which way; normals of length one.
    pub receivers: Vec<Receiver>,
    /// The names of all columns, in the table's order.
    pub columns: Vec<String>,
    /// The fields as they were, row by row.
    pub rows: Vec<Vec<String>>,
}

/// A place in the text: line and column of its first character, counted from 1 in characters, and
/// how many characters of that line are meant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    line: usize,
    column: usize,
    width: usize,
}

#[derive(Debug)]
struct Field {
    text: String,
    place: Place,
}

/// What is wrong, where, and what would be right.
#[derive(Debug)]
struct Fault {
    place: Place,
    message: String,
    remedy: String,
}

impl Points {
    /// Reads a table; `name` is the file's name for messages.
    ///
    /// # Errors
    /// One message with file, line and column, the offending line and what would be right.
    pub fn read(bytes: &[u8], name: &str) -> Result<Self, String> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.strip_prefix('\u{feff}').unwrap_or(text),
            Err(e) => {
                let text = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
                let line = 1 + text.matches('\n').count();
                let column = 1 + text.chars().rev().take_while(|c| *c != '\n').count();
                let place = Place { line, column, width: 1 };
                let fault = fault(place, "this is not UTF-8 text", "save the table in UTF-8");
                return Err(fault.render(&text, name));
            }
        };
        parse(text).map_err(|fault| fault.render(text, name))
    }
}

impl Fault {
    fn render(&self, text: &str, name: &str) -> String {
        let Place { line, column, width } = self.place;
        let source = text.split('\n').nth(line - 1).unwrap_or("").trim_end_matches('\r');
        // A long line is shown around the place only.
        const SHOWN: usize = 100;
        let skip = (column - 1).saturating_sub(SHOWN / 2);
        let shown: String = source.chars().skip(skip).take(SHOWN).collect();
        let shown = shown.replace('\t', " ");
        let marks = "^".repeat(width.clamp(1, SHOWN / 2));
        let gutter = " ".repeat(line.to_string().len());
        let indent = " ".repeat(column - 1 - skip);
        format!(
            "error: {}\n{gutter} ┌─ {name}:{line}:{column}\n{gutter} │\n{line} │ {shown}\n{gutter} │ \
             {indent}{marks} {}",
            self.message, self.remedy
        )
    }
}

fn fault(place: Place, message: impl Display, remedy: impl Display) -> Fault {
    Fault { place, message: message.to_string(), remedy: remedy.to_string() }
}

fn parse(text: &str) -> Result<Points, Fault> {
    let mut records = split(text)?.into_iter();
    let Some(header) = records.next() else {
        let place = Place { line: 1, column: 1, width: 1 };
        return Err(fault(place, "the table is empty", NAME_COLUMNS));
    };
    let places = find_columns(&header)?;
    let mut points = Points::default();
    for record in records {
        if record.len() > header.len() {
            let message =
                format!("this row has {} fields, the header {}", record.len(), header.len());
            let remedy = "remove what is too much, or quote a field that holds a comma";
            return Err(fault(record[header.len()].place, message, remedy));
        }
        if let (true, Some(last)) = (record.len() < header.len(), record.last()) {
            let message =
                format!("this row has {} fields, the header {}", record.len(), header.len());
            let remedy = "a field for every column must follow; carried columns may be empty";
            return Err(fault(last.place, message, remedy));
        }
        points.receivers.push(receiver(&record, &places)?);
        points.rows.push(record.into_iter().map(|f| f.text).collect());
    }
    points.columns = header.into_iter().map(|f| f.text.trim().to_owned()).collect();
    Ok(points)
}

/// Where the six columns stand.
fn find_columns(header: &[Field]) -> Result<[usize; 6], Fault> {
    if header.iter().all(|f| f.text.trim().parse::<f64>().is_ok()) {
        let message = "the first line holds numbers, where the columns' names should be";
        return Err(fault(header[0].place, message, NAME_COLUMNS));
    }
    for (i, field) in header.iter().enumerate() {
        let name = field.text.trim();
        if header[..i].iter().any(|f| f.text.trim() == name) {
            let message = format!("two columns are called '{name}'");
            return Err(fault(field.place, message, "rename or remove one of them"));
        }
    }
    if let [only] = header
        && let Some(mark) = only.text.chars().find(|c| matches!(c, ';' | '\t'))
    {
        let mark = if mark == '\t' { "tabs".into() } else { format!("'{mark}'") };
        let message = format!("the columns are separated by {mark}");
        return Err(fault(only.place, message, "separate them by commas: x,y,z,nx,ny,nz"));
    }
    let mut places = [0; 6];
    for (place, name) in places.iter_mut().zip(COLUMNS) {
        match header.iter().position(|f| f.text.trim() == name) {
            Some(at) => *place = at,
            None => return Err(missing(header, name)),
        }
    }
    Ok(places)
}

/// What is wrong with a header that does not name a column.
fn missing(header: &[Field], name: &str) -> Fault {
    let like = |f: &&Field| f.text.trim().trim_matches('"').to_lowercase() == name;
    if let Some(field) = header.iter().find(like) {
        let message = format!("the column '{name}' is called '{}'", field.text.trim());
        return fault(field.place, message, "names are written in small letters");
    }
    fault(header[0].place, format!("the table has no column '{name}'"), NAME_COLUMNS)
}

/// The receiver of a row.
fn receiver(record: &[Field], places: &[usize; 6]) -> Result<Receiver, Fault> {
    let mut values = [0.0; 6];
    for ((value, at), name) in values.iter_mut().zip(places).zip(COLUMNS) {
        let Field { text, place } = &record[*at];
        *value = match text.trim().parse::<f64>() {
            Ok(x) if x.is_finite() => x,
            Ok(_) => {
                let message = format!("column {name} is '{}', which is no finite number", text);
                return Err(fault(*place, message, "write a finite number, or leave the row out"));
            }
            Err(_) => {
                let message = format!("'{text}' in column {name} is not a number");
                return Err(fault(*place, message, "write a number like 1.5 or 2e-3"));
            }
        };
    }
    let normal = Vector3::new(values[3], values[4], values[5]);
    // Scaled first, so that neither 1e200 nor 1e-200 is lost to overflow of its square.
    let normal = UnitVector3::try_new(normal / normal.amax(), 0.0);
    let Some(normal) = normal.filter(|n| n.iter().all(|x| x.is_finite())) else {
        let remedy = "give the direction that the receiver faces; its length does not matter";
        return Err(fault(record[places[3]].place, "the normal nx,ny,nz is zero", remedy));
    };
    Ok(Receiver { position: Point3::new(values[0], values[1], values[2]), normal })
}

/// The text as records of fields; empty lines are left out.
fn split(text: &str) -> Result<Vec<Vec<Field>>, Fault> {
    let mut reader = Reader { rest: text.chars(), line: 1, column: 1 };
    let mut records = Vec::new();
    let mut record: Vec<Field> = Vec::new();
    loop {
        let start = Place { line: reader.line, column: reader.column, width: 1 };
        let quoted = reader.peek() == Some('"');
        let text = if quoted { reader.quoted(start)? } else { reader.plain() };
        let one_line = reader.line == start.line;
        let width = if one_line { (reader.column - start.column).max(1) } else { 1 };
        let blank = !quoted && text.is_empty();
        let field = Field { text, place: Place { width, ..start } };
        match reader.next() {
            Some(',') => record.push(field),
            end => {
                if !(record.is_empty() && blank) {
                    record.push(field);
                    records.push(std::mem::take(&mut record));
                }
                if end.is_none() {
                    return Ok(records);
                }
            }
        }
    }
}

/// Characters with their place; CRLF counts as LF.
struct Reader<'a> {
    rest: std::str::Chars<'a>,
    line: usize,
    column: usize,
}

impl Reader<'_> {
    fn peek(&self) -> Option<char> {
        let mut rest = self.rest.clone();
        match rest.next() {
            Some('\r') if rest.next() == Some('\n') => Some('\n'),
            other => other,
        }
    }

    fn next(&mut self) -> Option<char> {
        let c = self.peek()?;
        let raw = self.rest.next();
        if c == '\n' {
            if raw == Some('\r') {
                self.rest.next();
            }
            (self.line, self.column) = (self.line + 1, 1);
        } else {
            self.column += 1;
        }
        Some(c)
    }

    /// A field without quotes, up to the comma or the line's end.
    fn plain(&mut self) -> String {
        let mut text = String::new();
        while let Some(c) = self.peek().filter(|c| !matches!(c, ',' | '\n')) {
            text.push(c);
            self.next();
        }
        text
    }

    /// A field in quotes, both included.
    fn quoted(&mut self, start: Place) -> Result<String, Fault> {
        const REMEDY: &str = "a quote inside quotes is written twice";
        let mut text = String::new();
        self.next();
        loop {
            match self.next() {
                None => return Err(fault(start, "this quote is never closed", REMEDY)),
                Some('"') if self.peek() == Some('"') => {
                    self.next();
                    text.push('"');
                }
                Some('"') => break,
                Some(c) => text.push(c),
            }
        }
        match self.peek() {
            None | Some(',' | '\n') => Ok(text),
            Some(c) => {
                let place = Place { line: self.line, column: self.column, width: 1 };
                Err(fault(place, format!("'{c}' follows a closed quote"), REMEDY))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn refusal(text: &str) -> String {
        Points::read(text.as_bytes(), "t.csv").unwrap_err()
    }

    #[test]
    fn any_order_extra_columns_quotes_and_line_ends() {
        let text = "\u{feff}nz, ny,nx,z,\"room, floor\",y,x\r\n2,0,0,3,\"the \"\"big\"\"\r\none\",2,\
                    1\r\n\r\n-5,0,0,3e-1,,.5,1.";
        let points = Points::read(text.as_bytes(), "t.csv").unwrap();
        assert_eq!(points.columns, ["nz", "ny", "nx", "z", "room, floor", "y", "x"]);
        assert_eq!(points.rows[0][4], "the \"big\"\none");
        assert_eq!(points.rows[1], ["-5", "0", "0", "3e-1", "", ".5", "1."]);
        assert_eq!(points.receivers[0].position, Point3::new(1.0, 2.0, 3.0));
        assert_eq!(points.receivers[0].normal, Vector3::z_axis());
        assert_eq!(points.receivers[1].normal, -Vector3::z_axis());
        assert_eq!(points.receivers.len(), 2);
    }

    #[test]
    fn normals_of_any_length() {
        for length in ["1e-300", "1e300", "1"] {
            let text = format!("x,y,z,nx,ny,nz\n0,0,0,0,-{length},0\n");
            let points = Points::read(text.as_bytes(), "t.csv").unwrap();
            assert_eq!(points.receivers[0].normal, -Vector3::y_axis());
        }
    }

    #[test]
    fn a_header_alone_is_an_empty_table() {
        assert!(Points::read(b"x,y,z,nx,ny,nz", "t.csv").unwrap().receivers.is_empty());
    }

    #[test]
    fn messages_name_the_place_and_the_remedy() {
        for (text, place, words) in [
            ("", "t.csv:1:1", "empty"),
            ("\n\n", "t.csv:1:1", "empty"),
            ("x,y,z,nx,ny\n", "t.csv:1:1", "no column 'nz'"),
            ("0,0,1,0,0,1\n", "t.csv:1:1", "the first line holds numbers"),
            ("x,y,Z,nx,ny,nz\n", "t.csv:1:5", "'z' is called 'Z'"),
            ("x;y;z;nx;ny;nz\n", "t.csv:1:1", "separated by ';'"),
            ("x\ty\tz\n", "t.csv:1:1", "separated by tabs"),
            ("x,y,z,nx,ny,nz,x\n", "t.csv:1:16", "two columns are called 'x'"),
            ("x,y,z,nx,ny,nz\n1,2,abc,0,0,1\n", "t.csv:2:5", "'abc' in column z is not a number"),
            ("x,y,z,nx,ny,nz\r\n\r\n1,2,3,0,0,nan\n", "t.csv:3:11", "column nz is 'nan'"),
            ("x,y,z,nx,ny,nz\n1,2,3,0,1e999,0\n", "t.csv:2:9", "column ny is '1e999'"),
            ("x,y,z,nx,ny,nz\n1,2,3,0,0,0\n", "t.csv:2:7", "normal nx,ny,nz is zero"),
            ("x,y,z,nx,ny,nz\n1,2,3,0,0\n", "t.csv:2:9", "5 fields, the header 6"),
            ("x,y,z,nx,ny,nz\n1,2,3,0,0,1,9\n", "t.csv:2:13", "7 fields, the header 6"),
            ("x,y,z,nx,ny,nz,t\n1,2,3,0,0,1,\"a\n", "t.csv:2:13", "never closed"),
            ("x,y,z,nx,ny,nz,t\n1,2,3,0,0,1,\"a\"b\n", "t.csv:2:16", "'b' follows"),
            ("x,y,z,nx,ny,nz,ä\n1,2,3,0,0,1,ö,?\n", "t.csv:2:15", "8 fields, the header 7"),
        ] {
            let message = refusal(text);
            assert!(message.contains(place) && message.contains(words), "{text:?}:\n{message}");
        }
        let message = Points::read(b"x,y\n\xff,", "t.csv").unwrap_err();
        assert!(message.contains("t.csv:2:1") && message.contains("UTF-8"), "{message}");
    }

    #[test]
    fn the_offending_line_is_shown() {
        let message = refusal("x,y,z,nx,ny,nz\n1,2,abc,0,0,1\n");
        let lines: Vec<_> = message.lines().collect();
        assert_eq!(lines[3], "2 │ 1,2,abc,0,0,1");
        assert_eq!(lines[4], "  │     ^^^ write a number like 1.5 or 2e-3");
        // Very long lines are cut.
        let long = format!("x,y,z,nx,ny,nz,t\n1,2,3,0,0,1,{},\n", "q".repeat(1_000_000));
        assert!(refusal(&long).len() < 1000);
    }
}
