//! Every scene of `cases/bad` is refused with the right message at the right place, soon, and without
//! eating memory; `cases/bad/README.md` describes the table.
#![allow(clippy::unwrap_used, missing_docs)]

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use evolute::scene::load_file;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/bad")
}

/// Rows of the table: file, place, what the message says, what it advises.
fn table() -> Vec<[String; 4]> {
    let text = std::fs::read_to_string(folder().join("expected.tsv")).unwrap();
    let rows = text.lines().skip(1).map(|line| {
        let cells: Vec<String> = line.split('\t').map(str::to_string).collect();
        cells.try_into().unwrap_or_else(|_| panic!("a row without four cells: {line}"))
    });
    rows.collect()
}

/// The most memory this process has had so far [bytes], where the system tells.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kilobytes| kilobytes * 1024)
}

#[test]
fn every_bad_scene_is_refused_as_the_table_says() {
    let mut wrong = Vec::new();
    for [file, place, says, advice] in table() {
        let start = Instant::now();
        let message = match load_file(folder().join(&file), &[]) {
            Ok(_) => {
                wrong.push(format!("{file}: accepted"));
                continue;
            }
            Err(error) => error.to_string(),
        };
        // A slow machine takes milliseconds; a runaway takes for ever.
        assert!(start.elapsed() < Duration::from_secs(20), "{file} took {:?}", start.elapsed());
        // The place is the end of a word: "…/file.xml:3:18".
        let at_place = message.split_whitespace().any(|word| {
            word.strip_suffix(place.as_str()).is_some_and(|before| before.ends_with('/'))
        });
        assert!(!says.is_empty() && !advice.is_empty(), "{file}: the table says nothing");
        if !at_place || !message.contains(&says) || !message.contains(&advice) {
            wrong.push(format!("{file}: not {place}, \"{says}\", \"{advice}\" but\n{message}"));
        }
        assert!(message.len() < 4_000, "{file}: a message of {} bytes", message.len());
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    if let Some(peak) = peak_memory() {
        assert!(peak < 200 << 20, "{} MB", peak >> 20);
    }
}

#[test]
fn the_table_names_every_scene_of_the_folder() {
    let named: Vec<String> = table().into_iter().map(|[file, ..]| file).collect();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".xml") {
            assert!(named.contains(&name), "{name} is not in expected.tsv");
        }
    }
    assert!(named.len() >= 20);
}

#[test]
fn files_that_cannot_be_read_are_said_by_name() {
    for path in [folder().join("no such scene.xml"), folder()] {
        let message = load_file(&path, &[]).unwrap_err().to_string();
        assert!(message.contains("cannot read the scene"), "{message}");
    }
}

#[test]
fn unused_and_misspelt_parameters_are_refused() {
    let scene = folder().join("../wave/scene.xml");
    let given = |name: &str, value: &str| vec![(name.to_string(), value.to_string())];
    let message = load_file(&scene, &given("hafl", "3")).unwrap_err().to_string();
    assert!(message.contains("does not use the parameter \"hafl\""), "{message}");
    assert!(message.contains("did you mean \"half\"?"), "{message}");
    assert!(load_file(&scene, &given("half", "3")).is_ok());
    let message = load_file(&scene, &given("half", "x")).unwrap_err().to_string();
    assert!(message.contains("scene.xml:12:"), "{message}");
}
