//! The program from the outside: exit status, files, messages.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use common::{Folder, POINTS, SCENE, json, status, stderr, stdout};

#[test]
fn help_and_version() {
    let folder = Folder::new("help");
    let version = folder.run(&["--version"]);
    assert_eq!(status(&version), 0);
    assert!(stdout(&version).starts_with("evolute 0."));
    for verb in ["render", "solve", "probe", "check", "export"] {
        let help = folder.run(&[verb, "--help"]);
        assert_eq!(status(&help), 0);
        assert!(stdout(&help).contains("Example"), "{verb}");
    }
    let help = stdout(&folder.run(&["--help"]));
    for absent in ["bake", "compare", "report"] {
        assert!(!help.contains(absent), "{absent} is not delivered yet");
    }
}

#[test]
fn wrong_command_lines_end_with_2() {
    let folder = Folder::new("usage");
    folder.write("s.xml", SCENE);
    folder.write("p.csv", POINTS);
    for arguments in [
        &[][..],
        &["dance"],
        &["solve", "s.xml"],
        &["solve", "s.xml", "-o", "s.exr"],
        &["probe", "s.xml"],
        &["probe", "s.xml", "--points", "p.csv", "-a", "0"],
        &["probe", "s.xml", "--points", "p.csv", "-t", "0"],
        &["probe", "s.xml", "--points", "p.csv", "-D", "height"],
        &["probe", "s.xml", "--points", "p.csv", "-q", "-v"],
        &["probe", "s.xml", "--points", "p.csv", "-o", "light.txt"],
        &["probe", "s.xml", "--points", "p.csv", "--components", "glow"],
        &["render", "s.xml", "-o", "picture.jpg"],
        &["render", "s.xml", "--size", "640"],
        &["export", "s.xml"],
        &["export", "s.xml", "-o", "plain", "--triangles", "0"],
    ] {
        let output = folder.run(arguments);
        assert_eq!(status(&output), 2, "{arguments:?}");
        assert!(!stderr(&output).is_empty() && stdout(&output).is_empty(), "{arguments:?}");
    }
    let glow = folder.run(&["probe", "s.xml", "--points", "p.csv", "--components", "glow"]);
    assert!(stderr(&glow).contains("direct, specular, indirect and total"));
    assert_eq!(folder.names(), ["p.csv", "s.xml"]);
}

#[test]
fn probe_writes_the_table_it_read() {
    let folder = Folder::new("probe");
    folder.write("s.xml", SCENE);
    folder.write("p.csv", POINTS);
    let output = folder.run(&["probe", "s.xml", "--points", "p.csv", "-o", "light.csv"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert!(stdout(&output).is_empty());
    assert_eq!(folder.names(), ["light.csv", "p.csv", "s.xml"]);
    let text = fs::read_to_string(folder.0.join("light.csv")).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(
        lines[0],
        "x,y,z,nx,ny,nz,label,direct_r,direct_g,direct_b,specular_r,specular_g,specular_b,\
         indirect_r,indirect_g,indirect_b,total_r,total_g,total_b,error"
    );
    assert_eq!(lines.len(), 4);
    assert!(lines[2].starts_with("0.5,0.25,0,0,0,2,\"right, back\","));
    // Lambert's formula for a unit square 2 m above the middle:
    // E = 4 · L/2 · [a/√(1+a²) · atan(b/√(1+a²)) + …] with a = b = ½/2.
    let r = (1.0f64 + 0.0625).sqrt();
    let expected = 4.0 * 100.0 / 2.0 * 2.0 * (0.25 / r * (0.25 / r).atan());
    let direct: f64 = lines[1].split(',').nth(7).unwrap().parse().unwrap();
    assert!((direct / expected - 1.0).abs() < 1e-9, "{direct} {expected}");
    // Standard input, standard output and - give the same.
    let piped = folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS);
    assert_eq!(stdout(&piped), text);
    let one = folder.run(&["probe", "s.xml", "--points", "p.csv", "--components", "direct"]);
    assert!(stdout(&one).lines().next().unwrap().ends_with("direct_r,direct_g,direct_b,error"));
}

#[test]
fn photometric_multiplies_by_683() {
    let folder = Folder::new("photometric");
    folder.write("s.xml", SCENE);
    let field = |arguments: &[&str]| -> f64 {
        let output = folder.run_with(arguments, POINTS);
        stdout(&output).lines().nth(1).unwrap().split(',').nth(7).unwrap().parse().unwrap()
    };
    let watts = field(&["probe", "s.xml", "--points", "-"]);
    let lux = field(&["probe", "s.xml", "--points", "-", "--photometric"]);
    assert_eq!(lux, watts * 683.0);
}

#[test]
fn npz_and_csv_agree() {
    let folder = Folder::new("npz");
    folder.write("s.xml", SCENE);
    let csv = stdout(&folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS));
    let output = folder.run_with(&["probe", "s.xml", "--points", "-", "-o", "light.npz"], POINTS);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let bytes = fs::read(folder.0.join("light.npz")).unwrap();
    let direct: f64 = csv.lines().nth(1).unwrap().split(',').nth(7).unwrap().parse().unwrap();
    let found = bytes.windows(8).filter(|w| *w == direct.to_le_bytes()).count();
    assert_eq!(found, 3, "grey light: the same number in three channels, and another total");
    for name in ["position", "normal", "direct", "specular", "indirect", "total", "error", "label"]
    {
        // In an archive once before the array, and once in the directory; "indirect" ends like "direct".
        let count = if name == "direct" { 4 } else { 2 };
        let name = format!("{name}.npy");
        assert_eq!(bytes.windows(name.len()).filter(|w| *w == name.as_bytes()).count(), count);
    }
}

