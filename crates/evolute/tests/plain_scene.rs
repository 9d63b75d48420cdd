//! Scenes written again in plain Mitsuba 3 XML mean the same.
#![allow(clippy::unwrap_used, missing_docs)]

use std::fs;
use std::path::PathBuf;

use evolute::geometry::{Point3, Vector3};
use evolute::scene::{PlainScene, Scene, SceneDescription, load_str};

/// Every kind of value, object and nesting that needs no other file.
const INSIDE: &str = r#"
    <default name="r" value="0.25"/> <default name="bright" value="4, 3.5, 1e-3"/>
    <integrator type="path"><integer name="max_depth" value="12"/><boolean name="hide_emitters" value="true"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/> <string name="fov_axis" value="larger"/>
        <transform name="to_world"><lookat origin="0.1, -4, 1.5" target="0, 0, 0.3" up="0, 0, 1"/></transform>
        <film type="hdrfilm"><integer name="width" value="24"/><integer name="height" value="18"/>
            <rfilter type="tent"><float name="radius" value="1.5"/></rfilter></film>
    </sensor>
    <alias id="grey" as="gray"/>
    <shape type="rectangle" id="early"><ref id="gray"/></shape>
    <bsdf type="twosided" id="grey"><bsdf type="diffuse"><spectrum name="reflectance" value="400:0.2, 700:0.6"/></bsdf></bsdf>
    <shape type="sphere">
        <point name="center" x="1" y="2" z="-$r"/> <float name="radius" value="$r"/>
        <boolean name="flip_normals" value="true"/>
        <bsdf type="blendbsdf" id="a &lt;&amp;&quot;&#36;> glaze"><float name="weight" value="0.3"/>
            <ref id="grey"/> <bsdf type="conductor"><string name="material" value="Au"/></bsdf></bsdf>
    </shape>
    <shape type="cylinder"><point name="p1" value="0, 0, 2"/>
        <transform name="to_world"><rotate x="1" angle="30"/><scale value="$r"/></transform>
        <ref id="a &lt;&amp;&quot;&#36;> glaze"/></shape>
    <shape type="cube"><transform name="to_world"><scale x="-1" y="2" z="0.1"/><translate x="-3"/></transform>
        <bsdf type="dielectric"><string name="int_ior" value="bk7"/><float name="ext_ior" value="1"/></bsdf></shape>
    <shape type="disk" id="lamp"><transform name="to_world"><translate z="5"/></transform>
        <emitter type="area"><rgb name="radiance" value="$bright"/></emitter></shape>"#;

fn document(inside: &str) -> String {
    format!("<scene version=\"3.0.0\">{inside}</scene>")
}

/// Shapes, what they are made of, and what looks at them: to rounding of what transforms invert.
fn assert_same(a: &Scene, b: &Scene) {
    assert_eq!((a.shapes.len(), a.sensors.len()), (b.shapes.len(), b.sensors.len()));
    assert_eq!(a.max_depth, b.max_depth);
    for (a, b) in a.shapes.iter().zip(&b.shapes) {
        assert_eq!(a.id, b.id);
        assert_eq!(a.material, b.material, "{}", a.id);
        assert_eq!(a.radiance, b.radiance, "{}", a.id);
        let (p, q) = (a.surface.bounds(), b.surface.bounds());
        assert!((p.min - q.min).norm() + (p.max - q.max).norm() < 1e-12, "{}: {p:?} {q:?}", a.id);
        for (u, v) in [(0.2, 0.3), (0.7, 0.6), (0.45, 0.9)] {
            let point = a.surface.point(u, v);
            assert_eq!(point.is_some(), b.surface.point(u, v).is_some());
            let (Some(x), Some(y)) = (point, b.surface.point(u, v)) else { continue };
            let (p, q) = (a.surface.local(&x).unwrap(), b.surface.local(&y).unwrap());
            assert!((p.x - q.x).norm() < 1e-12, "{}", a.id);
            assert!((p.n.into_inner() - q.n.into_inner()).norm() < 1e-12, "{}", a.id);
        }
    }
    for (a, b) in a.sensors.iter().zip(&b.sensors) {
        assert_eq!((a.film, a.fov_x), (b.film, b.fov_x));
        for p in [Point3::origin(), Point3::new(1.0, -2.0, 3.0)] {
            assert!((a.world_from_camera.point(&p) - b.world_from_camera.point(&p)).norm() < 1e-12);
        }
    }
}

fn plain(text: &str, parameters: &[(String, String)]) -> (Scene, PlainScene) {
    let description = SceneDescription::from_text("test.xml", text, parameters).unwrap();
    (description.scene().unwrap().0, description.plain().unwrap())
}

