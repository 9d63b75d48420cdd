//! `evolute export` from the outside: what it writes is the same scene.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;

use common::{Folder, POINTS, SCENE, json, status, stderr, stdout};

/// The mirror of `SCENE` as a formula. Its x_s × x_t points away from the floor's middle, and the flip back.
fn with_formula() -> String {
    let shape = r#"<shape type="parametric" id="mirror">
        <string name="x" value="-1.5"/> <string name="y" value="1-2*s"/> <string name="z" value="2*t"/>
        <boolean name="flip_normals" value="true"/>"#;
    let start = SCENE.find("<shape type=\"rectangle\" id=\"mirror\">").unwrap();
    let end = start + SCENE[start..].find("<bsdf").unwrap();
    format!("{}{shape}{}", &SCENE[..start], &SCENE[end..])
}

/// The sums of `direct` and of `specular` at each of the points.
fn light(folder: &Folder, scene: &str, define: &[&str]) -> Vec<[f64; 2]> {
    let arguments =
        ["probe", scene, "--points", "-", "-a", "1e-4", "--components", "direct,specular"];
    let output = folder.run_with(&[&arguments[..], define].concat(), POINTS);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    let first = text.lines().next().unwrap().split(',').position(|c| c == "direct_r").unwrap();
    let row = |line: &str| {
        // The label may hold a comma; numbers come after it.
        let fields: Vec<&str> = line.rsplit(',').collect();
        let number = |from_end: usize| fields[from_end].parse::<f64>().unwrap();
        [number(6) + number(5) + number(4), number(3) + number(2) + number(1)]
    };
    assert_eq!(first, 7);
    text.lines().skip(1).map(row).collect()
}

#[test]
fn a_scene_is_the_same_in_other_words() {
    let folder = Folder::new("export");
    folder.write("s.xml", with_formula());
    let define = ["-D", "height=1.75"];
    let output = folder.run(
        &[&["export", "s.xml", "-o", "plain/new", "--triangles", "2", "--json"][..], &define]
            .concat(),
    );
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let facts = json(&output);
    assert_eq!(facts["files"], serde_json::json!(["plain/new/mirror.ply", "plain/new/s.xml"]));
    assert!(facts["meshes"][0]["triangles"].as_u64().unwrap() >= 2);
    assert_eq!(facts["meshes"][0]["shape"], "mirror");
    let text = fs::read_to_string(folder.0.join("plain/new/s.xml")).unwrap();
    assert!(!text.contains("parametric") && !text.contains('$'), "{text}");
    // The parameter is part of the file now. A plane of triangles is as good as its formula.
    let (ours, theirs) = (light(&folder, "s.xml", &define), light(&folder, "plain/new/s.xml", &[]));
    assert!(ours.iter().all(|[direct, _]| *direct > 1.0), "{ours:?}");
    assert!(ours.iter().any(|[_, specular]| *specular > 1.0), "{ours:?}");
    for (a, b) in ours.iter().zip(&theirs) {
        for k in 0..2 {
            assert!((a[k] - b[k]).abs() <= 1e-3 * (a[0] + a[1]), "{a:?} {b:?}");
        }
    }
}

#[test]
fn the_built_in_room_needs_no_scene() {
    let folder = Folder::new("export-room");
    let output = folder.run(&["export", "-o", ".", "--triangles", "200"]);
    assert_eq!(status(&output), 0, "{}", stderr(&output));
    let names = folder.names();
    assert!(names.contains(&"room.xml".to_string()), "{names:?}");
    let check = folder.run(&["check", "room.xml", "--json", "-q"]);
    assert_eq!(status(&check), 0, "{}", stderr(&check));
    let shapes = json(&check)["shapes"].clone();
    assert!(shapes.as_array().unwrap().iter().all(|s| s["kind"] != "parametric"));
}

#[test]
fn nothing_is_written_over_the_scene_or_of_a_wrong_one() {
    let folder = Folder::new("export-refused");
    folder.write("s.xml", with_formula());
    folder.write("wrong.xml", with_formula().replace("1-2*s", "1-2*q"));
    let over = folder.run(&["export", "s.xml", "-o", "."]);
    assert_eq!(status(&over), 2);
    assert!(stderr(&over).contains("overwritten"), "{}", stderr(&over));
    assert_eq!(fs::read_to_string(folder.0.join("s.xml")).unwrap(), with_formula());
    let wrong = folder.run(&["export", "wrong.xml", "-o", "plain"]);
    assert_eq!(status(&wrong), 1);
    assert!(stderr(&wrong).contains("wrong.xml:"), "{}", stderr(&wrong));
    assert_eq!(folder.names(), ["s.xml", "wrong.xml"]);
    // A file where the folder should be.
    folder.write("plain", "");
    let file = folder.run(&["export", "s.xml", "-o", "plain"]);
    assert_eq!(status(&file), 1);
    assert!(stderr(&file).contains("folder 'plain'"), "{}", stderr(&file));
}