#[test]
fn json_is_one_object_at_the_end() {
    let folder = Folder::new("json");
    folder.write("s.xml", SCENE);
    folder.write("p.csv", POINTS);
    let output =
        folder.run(&["probe", "s.xml", "--points", "p.csv", "-o", "light.csv", "--json", "-q"]);
    assert_eq!(stdout(&output).lines().count(), 1);
    let value = json(&output);
    assert_eq!(value["verb"], "probe");
    assert_eq!(value["exit"], 0);
    assert_eq!(value["counts"]["receivers"], 3);
    assert_eq!(value["receivers_unmet"], 0);
    assert_eq!(value["files"], serde_json::json!(["light.csv"]));
    assert!(value["timings"]["total"].as_f64().unwrap() > 0.0);
    assert!(value["largest_error"].as_f64().unwrap() >= 0.0);
    assert!(stderr(&output).is_empty(), "{}", stderr(&output));

    let check = json(&folder.run(&["check", "s.xml", "--json"]));
    assert_eq!(check["shapes"].as_array().unwrap().len(), 3);
    assert_eq!(check["lamps"], serde_json::json!(["lamp"]));
    let flux = check["emitted_flux"][0].as_f64().unwrap();
    assert!((flux - 100.0 * std::f64::consts::PI).abs() < 1e-9);
    assert_eq!(check["surface_area"], 2.0 * (16.0 + 4.0 + 1.0));

    let failed = folder.run(&["check", "none.xml", "--json"]);
    assert_eq!(status(&failed), 1);
    assert_eq!(json(&failed)["exit"], 1);
    assert!(json(&failed)["error"].as_str().unwrap().contains("none.xml"));
}

#[test]
fn wrong_input_ends_with_1_and_leaves_files_alone() {
    let folder = Folder::new("input");
    folder.write("s.xml", SCENE);
    folder.write("bad.xml", SCENE.replace("rectangle", "rectangel"));
    folder.write("p.csv", POINTS);
    folder.write("bad.csv", "x,y,z,nx,ny,nz\n0,0,0,0,zero,1\n");
    folder.write("clash.csv", "x,y,z,nx,ny,nz,error\n0,0,0,0,0,1,?\n");
    folder.write("light.csv", "old");
    folder.write("picture.exr", "old");
    for (arguments, words) in [
        (&["probe", "bad.xml", "--points", "p.csv", "-o", "light.csv"][..], "bad.xml:13:18"),
        (&["probe", "s.xml", "--points", "bad.csv", "-o", "light.csv"], "bad.csv:2:9"),
        (&["probe", "s.xml", "--points", "clash.csv", "-o", "light.csv"], "'error'"),
        (&["probe", "s.xml", "--points", "none.csv", "-o", "light.csv"], "none.csv"),
        (&["probe", "s.xml", "--points", "p.csv", "-o", "no/light.csv"], "no folder 'no'"),
        (&["probe", "s.xml", "--points", "p.csv", "-D", "hieght=3", "-o", "light.csv"], "hieght"),
        (&["render", "bad.xml", "-o", "picture.exr"], "bad.xml:13:18"),
        (&["render", "none.xml", "-o", "picture.exr"], "none.xml"),
        (&["check", "bad.xml"], "bad.xml:13:18"),
    ] {
        for quiet in [&[][..], &["-q"]] {
            let arguments = [arguments, quiet].concat();
            let output = folder.run(&arguments);
            assert_eq!(status(&output), 1, "{arguments:?}");
            assert!(stderr(&output).contains(words), "{arguments:?}: {}", stderr(&output));
            assert!(stdout(&output).is_empty(), "{arguments:?}");
        }
    }
    assert_eq!(fs::read(folder.0.join("light.csv")).unwrap(), b"old");
    assert_eq!(fs::read(folder.0.join("picture.exr")).unwrap(), b"old");
    assert_eq!(folder.names().len(), 7);
}

#[test]
fn a_scene_without_a_sensor_can_be_probed_but_not_drawn() {
    let folder = Folder::new("sensor");
    let (start, end) = (SCENE.find("<sensor").unwrap(), SCENE.find("</sensor>").unwrap() + 9);
    folder.write("s.xml", SCENE[..start].to_owned() + &SCENE[end..]);
    let drawn = folder.run(&["render", "s.xml"]);
    assert_eq!(status(&drawn), 1);
    assert!(stderr(&drawn).contains("sensor"));
    assert_eq!(status(&folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS)), 0);
    assert_eq!(folder.names(), ["s.xml"]);
}

