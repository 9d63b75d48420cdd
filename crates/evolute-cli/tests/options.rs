//! What the program makes of its options and tables, from the outside.
#![allow(clippy::unwrap_used)]

mod common;

use std::fs;

use common::{Folder, POINTS, SCENE, json, status, stderr, stdout};

#[test]
fn numbers_out_of_range_are_named() {
    let folder = Folder::new("range");
    folder.write("s.xml", SCENE);
    for (option, value, words) in [
        ("-a", "-1", "more than 0"),
        ("-a", "0", "more than 0"),
        ("-a", "NaN", "not a number"),
        ("-a", "1e300", "at most 1"),
        ("--accuracy-abs", "-1e-3", "negative"),
        ("--accuracy-abs", "inf", "a finite number"),
        ("--max-time", "-1", "negative"),
        ("--max-time", "1e300", "too long"),
        ("--max-time", "inf", "there is no limit"),
        ("--max-specular", "-1", "0..=256"),
        ("--max-specular", "257", "0..=256"),
        ("-t", "-1", "1..=65535"),
    ] {
        let output = folder.run_with(&["probe", "s.xml", "--points", "-", option, value], POINTS);
        assert_eq!(status(&output), 2, "{option} {value}");
        assert!(stderr(&output).contains(words), "{option} {value}: {}", stderr(&output));
    }
    for (size, words) in [("-8x6", "WIDTHxHEIGHT"), ("32768x32768", "too large")] {
        let output = folder.run(&["render", "s.xml", "--size", size]);
        assert_eq!(status(&output), 2, "{size}");
        assert!(stderr(&output).contains(words), "{size}: {}", stderr(&output));
    }
    assert_eq!(folder.names(), ["s.xml"]);
}

#[test]
fn accuracies_are_met_or_the_miss_is_counted() {
    let folder = Folder::new("accuracy");
    folder.write("s.xml", SCENE);
    let run = |arguments: &[&str]| {
        let lamps = ["--components", "direct,specular"];
        let arguments =
            [&["probe", "s.xml", "--points", "-", "--json"], &lamps[..], arguments].concat();
        let output = folder.run_with(&arguments, POINTS);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        (json(&output), stderr(&output))
    };
    let (coarse, _) = run(&["--accuracy-abs", "1000"]);
    let (fine, _) = run(&["-a", "1e-5"]);
    assert!(fine["largest_error"].as_f64() < coarse["largest_error"].as_f64());
    assert!(fine["counts"]["chains"].as_u64() > coarse["counts"]["chains"].as_u64());
    assert_eq!(fine["receivers_unmet"], 0);
    assert_eq!(coarse["accuracy_abs"], 1000.0);
    // Below rounding no tolerance can be met: that is no failure, and it is said.
    let (never, said) = run(&["-a", "1e-300", "--accuracy-abs", "0"]);
    let unmet = never["receivers_unmet"].as_u64().unwrap();
    assert!(unmet > 0);
    assert!(said.contains(&format!("{unmet} of 3 receivers")), "{said}");
}

#[test]
fn the_longest_chain_can_be_chosen() {
    let folder = Folder::new("longest");
    folder.write("s.xml", SCENE);
    let run = |arguments: &[&str]| {
        let arguments = [&["probe", "s.xml", "--points", "-", "--json"], arguments].concat();
        let output = folder.run_with(&arguments, POINTS);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        let specular =
            stdout(&output).lines().nth(1).unwrap().split(',').nth(10).unwrap().to_owned();
        (json(&output)["max_specular"].clone(), specular.parse::<f64>().unwrap())
    };
    assert_eq!(run(&["--max-specular", "0"]), (0.into(), 0.0));
    let (longest, light) = run(&[]);
    assert!(longest == 256 && light > 0.0);
    assert_eq!(run(&["--max-specular", "1"]), (1.into(), light));
}