#[test]
fn what_is_written_means_what_was_read() {
    for parameters in [vec![], vec![("r".to_string(), "0.5".to_string())]] {
        let (scene, written) = plain(&document(INSIDE), &parameters);
        assert_eq!(written.name, "test");
        assert!(written.surfaces.is_empty() && written.copies.is_empty());
        assert!(!written.text.contains('$'), "{}", written.text);
        let again = load_str("test.xml", &written.text, &[]).unwrap_or_else(|e| panic!("{e}"));
        assert_same(&scene, &again.scene);
        // Once written, always the same.
        assert_eq!(plain(&written.text, &[]).1.text, written.text);
    }
}

/// Formulas become `ply`, with what they are made of, and without their transform: the mesh has it.
#[test]
fn formulas_become_meshes() {
    let shape = |id: &str, more: &str| {
        format!(
            r#"<shape type="parametric" {id}> <float name="w" value="2"/> <string name="x" value="w*s"/>
            <string name="y" value="t"/> <string name="z" value="s*t"/> {more} </shape>"#
        )
    };
    let turned = r#"<transform name="to_world"><rotate x="1" angle="90"/></transform>
        <boolean name="flip_normals" value="true"/> <bsdf type="dielectric"/>"#;
    let lamp = r#"<emitter type="area"><rgb name="radiance" value="3"/></emitter>"#;
    let text = document(&format!(
        r#"<shape type="sphere"/>{}{}{}"#,
        shape("id=\"Lens/1\"", turned),
        shape("id=\"lens 1\"", ""),
        shape("", lamp)
    ));
    let (scene, written) = plain(&text, &[]);
    let files: Vec<&str> = written.surfaces.iter().map(|s| s.file.as_str()).collect();
    assert_eq!(files, ["Lens_1.ply", "lens_1_2.ply", "shape_4.ply"]);
    for (surface, number) in written.surfaces.iter().zip(1..) {
        assert_eq!(surface.shape.0, number);
        assert!(matches!(
            scene.shape(surface.shape).surface,
            evolute::surface::Surface::Parametric(_)
        ));
        assert!(written.text.contains(&format!("value=\"{}\"", surface.file)));
    }
    for gone in ["parametric", "transform", "flip_normals", "name=\"w\"", "name=\"x\""] {
        assert!(!written.text.contains(gone), "{gone}: {}", written.text);
    }
    for kept in ["<bsdf type=\"dielectric\"/>", "<emitter type=\"area\">", "id=\"Lens/1\""] {
        assert!(written.text.contains(kept), "{kept}: {}", written.text);
    }
}

/// Included files become part of the text, and mesh files are found wherever they lie.
#[test]
fn files_are_gathered() {
    let folder = std::env::temp_dir().join(format!("evolute-plain-{}", std::process::id()));
    let put = |name: &str, text: &str| {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    let obj = |z: f64| format!("v 0 0 {z}\nv 1 0 {z}\nv 0 1 {z}\nf 1 2 3\n");
    put("parts/mesh.obj", &obj(1.0));
    put("other/mesh.obj", &obj(2.0));
    put("table.spd", "400 0.25\n700 0.5\n");
    let of = |file: &str| {
        format!(r#"<shape type="obj"><string name="filename" value="{file}"/></shape>"#)
    };
    put("parts/part.xml", &document(&of("mesh.obj")));
    put(
        "scene.xml",
        &document(&format!(
            r#"<path value="other"/><include filename="parts/part.xml"/>{}{}
            <bsdf type="diffuse"><spectrum name="reflectance" filename="table.spd"/></bsdf>"#,
            of("mesh.obj"),
            of("parts/mesh.obj"),
        )),
    );
    let description = SceneDescription::from_file(folder.join("scene.xml"), &[]).unwrap();
    let (scene, _) = description.scene().unwrap();
    let written = description.plain().unwrap();
    let copies: Vec<(PathBuf, &str)> =
        written.copies.iter().map(|c| (c.from.clone(), c.file.as_str())).collect();
    let from = |name: &str| folder.join(name);
    assert_eq!(
        copies,
        [(from("parts/mesh.obj"), "mesh.obj"), (from("other/mesh.obj"), "mesh_2.obj")]
    );
    assert!(written.text.contains("400.0:0.25, 700.0:0.5"), "{}", written.text);
    assert_eq!(written.text.matches("value=\"mesh.obj\"").count(), 2);
    // Beside the copies, the text makes the same scene.
    fs::create_dir(folder.join("new")).unwrap();
    for copy in &written.copies {
        fs::copy(&copy.from, folder.join("new").join(&copy.file)).unwrap();
    }
    put("new/scene.xml", &written.text);
    let again = SceneDescription::from_file(folder.join("new/scene.xml"), &[]).unwrap();
    let again = again.scene().unwrap().0;
    let heights = |s: &Scene| -> Vec<Vector3> {
        s.shapes.iter().map(|s| s.surface.bounds().min.coords).collect()
    };
    assert_eq!(heights(&again), heights(&scene));
    for (height, expected) in heights(&again).iter().zip([1.0, 2.0, 1.0]) {
        assert!((height.z - expected).abs() < 1e-12, "{height}");
    }
    fs::remove_dir_all(&folder).unwrap();
}
