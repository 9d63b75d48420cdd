//! Surfaces as triangles: closed, even, on the surface, facing the right way; through a file and back.
#![allow(clippy::unwrap_used, missing_docs)]

use std::collections::BTreeMap;
use std::f64::consts::PI;

use evolute::geometry::{Point3, Vector3};
use evolute::output::{PlyMesh, encode_ply};
use evolute::receiver::Tessellation;
use evolute::scene::{load_file, load_str};
use evolute::surface::Surface;

/// A surface by formulas, with more inside its shape.
fn formula([x, y, z]: [&str; 3], more: &str) -> Surface {
    let text = format!(
        r#"<scene version="3.0.0"><shape type="parametric"> <string name="x" value="{x}"/>
        <string name="y" value="{y}"/> <string name="z" value="{z}"/> {more} </shape></scene>"#
    );
    load_str("test.xml", &text, &[]).unwrap().scene.shapes[0].surface.clone()
}

const SPHERE: [&str; 3] = ["sin(pi*t)*cos(2*pi*s)", "sin(pi*t)*sin(2*pi*s)", "-cos(pi*t)"];
const TORUS: [&str; 3] =
    ["(1+0.4*cos(2*pi*t))*cos(2*pi*s)", "(1+0.4*cos(2*pi*t))*sin(2*pi*s)", "0.4*sin(2*pi*t)"];
const DISH: [&str; 3] = ["s-0.5", "1.5*t", "0.3*(s-0.5)^2+0.2*t^2"];
const CONE: [&str; 3] = ["t*cos(2*pi*s)", "t*sin(2*pi*s)", "2*t"];
/// A dish whose parameters run ten times as fast at one end as at the other.
const UNEVEN: [&str; 3] = ["s", "t+4.5*t^2", "0.1*s^2"];

/// How often each edge occurs in each direction, by the bits of its ends' positions.
fn edges(t: &Tessellation) -> BTreeMap<[[u64; 3]; 2], [u32; 2]> {
    let mut edges = BTreeMap::new();
    for triangle in &t.triangles {
        let ends = triangle.map(|v| t.positions[v as usize].coords.map(f64::to_bits).into());
        for i in 0..3 {
            let [a, b]: [[u64; 3]; 2] = [ends[i], ends[(i + 1) % 3]];
            let counts: &mut [u32; 2] = edges.entry([a.min(b), a.max(b)]).or_default();
            counts[usize::from(a > b)] += 1;
        }
    }
    edges
}

/// Twice the vector of each triangle's area.
fn area_vectors(t: &Tessellation) -> Vec<Vector3> {
    let corners = |v: &[u32; 3]| v.map(|v| t.positions[v as usize]);
    let across = |[a, b, c]: [Point3; 3]| (b - a).cross(&(c - a));
    t.triangles.iter().map(|v| across(corners(v))).collect()
}

/// Closed surfaces have no border though they have seams and poles; others one line around.
#[test]
fn borders_are_watertight() {
    for (name, formulas, holes) in
        [("sphere", SPHERE, 0), ("torus", TORUS, 0), ("dish", DISH, 1), ("cone", CONE, 1)]
    {
        let surface = formula(formulas, "");
        for count in [50, 3000] {
            let t = Tessellation::new(&surface, count);
            assert!(t.triangles.len() >= count, "{name}: {}", t.triangles.len());
            assert!(t.triangles.len() < 3 * count, "{name}: {}", t.triangles.len());
            let mut open = 0;
            for counts in edges(&t).values() {
                match counts {
                    [1, 1] => {}
                    [1, 0] | [0, 1] => open += 1,
                    _ => panic!("{name}: an edge with {counts:?} triangles"),
                }
            }
            assert_eq!(open > 0, holes > 0, "{name}: {open} open edges");
            // A border of n edges around m triangles: far fewer.
            assert!(open * open < 40 * t.triangles.len(), "{name}: {open} open edges");
        }
    }
}