#[test]
fn render_writes_what_its_name_says() {
    let folder = Folder::new("render");
    folder.write("s.xml", SCENE);
    let output = folder.run(&["render", "s.xml", "--json"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["files"], serde_json::json!(["s.exr", "s.png"]));
    for (name, magic) in
        [("a.exr", &b"\x76\x2f\x31\x01"[..]), ("a.png", b"\x89PNG"), ("a.hdr", b"#?RA")]
    {
        let output =
            folder.run(&["render", "s.xml", "-o", name, "--size", "8x6", "--exposure", "-2"]);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        assert!(fs::read(folder.0.join(name)).unwrap().starts_with(magic), "{name}");
    }
    assert_eq!(folder.names(), ["a.exr", "a.hdr", "a.png", "s.exr", "s.png", "s.xml"]);
}

#[test]
fn one_thread_and_two_threads_write_the_same_bits() {
    let folder = Folder::new("threads");
    folder.write("s.xml", SCENE);
    let mut points = String::from("x,y,z,nx,ny,nz\n");
    for i in 0..40 {
        points += &format!("{},{},0,0,0,1\n", f64::from(i) * 0.04 - 0.8, f64::from(i % 7) * 0.1);
    }
    folder.write("p.csv", points);
    for threads in ["1", "2", "5"] {
        for (name, arguments) in [
            ("csv", &["probe", "s.xml", "--points", "p.csv"][..]),
            ("npz", &["probe", "s.xml", "--points", "p.csv"]),
            ("exr", &["render", "s.xml", "--size", "48x40"]),
            ("png", &["render", "s.xml"]),
            ("hdr", &["render", "s.xml"]),
        ] {
            let file = format!("{threads}.{name}");
            let arguments = [arguments, &["-t", threads, "-o", &file]].concat();
            assert_eq!(status(&folder.run(&arguments)), 0);
            let bytes = |t: &str| fs::read(folder.0.join(format!("{t}.{name}"))).unwrap();
            assert!(bytes(threads) == bytes("1"), "{name} with {threads} threads");
        }
    }
}

#[test]
fn a_receiver_does_not_depend_on_its_neighbours() {
    let folder = Folder::new("alone");
    folder.write("s.xml", SCENE);
    let together = stdout(&folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS));
    let lines: Vec<&str> = POINTS.lines().collect();
    for i in 1..lines.len() {
        let alone = format!("{}\n{}\n", lines[0], lines[i]);
        let alone = stdout(&folder.run_with(&["probe", "s.xml", "--points", "-"], &alone));
        assert_eq!(alone.lines().nth(1), together.lines().nth(i));
    }
}

/// The scenes that come with the repository and must be refused.
#[test]
fn bad_scenes_are_refused_with_a_place_and_a_remedy() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/bad");
    let folder = Folder::new("bad");
    let mut count = 0;
    let mut scenes: Vec<PathBuf> = fs::read_dir(&cases)
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "xml"))
        .collect();
    scenes.sort();
    for scene in scenes {
        let name = scene.file_name().unwrap().to_str().unwrap();
        let output = folder.run(&["render", scene.to_str().unwrap(), "-o", "picture.exr"]);
        let message = stderr(&output);
        assert_eq!(status(&output), 1, "{name}: {message}");
        assert!(!message.contains("panicked"), "{name}: {message}");
        let placed = message.match_indices(':').any(|(i, _)| {
            let rest = &message[i + 1..];
            let line = rest.split(':').next().unwrap_or("");
            let column = rest[line.len()..].trim_start_matches(':');
            let digits = |s: &str| s.starts_with(|c: char| c.is_ascii_digit());
            digits(line) && line.chars().all(|c| c.is_ascii_digit()) && digits(column)
        });
        assert!(placed, "{name} says no file:line:column:\n{message}");
        count += 1;
    }
    assert!(folder.names().is_empty());
    assert!(count >= 20);
}

/// Single bytes of a good scene changed: fine or refused, never a crash, never much memory.
#[test]
fn mutated_scenes_do_no_harm() {
    let folder = Folder::new("mutations");
    // A fixed walk over positions and bytes (a linear congruence), so that a failure can be repeated.
    let mut state: u64 = 1;
    let mut next = |n: usize| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % n
    };
    for i in 0..60 {
        let mut bytes = SCENE.as_bytes().to_vec();
        let (at, byte) = (next(bytes.len()), next(256) as u8);
        bytes[at] = byte;
        folder.write("m.xml", &bytes);
        let limited = format!(
            "ulimit -v 1000000; exec '{}' probe m.xml --points - -o m.csv -t 1 --max-time 20",
            env!("CARGO_BIN_EXE_evolute")
        );
        let mut child = Command::new("sh")
            .args(["-c", &limited])
            .current_dir(&folder.0)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let _ = child.stdin.take().unwrap().write_all(POINTS.as_bytes());
        let output = child.wait_with_output().unwrap();
        let code = output.status.code();
        assert!(
            matches!(code, Some(0 | 1)),
            "mutation {i}: byte {at} to {byte:#x}: {code:?} {}",
            String::from_utf8_lossy(&output.stderr)
        );
    }
}
