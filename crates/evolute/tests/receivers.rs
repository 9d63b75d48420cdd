//! Meshes of receivers over every kind of surface.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

use std::sync::LazyLock;

use evolute::geometry::{Point3, Vector3};
use evolute::receiver::TriangleMesh;
use evolute::scene::load_str;
use evolute::surface::{Mesh, Surface};
use proptest::prelude::*;

/// The only shape of a scene.
fn surface(shape: &str) -> Surface {
    let text = format!("<scene version=\"3.0.0\">{shape}</scene>");
    load_str("test.xml", &text, &[]).unwrap().scene.shapes[0].surface.clone()
}

fn formula(x: &str, y: &str, z: &str) -> Surface {
    surface(&format!(
        r#"<shape type="parametric"> <string name="x" value="{x}"/> <string name="y" value="{y}"/>
        <string name="z" value="{z}"/> <bsdf type="diffuse"/> </shape>"#
    ))
}

/// An octahedron with each face in four, and the normals of the sphere around it.
fn octahedron() -> Surface {
    let axes = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
    let mut points: Vec<Vector3> = axes.iter().map(|a| Vector3::from(a.map(f64::from))).collect();
    let mut triangles = Vec::new();
    for corners in (0..8).map(|i| [i & 1, 2 + (i >> 1 & 1), 4 + (i >> 2)]) {
        let [a, b, c] = corners.map(|v: usize| points[v]);
        let [a, b, c] = if a.cross(&b).dot(&c) > 0.0 { [a, b, c] } else { [a, c, b] };
        let mut number = |p: Vector3| {
            let p = p.normalize();
            let known = points.iter().position(|q| (p - q).norm() < 1e-9);
            known.unwrap_or_else(|| {
                points.push(p);
                points.len() - 1
            }) as u32
        };
        let [d, e, f] = [number(a + b), number(b + c), number(c + a)];
        let [a, b, c] = [number(a), number(b), number(c)];
        triangles.extend([[a, d, f], [d, b, e], [f, e, c], [d, e, f]]);
    }
    let positions = points.iter().map(|p| Point3::from(*p)).collect();
    Surface::Mesh(Mesh::new(positions, triangles, Some(points), None).unwrap())
}

/// Every kind, with seams, poles, creases.
static SURFACES: LazyLock<Vec<(&str, Surface)>> = LazyLock::new(|| {
    let turned = r#"<transform name="to_world"><scale x="2" y="1.5" z="1"/><rotate y="1" angle="30"/></transform>"#;
    let shape = |kind: &str| surface(&format!(r#"<shape type="{kind}">{turned}</shape>"#));
    vec![
        ("rectangle", shape("rectangle")),
        ("disk", shape("disk")),
        ("cube", shape("cube")),
        ("sphere", surface(r#"<shape type="sphere"><float name="radius" value="0.7"/></shape>"#)),
        (
            "cylinder",
            surface(r#"<shape type="cylinder"><float name="radius" value="0.4"/></shape>"#),
        ),
        ("octahedron", octahedron()),
        ("wave", formula("2*s-1", "2*t-1", ".1*cos(9*s)*cos(9*t)")),
        (
            "torus",
            formula(
                "(1+.3*cos(2*pi*t))*cos(2*pi*s)",
                "(1+.3*cos(2*pi*t))*sin(2*pi*s)",
                ".3*sin(2*pi*t)",
            ),
        ),
        ("cone", formula("t*cos(2*pi*s)", "t*sin(2*pi*s)", "t")),
        ("ball", formula("sin(pi*t)*cos(2*pi*s)", "sin(pi*t)*sin(2*pi*s)", "cos(pi*t)")),
    ]
});

#[test]
fn first_triangles_are_even_and_cover_the_surface() {
    for (name, surface) in SURFACES.iter() {
        let edge = 0.2;
        let mesh = TriangleMesh::new(surface, edge);
        mesh.validate().unwrap_or_else(|e| panic!("{name}: {e}"));
        let mut areas = Vec::new();
        for t in mesh.triangles() {
            assert!(mesh.longest_edge(t).1 <= 1.5 * edge, "{name}");
            areas.push(mesh.weights(t).iter().sum::<f64>());
        }
        areas.sort_by(f64::total_cmp);
        let median = areas[areas.len() / 2];
        // Triangles at a pole are narrow.
        let share = areas.iter().filter(|a| (0.3..3.0).contains(&(*a / median))).count();
        println!(
            "{name}: {} triangles, {} vertices, median {median:.4} m²",
            areas.len(),
            mesh.vertices().len()
        );
        assert!(share as f64 > 0.8 * areas.len() as f64, "{name}: {share} of {}", areas.len());
    }
}

/// Vertices − edges + triangles of surfaces without a border are 2 (1 − handles).
#[test]
fn seams_and_poles_are_closed() {
    for (name, surface) in SURFACES.iter() {
        let mesh = TriangleMesh::new(surface, 0.3);
        let triangles = mesh.triangles().count() as i64;
        // An edge that is one point, at a pole, is none.
        let sides = mesh.triangles().flat_map(|t| {
            let [a, b, c] = mesh.corners(t);
            [a != b, b != c, c != a]
        });
        let edges = sides.filter(|&is_edge| is_edge).count() as i64 / 2;
        let euler = mesh.vertices().len() as i64 - edges + triangles;
        let expected = match *name {
            "sphere" | "octahedron" | "ball" => 2,
            "torus" => 0,
            _ => continue,
        };
        assert_eq!(euler, expected, "{name}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Cut anywhere, a mesh stays whole; every point of the surface is found in the triangle that has it.
    #[test]
    fn cut_anywhere(which in 0usize..10,
                    cuts in prop::collection::vec((any::<prop::sample::Index>(), 0usize..3, 0.1f64..0.9), 1..60),
                    points in prop::collection::vec((0.0f64..1.0, 0.0f64..1.0, any::<prop::sample::Index>()), 20)) {
        let (name, surface) = &SURFACES[which];
        let mut mesh = TriangleMesh::new(surface, 0.5);
        for (index, edge, fraction) in &cuts {
            let all: Vec<u32> = mesh.triangles().collect();
            mesh.cut(all[index.index(all.len())], *edge, *fraction);
        }
        mesh.validate().map_err(|e| TestCaseError::fail(format!("{name}: {e}")))?;
        let all: Vec<u32> = mesh.triangles().collect();
        for (p, q, index) in &points {
            // A point of a triangle, by weights.
            let (p, q) = if p + q > 1.0 { (1.0 - p, 1.0 - q) } else { (*p, *q) };
            let t = all[index.index(all.len())];
            let weights = [1.0 - p - q, p, q];
            let site = mesh.at(t, weights);
            let on = surface.at_chart(&site);
            let back = surface.chart_point(&on);
            let place = mesh.locate(&back);
            if weights.iter().all(|w| *w > 1e-6) && place.triangle != t {
                // Slivers of no area are as well as not there.
                let area: f64 = mesh.weights(t).iter().sum();
                prop_assert!(area < 1e-9, "{name}: {t} {weights:?} is found in {place:?}");
            }
            let found = surface.at_chart(&mesh.at(place.triangle, place.weights));
            prop_assert!((found.x - on.x).norm() < 1e-9, "{name}: {} and {}", found.x, on.x);
        }
    }
}
