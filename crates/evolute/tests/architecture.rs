//! Rooms call only downstairs: the table of ARCHITECTURE.md against the sources.
//!
//! Comments and literals are taken out; every path that starts at the crate's root, by `crate` or by
//! enough `super`s, must lead to a room that the row allows. Links in comments may point anywhere.
#![allow(clippy::unwrap_used, missing_docs)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn page() -> String {
    fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap()
}

/// What stands in backticks.
fn quoted(text: &str) -> Vec<String> {
    text.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Rooms and what each may call, in the order of the page.
fn table() -> Vec<(String, Vec<String>)> {
    let rows: Vec<_> = page()
        .lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| {
            let cells: Vec<_> = line.trim_matches('|').split('|').collect();
            (quoted(cells[0])[0].clone(), quoted(cells[2]))
        })
        .collect();
    assert!(rows.len() > 5, "no table of rooms in ARCHITECTURE.md");
    rows
}

/// Identifiers and punctuation; comments, strings and characters are left out, lifetimes are marks.
fn tokens(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    let (mut list, mut i) = (Vec::new(), 0);
    while i < chars.len() {
        let c = at(i);
        if c == '/' && at(i + 1) == '/' {
            while i < chars.len() && at(i) != '\n' {
                i += 1;
            }
        } else if c == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 || i >= chars.len() {
                    break;
                }
            }
        } else if is_name(c) {
            let start = i;
            while is_name(at(i)) {
                i += 1;
            }
            let name: String = chars[start..i].iter().collect();
            let raw = ["r", "br"].contains(&name.as_str());
            let hashes = (i..).take_while(|k| at(*k) == '#').count();
            if raw && at(i + hashes) == '"' {
                let end: String = std::iter::once('"').chain("#".repeat(hashes).chars()).collect();
                i += hashes + 1;
                while i < chars.len()
                    && !chars[i..].iter().take(hashes + 1).copied().eq(end.chars())
                {
                    i += 1;
                }
                i += hashes + 1;
            } else {
                list.push(name);
            }
        } else if c == '"' {
            i += 1;
            while i < chars.len() && at(i) != '"' {
                i += if at(i) == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if c == '\'' && (at(i + 1) == '\\' || at(i + 2) == '\'') {
            i += if at(i + 1) == '\\' { 3 } else { 2 };
            while i < chars.len() && at(i) != '\'' {
                i += 1;
            }
            i += 1;
        } else if c == ':' && at(i + 1) == ':' {
            list.push("::".into());
            i += 2;
        } else {
            if !c.is_whitespace() {
                list.push(c.into());
            }
            i += 1;
        }
    }
    list
}

/// The names that follow the crate's root in a file whose module lies `depth` below it.
fn rooms_called(source: &str, depth: usize) -> BTreeSet<String> {
    let tokens = tokens(source);
    let token = |i: usize| tokens.get(i).map_or("", String::as_str);
    let mut called = BTreeSet::new();
    // Depth of the module that each open brace belongs to.
    let mut modules = vec![depth];
    let mut i = 0;
    while i < tokens.len() {
        let here = *modules.last().unwrap();
        match token(i) {
            "{" => {
                let inside = token(i.wrapping_sub(2)) == "mod";
                modules.push(here + usize::from(inside));
            }
            "}" if modules.len() > 1 => {
                modules.pop();
            }
            start @ ("crate" | "super")
                if token(i.wrapping_sub(1)) != "::" && !restricts(&tokens, i) =>
            {
                let mut climbed = if start == "crate" { here } else { 1 };
                while token(i + 1) == "::" && token(i + 2) == "super" {
                    climbed += 1;
                    i += 2;
                }
                if climbed >= here {
                    names_after(&tokens, i + 1, &mut called);
                }
            }
            _ => {}
        }
        i += 1;
    }
    called
}

/// Whether the token is the `crate` of `pub(crate)`.
fn restricts(tokens: &[String], i: usize) -> bool {
    i >= 2 && tokens[i - 1] == "(" && tokens[i - 2] == "pub"
}

