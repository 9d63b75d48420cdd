//! The program under limits and interruptions: what is written then, and how it ends.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;
use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use common::{Folder, POINTS, SCENE, json, status, stderr, stdout};

/// A lamp over rings of mirror balls: one receiver takes seconds, as light has thousands of ways.
fn balls() -> String {
    let mut scene = String::from("<scene version=\"3.0.0\">\n");
    for i in 0..300 {
        let angle = f64::from(i) * 2.4;
        let (x, y) = (1.5 * angle.cos(), 1.5 * angle.sin());
        let z = 0.3 + 0.01 * f64::from(i);
        scene += &format!(
            "<shape type=\"sphere\"><point name=\"center\" value=\"{x}, {y}, {z}\"/>\
             <float name=\"radius\" value=\"0.15\"/><bsdf type=\"conductor\">\
             <string name=\"material\" value=\"none\"/></bsdf></shape>\n"
        );
    }
    let lamp = &SCENE[SCENE.find("<shape type=\"rectangle\" id=\"lamp\">").unwrap()..];
    scene + &lamp.replace("$height", "4")
}

#[test]
fn a_time_limit_acts_inside_a_receiver() {
    let folder = Folder::new("inside");
    folder.write("s.xml", balls());
    let points = "x,y,z,nx,ny,nz\n0,0,0,0,0.1,1\n";
    let begin = Instant::now();
    let output = folder.run_with(
        &[
            "probe",
            "s.xml",
            "--points",
            "-",
            "--components",
            "direct,specular",
            "-a",
            "1e-6",
            "--max-time",
            "1",
            "--json",
        ],
        points,
    );
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    assert_eq!(status(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("--max-time"));
    let said = json(&output);
    assert_eq!(said["receivers_stopped"], 1, "{said}");
    assert_eq!(said["receivers_left_out"], 0);
    assert_eq!(said["receivers_unmet"], 1);
    let text = stdout(&output);
    let fields: Vec<f64> =
        text.lines().nth(1).unwrap().split(',').map(|f| f.parse().unwrap()).collect();
    // The lamp is seen, what the balls send is not all known, and the error says so.
    assert!(fields[6] > 0.0 && fields[12].is_finite() && fields[12] > 1e-5 * fields[6]);
}

#[test]
fn an_exhausted_time_limit_writes_and_ends_with_3() {
    let folder = Folder::new("limit");
    folder.write("s.xml", SCENE);
    let output = folder.run_with(
        &["probe", "s.xml", "--points", "-", "-o", "light.csv", "--max-time", "0", "--json"],
        POINTS,
    );
    assert_eq!(status(&output), 3);
    assert_eq!(json(&output)["receivers_left_out"], 3);
    assert!(stderr(&output).contains("--max-time"));
    let text = fs::read_to_string(folder.0.join("light.csv")).unwrap();
    assert!(text.lines().nth(1).unwrap().ends_with(&("nan,".repeat(12) + "inf")));
    let output = folder.run(&["render", "s.xml", "-o", "a.exr", "--max-time", "0"]);
    assert_eq!(status(&output), 3);
    assert!(folder.0.join("a.exr").exists());
    // There is nothing to be cut short in a check.
    assert_eq!(status(&folder.run(&["check", "s.xml", "--max-time", "0"])), 0);
}

#[cfg(unix)]
fn started(folder: &Folder, arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_evolute"))
        .args(arguments)
        .current_dir(&folder.0)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Presses Ctrl-C after some time of work; the exit status and the messages.
#[cfg(unix)]
fn interrupted(mut child: Child, after: Duration) -> (Option<i32>, String) {
    std::thread::sleep(after);
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let begin = Instant::now();
    let code = child.wait().unwrap().code();
    assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    let mut text = String::new();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    (code, text)
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_with_130_and_writes_nothing() {
    let folder = Folder::new("interrupt");
    folder.write("s.xml", SCENE);
    folder.write("balls.xml", balls());
    folder.write("light.csv", "old");
    // Enough work for much longer than the test waits, between receivers and inside one.
    let mut points = String::from("x,y,z,nx,ny,nz\n");
    points += &"0.3,0.2,0.1,0.1,0.2,1\n".repeat(300_000);
    folder.write("many.csv", points);
    folder.write("one.csv", "x,y,z,nx,ny,nz\n0,0,0,0,0.1,1\n");
    let lamps = ["--components", "direct,specular"];
    for (arguments, components) in [
        (
            &["probe", "s.xml", "--points", "many.csv", "-o", "light.csv", "-a", "1e-5"][..],
            &lamps[..],
        ),
        (&["probe", "balls.xml", "--points", "one.csv", "-o", "light.csv", "-a", "1e-6"], &lamps),
        (&["render", "s.xml", "-o", "a.exr", "-a", "1e-6", "--size", "4000x3000"], &[]),
        // In the radiosity solution.
        (&["probe", "s.xml", "--points", "one.csv", "-o", "light.csv", "-a", "1e-6"], &[]),
    ] {
        let child = started(&folder, &[arguments, components].concat());
        let (code, text) = interrupted(child, Duration::from_millis(1500));
        assert_eq!(code, Some(130), "{arguments:?}: {text}");
        assert!(text.contains("nothing was written"), "{arguments:?}: {text}");
    }
    assert_eq!(folder.names(), ["balls.xml", "light.csv", "many.csv", "one.csv", "s.xml"]);
    assert_eq!(fs::read(folder.0.join("light.csv")).unwrap(), b"old");
}

/// Whoever is asked for a table at the keyboard can leave.
#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_wait_for_a_table() {
    let folder = Folder::new("wait");
    folder.write("s.xml", SCENE);
    let mut child = started(&folder, &["probe", "s.xml", "--points", "-", "-o", "light.csv"]);
    // Held open: `wait` would close it, and the table would end.
    let input = child.stdin.take();
    let (code, text) = interrupted(child, Duration::from_millis(500));
    drop(input);
    assert_eq!(code, Some(130), "{text}");
    assert_eq!(folder.names(), ["s.xml"]);
}
