//! Solutions in files: what `solve` writes, `render` and `probe` read, and `--resume` goes on from.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use common::{Folder, POINTS, SCENE, json, status, stderr, stdout};

/// The common scene, and a wall that faces the floor, so that light goes to and fro.
fn walled() -> String {
    let wall = r#"<shape type="rectangle" id="wall">
        <transform name="to_world"><rotate x="1" angle="90"/><translate y="1.5" z="1"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.6, 0.4"/></bsdf>
    </shape>
</scene>"#;
    SCENE.replace("</scene>", wall)
}

#[test]
fn a_solution_serves_pictures_and_points() {
    let folder = Folder::new("serves");
    folder.write("s.xml", walled());
    let output = folder.run(&["solve", "s.xml", "-o", "s.evolute", "--json", "-t", "2"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let said = json(&output);
    assert_eq!(said["files"], serde_json::json!(["s.evolute"]));
    assert_eq!(said["solution"]["complete"], true);
    assert!(said["solution"]["iterations"]["diffuse"].as_u64().unwrap() > 0);
    assert!(said["ledger"]["emitted"][0].as_f64().unwrap() > 0.0);
    // The same bytes by another number of threads.
    assert_eq!(status(&folder.run(&["solve", "s.xml", "-o", "t.evolute", "-t", "1"])), 0);
    let bytes = |name: &str| fs::read(folder.0.join(name)).unwrap();
    assert!(bytes("s.evolute") == bytes("t.evolute"));

    // The same numbers as by a solution that is made on the way.
    let made = stdout(&folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS));
    let solution = ["--solution", "s.evolute"];
    let probe = |arguments: &[&str], points: &str| {
        let arguments = [&["probe", "s.xml", "--points", "-"], &solution[..], arguments].concat();
        let output = folder.run_with(&arguments, points);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        stdout(&output)
    };
    let read = probe(&[], POINTS);
    assert_eq!(made, read);
    let numbers = |line: &str| -> Vec<f64> {
        let fields: Vec<&str> = line.split(',').collect();
        fields[fields.len() - 13..].iter().map(|f| f.parse().unwrap()).collect()
    };
    for line in read.lines().skip(1) {
        let light = numbers(line);
        for c in 0..3 {
            assert!(light[6 + c] > 0.0, "{line}");
            assert_eq!(light[9 + c], light[c] + light[3 + c] + light[6 + c]);
        }
        assert!(light[12] > 0.0 && light[12] < 0.05 * light[9], "{line}");
    }
    // No receiver depends on others, nor on the order of threads.
    let lines: Vec<&str> = POINTS.lines().collect();
    for i in 1..lines.len() {
        let alone = probe(&["-t", "1"], &format!("{}\n{}\n", lines[0], lines[i]));
        assert_eq!(alone.lines().nth(1), read.lines().nth(i));
    }
    for format in ["a.exr", "b.exr"] {
        let from: &[&str] = if format == "a.exr" { &solution } else { &[] };
        let output = folder.run(&[&["render", "s.xml", "-o", format], from].concat());
        assert_eq!(status(&output), 0, "{}", stderr(&output));
    }
    assert!(bytes("a.exr") == bytes("b.exr"));
    // The camera may be moved, and a coarser solution is said to be one.
    folder.write("moved.xml", walled().replace("0, -4, 1.5", "1, -4, 1.5"));
    let output = folder
        .run(&[&["render", "moved.xml", "-a", "0.005", "-o", "c.png"], &solution[..]].concat());
    assert_eq!(status(&output), 0);
    assert!(stderr(&output).contains("--accuracy 0.01"), "{}", stderr(&output));
}

/// Between two large facing walls: a receiver in free air, on a wall, and inside a ball of glass.
#[test]
fn indirect_light_is_right_within_its_error() {
    let folder = Folder::new("cube");
    // All faces of a cube with the same reflectance and radiosity: a white furnace with a lamp on all sides. What
    // comes directly is πL everywhere, what comes by way of n reflections ρⁿ of it.
    let mut scene = String::from("<scene version=\"3.0.0\">\n");
    for turn in [
        "y\" angle=\"0",
        "y\" angle=\"90",
        "y\" angle=\"180",
        "y\" angle=\"270",
        "x\" angle=\"90",
        "x\" angle=\"270",
    ] {
        scene += &format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\"><translate z=\"-1\"/>\
             <rotate {}\"/></transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" value=\"0.5\"/></bsdf>\
             <emitter type=\"area\"><rgb name=\"radiance\" value=\"1\"/></emitter></shape>\n",
            turn.replacen("\" angle", "=\"1\" angle", 1)
        );
    }
    folder.write("air.xml", scene.clone() + "</scene>");
    let points = "x,y,z,nx,ny,nz\n0.1,0.2,0.3,0,0,1\n0.5,-0.3,-1,0,0,1\n0,0,0,1,2,3\n";
    let probe = |scene: &str, components: &str| -> Vec<Vec<f64>> {
        let arguments = ["probe", scene, "--points", "-", "--components", components];
        let output = folder.run_with(&arguments, points);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let text = stdout(&output);
        let numbers = |line: &str| line.split(',').skip(6).map(|f| f.parse().unwrap()).collect();
        text.lines().skip(1).map(numbers).collect()
    };
    let all = std::f64::consts::PI;
    for row in probe("air.xml", "indirect,total") {
        let (indirect, total, error) = (row[0], row[3], row[6]);
        assert!((indirect - all).abs() <= error, "{indirect} {error}");
        assert!((total - 2.0 * all).abs() <= error, "{total} {error}");
        assert!(error < 0.02 * total, "{error}");
    }
    // Inside glass radiance is n² as large, but for what its surface reflects back and forth, which in a furnace
    // changes nothing.
    scene += "<shape type=\"sphere\"><float name=\"radius\" value=\"0.2\"/><bsdf type=\"dielectric\">\
              <float name=\"int_ior\" value=\"1.5\"/><float name=\"ext_ior\" value=\"1\"/></bsdf></shape></scene>";
    folder.write("glass.xml", scene);
    let inside = &probe("glass.xml", "indirect")[2];
    let expected = 2.25 * all;
    assert!(
        (inside[0] - expected).abs() <= inside[3].max(0.01 * expected),
        "{inside:?} {expected}"
    );
}