/// The first names of `::name` or `::{name::…, name}` at `i`; a root that is used in another way (`use
/// crate as`) counts as a call of everything.
fn names_after(tokens: &[String], i: usize, called: &mut BTreeSet<String>) {
    let token = |i: usize| tokens.get(i).map_or("", String::as_str);
    if token(i) != "::" {
        called.insert("the whole crate".into());
        return;
    }
    if token(i + 1) != "{" {
        called.insert(token(i + 1).into());
        return;
    }
    let (mut depth, mut k) = (0, i + 1);
    loop {
        match token(k) {
            "{" => depth += 1,
            "}" => depth -= 1,
            name if depth == 1 && ["{", ","].contains(&token(k - 1)) => {
                called.insert(name.into());
            }
            _ => {}
        }
        k += 1;
        if depth == 0 || k >= tokens.len() {
            return;
        }
    }
}

fn sources(folder: &Path, depth: usize, list: &mut Vec<(PathBuf, usize)>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, depth + 1, list);
        } else if path.extension().is_some_and(|e| e == "rs") {
            let own = !path.ends_with("mod.rs");
            list.push((path, depth + usize::from(own)));
        }
    }
}

#[test]
fn rooms_call_only_downstairs() {
    let table = table();
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut wrong = Vec::new();
    for (room, allowed) in &table {
        let mut files = Vec::new();
        sources(&library.join(room), 1, &mut files);
        assert!(!files.is_empty(), "{room} has no files");
        for (file, depth) in files {
            for called in rooms_called(&fs::read_to_string(&file).unwrap(), depth) {
                if called != *room && !allowed.contains(&called) {
                    wrong.push(format!("{} calls {called}", file.display()));
                }
            }
        }
    }
    wrong.sort();
    assert!(wrong.is_empty(), "not in the table of ARCHITECTURE.md:\n{}", wrong.join("\n"));
}

#[test]
fn the_table_goes_down_and_is_complete() {
    let table = table();
    for (k, (room, allowed)) in table.iter().enumerate() {
        for name in allowed {
            let above = table[..k].iter().any(|(r, _)| r == name);
            assert!(above, "{room} may not call {name}, which does not come before it");
        }
    }
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(library).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let known = name == "lib" || table.iter().any(|(room, _)| *room == name);
        assert!(known, "ARCHITECTURE.md has no row for {name}");
    }
}

/// Nothing is allowed that nobody uses.
#[test]
fn every_entry_of_the_table_is_used() {
    let library = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for (room, allowed) in table() {
        let mut files = Vec::new();
        sources(&library.join(&room), 1, &mut files);
        let called: BTreeSet<_> = files
            .iter()
            .flat_map(|(f, depth)| rooms_called(&fs::read_to_string(f).unwrap(), *depth))
            .collect();
        for name in allowed {
            assert!(called.contains(&name), "{room} does not call {name}");
        }
    }
}

#[test]
fn files_that_the_page_names_are_there() {
    let folders = [root(), root().join("crates/evolute/src")];
    let paths = quoted(&page()).into_iter().filter(|q| q.contains('/') || q.ends_with(".rs"));
    for path in paths.filter(|p| p != "main.rs") {
        assert!(folders.iter().any(|f| f.join(&path).exists()), "{path} is not there");
    }
}

#[test]
fn calls_are_found_however_they_are_written() {
    let called = |source: &str| rooms_called(source, 2).into_iter().collect::<Vec<_>>();
    assert_eq!(called("use crate::trace::Tracer;"), ["trace"]);
    assert_eq!(
        called("use crate::{scene::{Scene, Shape}, trace, view::render as r};"),
        ["scene", "trace", "view"]
    );
    assert_eq!(called("fn f() { let x = crate :: transfer::lambert(); }"), ["transfer"]);
    assert_eq!(called("use super::super::view::Picture;"), ["view"]);
    assert_eq!(called("mod tests { use super::super::super::output; }"), ["output"]);
    assert_eq!(
        called("fn f<'a>(c: char) { if c == '\\'' || c == '\"' { crate::view::g() } }"),
        ["view"]
    );
    assert_eq!(called("use crate as all;"), ["the whole crate"]);
    assert!(called("mod tests { use super::super::jet; use super::*; }").is_empty());
    assert!(
        called("// crate::view\n/* crate::view /* */ crate::view */ \"crate::view\";").is_empty()
    );
    assert!(called("const S: &str = r#\"a \" crate::view\"#; pub(crate) fn f() {}").is_empty());
}