#[test]
fn scene_parameters() {
    let folder = Folder::new("parameters");
    // A name that begins with another one.
    let scene = SCENE.replace("$height", "$height_of_lamp").replace(
        "<default name=\"height\" value=\"2\"/>",
        "<default name=\"height\" value=\"7\"/><default name=\"height_of_lamp\" value=\"2\"/>\
         <default name=\"unread\" value=\"$height\"/>",
    );
    folder.write("long.xml", &scene);
    folder.write("s.xml", SCENE);
    let direct = |arguments: &[&str]| {
        let output = folder.run_with(arguments, POINTS);
        assert_eq!(status(&output), 0, "{}", stderr(&output));
        stdout(&output).lines().nth(1).unwrap().split(',').nth(7).unwrap().to_owned()
    };
    let plain = direct(&["probe", "s.xml", "--points", "-"]);
    assert_eq!(direct(&["probe", "long.xml", "--points", "-"]), plain);
    let high = direct(&["probe", "s.xml", "--points", "-", "-D", "height=3"]);
    assert_ne!(high, plain);
    assert_eq!(direct(&["probe", "long.xml", "--points", "-", "-Dheight_of_lamp=3"]), high);
    for (definition, words) in
        [("hieght=3", "height"), ("height=tall", "tall"), ("height=", "height")]
    {
        let output = folder.run(&["check", "s.xml", "-D", definition]);
        assert_eq!(status(&output), 1, "{definition}");
        assert!(stderr(&output).contains(words), "{definition}: {}", stderr(&output));
    }
    let twice = folder.run(&["check", "s.xml", "-D", "height=3", "-D", "height=4"]);
    assert_eq!(status(&twice), 1);
    assert!(stderr(&twice).contains("twice"));
}

#[test]
fn an_integrator_of_other_light_is_answered_with_one_line() {
    let folder = Folder::new("integrator");
    let with = |text: &str| SCENE.replace("<default", &format!("{text}<default"));
    folder.write("s.xml", with("<integrator type=\"direct\"/>"));
    folder.write("same.xml", with("<integrator type=\"path\"/>"));
    folder.write(
        "short.xml",
        with("<integrator type=\"path\"><integer name=\"max_depth\" value=\"1\"/></integrator>"),
    );
    let output = folder.run_with(&["probe", "s.xml", "--points", "-"], POINTS);
    assert_eq!(status(&output), 0);
    let said = stderr(&output);
    assert!(said.lines().count() == 1 && said.contains("integrator"), "{said}");
    let quiet = folder.run_with(&["probe", "s.xml", "--points", "-", "-q"], POINTS);
    assert!(stderr(&quiet).is_empty());
    assert_eq!(stdout(&quiet), stdout(&output));
    let same = folder.run_with(&["probe", "same.xml", "--points", "-"], POINTS);
    assert!(stderr(&same).is_empty());
    assert_eq!(stdout(&same), stdout(&output));
    // One edge is the way from a lamp straight to the receiver.
    let short = folder.run_with(&["probe", "short.xml", "--points", "-", "--json"], POINTS);
    assert_eq!(json(&short)["max_specular"], 0);
    assert_eq!(json(&short)["notices"].as_array().unwrap().len(), 1);
    let row = stdout(&short).lines().nth(1).unwrap().to_owned();
    let fields: Vec<f64> = row.split(',').skip(7).map(|f| f.parse().unwrap()).collect();
    assert!(fields[0] > 0.0 && fields[3..9] == [0.0; 6] && fields[9..12] == fields[0..3], "{row}");
}

#[test]
fn tables_of_every_kind() {
    let folder = Folder::new("tables");
    folder.write("a scene.xml", SCENE);
    let run = |table: &str, output: &str| {
        folder.run_with(&["probe", "a scene.xml", "--points", "-", "-o", output], table)
    };
    let plain = stdout(&run("x,y,z,nx,ny,nz\n0.5,0.25,0,0,0,1\n", "-"));
    let light = plain.lines().nth(1).unwrap().strip_prefix("0.5,0.25,0,0,0,1,").unwrap();
    // Any order, carried columns with quotes, commas and line ends, CRLF, no last line end.
    let text =
        stdout(&run("nz,\"a, b\",y,x,ny,nx,z\r\n2,\"the \"\"big\"\"\r\none\",0.25,0.5,0,0,0", "-"));
    let (header, row) = text.split_once('\n').unwrap();
    assert!(header.starts_with("nz,\"a, b\",y,x,ny,nx,z,direct_r,"), "{header}");
    assert_eq!(row, format!("2,\"the \"\"big\"\"\none\",0.25,0.5,0,0,0,{light}\n"));
    // A header alone is a table without rows.
    for output in ["-", "none.csv", "none.npz"] {
        assert_eq!(status(&run("x,y,z,nx,ny,nz\n", output)), 0, "{output}");
    }
    assert_eq!(fs::read_to_string(folder.0.join("none.csv")).unwrap().lines().count(), 1);
    folder.write("light.csv", "old");
    for (table, words) in [
        ("", "standard input:1:1"),
        ("x;y;z;nx;ny;nz\n", "separate them by commas"),
        ("x,y,z,nx,ny\n", "no column 'nz'"),
        ("x,y,z,nx,ny,nz\n0,NaN,0,0,0,1\n", "standard input:2:3"),
        ("x,y,z,nx,ny,nz\n0,0,0,0,0,inf\n", "standard input:2:11"),
        ("x,y,z,nx,ny,nz\n0,0,0,0,0,0\n", "normal nx,ny,nz is zero"),
    ] {
        let output = run(table, "light.csv");
        assert_eq!(status(&output), 1, "{table}");
        assert!(stderr(&output).contains(words), "{table}: {}", stderr(&output));
    }
    // A column with the name of an array stops a run before its work, not after.
    let clash = "x,y,z,nx,ny,nz,position\n0,0,0,0,0,1,here\n";
    let output = run(clash, "light.npz");
    assert_eq!(status(&output), 1);
    assert!(stderr(&output).contains("'position'") && stderr(&output).contains(".csv"));
    assert_eq!(status(&run(clash, "-")), 0);
    assert_eq!(fs::read(folder.0.join("light.csv")).unwrap(), b"old");
    assert_eq!(folder.names(), ["a scene.xml", "light.csv", "none.csv", "none.npz"]);
}