/// A solution takes half of the time at most, so that what lamps send is there whatever becomes of it.
#[test]
fn lamps_have_their_share_of_a_time_limit() {
    let folder = Folder::new("share");
    folder.write("s.xml", walled());
    let probe = |arguments: &[&str]| {
        let arguments = [&["probe", "s.xml", "--points", "-", "-a", "1e-4"], arguments].concat();
        folder.run_with(&arguments, POINTS)
    };
    // Enough work for a solution that it is not done with after three seconds.
    let output = probe(&["--max-time", "6"]);
    assert_eq!(status(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("radiosity solution was stopped"), "{}", stderr(&output));
    let alone = probe(&["--components", "direct,specular"]);
    assert_eq!(status(&alone), 0, "{}", stderr(&alone));
    let lamps = |line: &str| {
        let fields: Vec<f64> = line.split(',').filter_map(|f| f.parse().ok()).collect();
        let first = fields.len() - if fields.len() > 15 { 13 } else { 7 };
        fields[first..first + 3].to_vec()
    };
    let (output, alone) = (stdout(&output), stdout(&alone));
    for (line, alone) in output.lines().zip(alone.lines()).skip(1) {
        for (light, expected) in lamps(line).iter().zip(lamps(alone)) {
            assert!((light - expected).abs() <= 2e-4 * expected.abs(), "{line}\n{alone}");
        }
    }
}

#[test]
fn limits_and_resumption() {
    let folder = Folder::new("resumption");
    folder.write("s.xml", walled());
    let bytes = |name: &str| fs::read(folder.0.join(name)).unwrap();
    assert_eq!(status(&folder.run(&["solve", "s.xml", "-o", "whole.evolute"])), 0);
    // A limit on iterations; then one on time, which nothing can be done in; then none.
    let solve = |arguments: &[&str]| {
        folder.run(&[&["solve", "s.xml", "-o", "part.evolute", "--json"], arguments].concat())
    };
    let output = solve(&["--max-iterations", "40"]);
    assert_eq!(status(&output), 3);
    assert!(stderr(&output).contains("--resume"), "{}", stderr(&output));
    assert_eq!(json(&output)["solution"]["complete"], false);
    assert_ne!(bytes("part.evolute"), bytes("whole.evolute"));
    for (arguments, words) in [
        (&["-a", "0.02"][..], "--accuracy 0.01, and 0.02 is asked for"),
        (&["--max-specular", "3"], "--max-specular"),
        (&["-D", "height=1.5"], "another scene"),
    ] {
        let output = solve(&[&["--resume"], arguments].concat());
        assert_eq!(status(&output), 1, "{arguments:?}");
        assert!(stderr(&output).contains(words), "{}", stderr(&output));
    }
    // It can be used, and says that it is not all.
    let probe = ["probe", "s.xml", "--points", "-", "--solution", "part.evolute"];
    let output = folder.run_with(&probe, POINTS);
    assert_eq!(status(&output), 3);
    assert!(stderr(&output).contains("--resume"), "{}", stderr(&output));
    let error = |text: &str| -> f64 {
        text.lines().nth(3).unwrap().rsplit(',').next().unwrap().parse().unwrap()
    };
    let coarse = error(&stdout(&output));
    let output = folder.run(&["render", "s.xml", "-o", "a.png", "--solution", "part.evolute"]);
    assert_eq!(status(&output), 3);
    assert!(folder.0.join("a.png").exists());
    // All vertices are known, and iterations cost next to nothing.
    let output = solve(&["--resume", "--max-time", "0"]);
    assert_eq!(status(&output), 3);
    assert_eq!(json(&output)["resumed"]["iterations"], 40);
    let output = solve(&["--resume"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    assert_eq!(json(&output)["resumed"]["iterations"], 40);
    assert!(bytes("part.evolute") == bytes("whole.evolute"));
    let fine = error(&stdout(&folder.run_with(&probe, POINTS)));
    assert!(coarse > fine, "{coarse} {fine}");
    let output = solve(&["--resume"]);
    assert_eq!(status(&output), 0);
    assert!(stderr(&output).contains("nothing is left to do"));
    // Without a file, it begins.
    let output =
        folder.run(&["solve", "s.xml", "-o", "new.evolute", "--resume", "--max-time", "0"]);
    assert_eq!(status(&output), 3);
    assert!(stderr(&output).contains("beginning"), "{}", stderr(&output));
    assert!(folder.0.join("new.evolute").exists());
}

#[test]
fn files_that_are_no_solution_are_refused() {
    let folder = Folder::new("refused");
    folder.write("s.xml", walled());
    assert_eq!(status(&folder.run(&["solve", "s.xml", "-o", "s.evolute", "-a", "0.05"])), 0);
    let whole = fs::read(folder.0.join("s.evolute")).unwrap();
    folder.write("short.evolute", &whole[..whole.len() / 2]);
    folder.write("empty.evolute", "");
    folder.write("text.evolute", "x,y,z\n".repeat(1000));
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 4;
    folder.write("flipped.evolute", flipped);
    let mut newer = whole;
    newer[8] = 9;
    folder.write("newer.evolute", newer);
    for (name, words) in [
        ("short.evolute", "should have"),
        ("empty.evolute", "not a solution file"),
        ("text.evolute", "not a solution file"),
        ("flipped.evolute", "damaged"),
        ("newer.evolute", "newer evolute"),
        ("none.evolute", "no such file"),
        (".", "it is no file"),
    ] {
        let solution = ["--solution", name];
        let probe = ["probe", "s.xml", "--points", "-", "-o", "light.csv"];
        for arguments in [&probe[..], &["render", "s.xml", "-o", "a.exr"]] {
            let output = folder.run_with(&[arguments, &solution].concat(), POINTS);
            assert_eq!(status(&output), 1, "{name}");
            let said = stderr(&output);
            assert!(said.contains(words) && said.contains(name), "{name}: {said}");
        }
        if name.ends_with("evolute") && name != "none.evolute" {
            let output = folder.run(&["solve", "s.xml", "-a", "0.05", "-o", name, "--resume"]);
            assert_eq!(status(&output), 1, "{name}");
            assert!(stderr(&output).contains(words), "{name}: {}", stderr(&output));
        }
    }
    assert!(!folder.0.join("light.csv").exists() && !folder.0.join("a.exr").exists());
}

/// Ctrl-C at several moments: what was done is kept, and the end is the same.
#[cfg(unix)]
#[test]
fn an_interrupted_solve_goes_on() {
    let folder = Folder::new("interrupted-solve");
    folder.write("s.xml", walled());
    let solve = |name: &str, resume: &[&str]| -> Vec<String> {
        let arguments = [&["solve", "s.xml", "-a", "0.005", "-o", name], resume].concat();
        arguments.into_iter().map(String::from).collect()
    };
    let whole = solve("whole.evolute", &[]);
    let whole: Vec<&str> = whole.iter().map(String::as_str).collect();
    assert_eq!(status(&folder.run(&whole)), 0);
    let mut kept = 0;
    for run in 0..200u64 {
        let child = Command::new(env!("CARGO_BIN_EXE_evolute"))
            .args(solve("part.evolute", if run == 0 { &[] } else { &["--resume", "-q"] }))
            .current_dir(&folder.0)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // Each time a little later: in the end there is time enough.
        std::thread::sleep(Duration::from_millis(150 + 100 * run));
        let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
        let output = child.wait_with_output().unwrap();
        match output.status.code() {
            Some(0) => break,
            Some(130) => {
                let said = stderr(&output);
                kept += u32::from(said.contains("--resume"));
                assert!(
                    said.contains("--resume") || said.contains("nothing was written"),
                    "{said}"
                );
            }
            other => panic!("{other:?}: {}", stderr(&output)),
        }
    }
    assert!(kept > 0);
    let bytes = |name: &str| fs::read(folder.0.join(name)).unwrap();
    assert!(bytes("part.evolute") == bytes("whole.evolute"));
}