#[test]
fn triangles_are_even_and_on_the_surface() {
    for (name, formulas, accuracy) in [
        ("sphere", SPHERE, 3e-3),
        ("torus", TORUS, 3e-3),
        ("dish", DISH, 1e-3),
        ("uneven", UNEVEN, 1e-3),
    ] {
        let surface = formula(formulas, "");
        let t = Tessellation::new(&surface, 4000);
        let vectors = area_vectors(&t);
        let area: f64 = vectors.iter().map(|v| 0.5 * v.norm()).sum();
        assert!((area / surface.area() - 1.0).abs() < accuracy, "{name}: {area}");
        let largest = vectors.iter().map(|v| 0.5 * v.norm()).fold(0.0, f64::max);
        assert!(largest < 4.0 * surface.area() / 4000.0, "{name}: {largest}");
        for (x, [p, q]) in t.positions.iter().zip(&t.coordinates) {
            let here = surface.point(*p, *q).unwrap().x;
            assert!((x - here).norm() < 1e-13, "{name}: {x} is not {here}");
        }
    }
}

/// Normals are the surface's, and triangles turn round them, however fronts were turned.
#[test]
fn fronts_are_the_surface_s() {
    let mirrored = r#"<transform name="to_world"><scale x="-2"/><translate y="1"/></transform>"#;
    let flipped = r#"<boolean name="flip_normals" value="true"/>"#;
    let both = format!("{mirrored}{flipped}");
    for more in ["", mirrored, flipped, &both] {
        let surface = formula(DISH, more);
        let t = Tessellation::new(&surface, 500);
        for (triangle, across) in t.triangles.iter().zip(area_vectors(&t)) {
            for v in triangle.map(|v| v as usize) {
                let [p, q] = t.coordinates[v];
                let expected = surface.local(&surface.point(p, q).unwrap()).unwrap().n;
                assert!((t.normals[v] - expected.into_inner()).norm() < 1e-12, "{more}");
                assert!(across.normalize().dot(&t.normals[v]) > 0.99, "{more}");
            }
        }
    }
}

/// A sphere's poles have a normal, a cone's tip has none: there it is that of the side next to it.
#[test]
fn poles_and_tips_have_normals() {
    let t = Tessellation::new(&formula(SPHERE, ""), 2000);
    for (x, n) in t.positions.iter().zip(&t.normals) {
        assert!((n - x.coords).norm() < 1e-7, "{x}: {n}");
    }
    let t = Tessellation::new(&formula(CONE, ""), 2000);
    let mut tips = 0;
    for ((x, n), [s, _]) in t.positions.iter().zip(&t.normals).zip(&t.coordinates) {
        // x_s × x_t points out and down.
        let (sin, cos) = (2.0 * PI * s).sin_cos();
        let expected = Vector3::new(2.0 * cos, 2.0 * sin, -1.0).normalize();
        let tip = x.coords.norm() < 1e-9;
        tips += usize::from(tip);
        // Between two neighbours at the tip.
        let allowed = if tip { 0.15 } else { 1e-9 };
        assert!((n - expected).norm() < allowed, "{x}: {n} is not {expected}");
    }
    assert!(tips > 10);
}

/// The file says in single precision what was written, and our reader takes it.
#[test]
fn a_ply_file_reads_back() {
    let surface = formula(TORUS, "");
    let made = Tessellation::new(&surface, 700);
    let bytes = encode_ply(&PlyMesh {
        positions: &made.positions,
        normals: &made.normals,
        texcoords: &made.coordinates,
        triangles: &made.triangles,
    })
    .unwrap();
    let folder = std::env::temp_dir().join(format!("evolute-ply-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("torus.ply"), &bytes).unwrap();
    let scene = r#"<scene version="3.0.0"><shape type="ply">
        <string name="filename" value="torus.ply"/></shape></scene>"#;
    std::fs::write(folder.join("scene.xml"), scene).unwrap();
    let read = load_file(folder.join("scene.xml"), &[]).unwrap().scene.shapes.remove(0).surface;
    std::fs::remove_dir_all(&folder).unwrap();
    let Surface::Mesh(mesh) = &read else { panic!("no mesh") };
    assert_eq!(mesh.triangles(), made.triangles);
    let near = |a: f64, b: f64| (a - b).abs() <= 6e-8 * b.abs().max(1e-3);
    let (normals, texcoords) = (mesh.normals().unwrap(), mesh.texcoords().unwrap());
    for i in 0..made.positions.len() {
        let pairs = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| near(*a, *b));
        assert!(pairs(mesh.positions()[i].coords.as_slice(), made.positions[i].coords.as_slice()));
        assert!(pairs(normals[i].as_slice(), made.normals[i].as_slice()));
        assert!(pairs(&texcoords[i], &made.coordinates[i]));
    }
}