#[test]
fn places_that_cannot_be_written_are_found_before_the_work() {
    let folder = Folder::new("places");
    folder.write("s.xml", SCENE);
    fs::create_dir(folder.0.join("folder.csv")).unwrap();
    for (arguments, code, words) in [
        (&["probe", "s.xml", "--points", "-", "-o", "no/light.csv"][..], 1, "no folder 'no'"),
        (&["probe", "s.xml", "--points", "-", "-o", "folder.csv"], 1, "folder"),
        (&["probe", "s.xml", "--points", "-", "-o", "light"], 2, ".npz"),
        (&["render", "s.xml", "-o", "no/a.exr"], 1, "no folder 'no'"),
        (&["render", "s.xml", "-o", "-"], 2, ".exr"),
        (&["render", "s.xml", "-o", "picture"], 2, ".exr"),
        #[cfg(target_os = "linux")]
        (&["render", "s.xml", "-o", "/proc/a.exr"], 1, "-o"),
    ] {
        let output = folder.run_with(arguments, POINTS);
        assert_eq!(status(&output), code, "{arguments:?}");
        assert!(stderr(&output).contains(words), "{arguments:?}: {}", stderr(&output));
        assert!(stdout(&output).is_empty());
    }
    assert_eq!(folder.names(), ["folder.csv", "s.xml"]);
}

#[test]
fn what_is_read_is_not_written_over() {
    let folder = Folder::new("over");
    folder.write("s.xml", SCENE);
    folder.write("p.csv", POINTS);
    let output = folder.run(&["probe", "s.xml", "--points", "p.csv", "-o", "./p.csv"]);
    assert_eq!(status(&output), 2);
    assert!(stderr(&output).contains("the table of points 'p.csv'"), "{}", stderr(&output));
    assert_eq!(fs::read_to_string(folder.0.join("p.csv")).unwrap(), POINTS);
}

#[test]
fn photometric_units_are_named() {
    let folder = Folder::new("units");
    folder.write("s.xml", SCENE);
    let watts = stdout(&folder.run(&["check", "s.xml"]));
    assert!(watts.contains("314.1593 W, radiance [100.0, 100.0, 100.0] W/(m² sr)"), "{watts}");
    assert!(watts.contains("7.480e-5 W/m²"), "{watts}");
    let lumens = stdout(&folder.run(&["check", "s.xml", "--photometric"]));
    assert!(lumens.contains("radiance [68300.0, 68300.0, 68300.0] cd/m²"), "{lumens}");
    assert!(lumens.contains("5.109e-2 lx") && !lumens.contains('W'), "{lumens}");
    let error = |arguments: &[&str]| {
        json(&folder.run(&[&["render", "s.xml", "-o", "a.png", "--json"], arguments].concat()))
            ["largest_error"]
            .as_f64()
            .unwrap()
    };
    // (Radiances are scaled first, and sums of them rounded.)
    let ratio = error(&["--photometric"]) / error(&[]);
    assert!((ratio / 683.0 - 1.0).abs() < 1e-12, "{ratio}");
}
