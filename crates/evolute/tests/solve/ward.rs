//! The room of Ward, Rubinstein and Clear (1988), and the same with walls that are mirrors: `cases/ward_room`.

use evolute::trace::Tracer;
use evolute::transfer::HemisphereSettings;

use crate::cases::{load, path};
use crate::common::receiver;
use crate::{settings, solved};

/// A point of the ceiling [m] and its radiosity [W/m²].
struct Answer {
    point: [f64; 2],
    radiosity: f64,
    standard_error: f64,
}

/// What `ceiling.csv` says of one of the rooms.
fn answers(room: &str) -> Vec<Answer> {
    let text = std::fs::read_to_string(path("ward_room", "ceiling.csv")).unwrap();
    let rows = text.lines().filter_map(|line| line.strip_prefix(room)?.strip_prefix(','));
    rows.map(|row| {
        let f: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
        Answer { point: [f[0], f[1]], radiosity: f[2], standard_error: f[3] }
    })
    .collect()
}

/// Holds a room with some walls as mirrors against its answers, to a part of them.
fn check(room: &str, mirrors: &[&str], edge: Option<f64>, tolerance: f64) {
    let parameters: Vec<_> = mirrors.iter().map(|wall| (*wall, "mirror")).collect();
    let scene = load("ward_room", &parameters);
    let tracer = Tracer::new(&scene);
    let solver = solved(&scene, &tracer, &settings(1e-2, edge));
    let answers = answers(room);
    assert_eq!(answers.len(), 5, "{room}");
    for Answer { point: [x, y], radiosity, standard_error } in answers {
        assert!(standard_error <= 0.003 * radiosity);
        let settings = HemisphereSettings {
            limits: solver.limits(),
            tolerance: 1e-3 * radiosity,
            max_samples: 100_000,
        };
        let at = receiver([x, y, 3.0], [0.0, 0.0, -1.0]);
        let gathered = solver.solution().gather(&tracer, &at, &settings);
        let own = 0.7 * gathered.irradiance[0];
        let off = own / radiosity - 1.0;
        println!(
            "{room} ({x}, {y}): {own:.5}, {radiosity:.5} ± {:.2} % expected: {:+.2} %; {} rays",
            100.0 * standard_error / radiosity,
            100.0 * off,
            gathered.rays
        );
        assert!(off.abs() < tolerance);
    }
}

#[test]
fn room_of_ward() {
    check("published", &[], None, 0.01);
    check("none", &[], None, 0.01);
}

#[test]
fn a_wall_is_a_mirror() {
    check("one", &["west"], None, 0.015);
}

#[test]
fn two_adjacent_walls_are_mirrors() {
    check("adjacent", &["west", "south"], None, 0.015);
}

/// Light goes to and fro between the two, so that receivers are dear.
#[test]
fn two_facing_walls_are_mirrors() {
    check("facing", &["south", "north"], None, 0.015);
}
