//! Scenes that are right: what their text means, with Mitsuba 3.9.1's answers to the same text where
//! it has any (variant scalar_rgb; single precision, so to six digits).
#![allow(clippy::unwrap_used, missing_docs)]

use std::f64::consts::PI;

use evolute::geometry::{Point3, Rgb, Transform, Vector3};
use evolute::scene::{
    Loaded, Material, Mirror, ReconstructionFilter, SideMaterial, load_file, load_str,
};
use evolute::surface::{MeshSmoothing, Surface};

/// A scene with this inside.
fn load(inside: &str) -> Loaded {
    let text = format!("<scene version=\"3.0.0\">{inside}</scene>");
    load_str("test.xml", &text, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// A flat surface that folds over itself, and whose middle lies on a fold: area elements change
/// sign along lines all over the domain. ∫ |sin| and ∫ |cos| over half periods are 2/π of their width.
#[test]
fn a_folded_surface_loads_and_has_its_area() {
    let start = std::time::Instant::now();
    let loaded = load(
        "<shape type=\"parametric\">
           <string name=\"x\" value=\"0*s\"/>
           <string name=\"y\" value=\"-5*cos(3*pi*(s-0.5))*cos(3*pi*(t-0.5))\"/>
           <string name=\"z\" value=\"100*(0.5-t)\"/>
         </shape>",
    );
    let area = loaded.scene.shapes[0].surface.area();
    let exact = 5.0 * 3.0 * PI * 100.0 * (2.0 / PI) * (2.0 / PI);
    assert!((area / exact - 1.0).abs() < 1e-4, "{area}, not {exact}");
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}

/// The only shape of a scene with this shape inside.
fn surface(shape: &str) -> Surface {
    load(shape).scene.shapes.remove(0).surface
}

/// The message that refuses a scene with this inside.
fn refused(inside: &str) -> String {
    let text = format!("<scene version=\"3.0.0\">\n{inside}\n</scene>");
    match load_str("test.xml", &text, &[]) {
        Ok(_) => panic!("accepted: {inside}"),
        Err(error) => error.to_string(),
    }
}

fn given(name: &str, value: &str) -> Vec<(String, String)> {
    vec![(name.to_string(), value.to_string())]
}

/// The point at uv = (.75, .9) of a rectangle and its shading normal there.
#[test]
fn transforms_are_mitsuba_s() {
    for (steps, x, n) in [
        (
            r#"<translate x="1" y="2" z="3"/><scale x="2" y="3" z="4"/>"#,
            [3.0, 8.4, 12.0],
            [0.0, 0.0, 1.0],
        ),
        (
            r#"<rotate x="1" angle="30"/><rotate y="1" angle="40"/>"#,
            [0.6401373, 0.6928203, -0.01497606],
            [0.5566704, -0.5, 0.6634139],
        ),
        (
            r#"<rotate value="0.267261,0.534522,0.801784" angle="50"/><translate value="1,0,-1"/>"#,
            [0.8836139, 0.9284947, -0.8802013],
            [0.4860131, -0.05164287, 0.8724244],
        ),
        (
            r#"<lookat origin="1,2,3" target="4,3,5" up="0,1,0"/>"#,
            [1.09945, 2.770899, 2.465375],
            [0.8017837, 0.2672612, 0.5345225],
        ),
        (
            r#"<scale x="0.2" y="0.1" z="1"/><lookat origin="-1.2, 2.1, 1.4" target="0.2, 0.1, -0.2" up="0, 1, 0"/>"#,
            [-1.239162, 2.158269, 1.292897],
            [0.4796322, -0.6851888, -0.548151],
        ),
        (
            r#"<matrix value="1 2 0 5 0 2 0 6 0 1 1 7 0 0 0 1"/><scale value="2"/>"#,
            [14.2, 15.2, 15.6],
            [0.0, -0.4472136, 0.8944272],
        ),
        (r#"<matrix value="0 1 0 1 0 0 0 0 2"/>"#, [0.8, 0.5, 0.0], [0.0, 0.0, 1.0]),
        (
            r#"<lookat origin="0,0,0" target="1,2,3"/>"#,
            [0.8079286, -0.4841427, 0.05345226],
            [0.2672612, 0.5345225, 0.8017837],
        ),
    ] {
        let surface = surface(&format!(
            "<shape type=\"rectangle\"><transform name=\"to_world\">{steps}</transform></shape>"
        ));
        let point = surface.point(0.75, 0.9).unwrap();
        let normal = surface.local(&point).unwrap().n;
        assert!((point.x - Point3::from(x)).norm() < 2e-6 * 20.0, "{steps}: {:?}", point.x);
        assert!((normal.into_inner() - Vector3::from(n)).norm() < 1e-6, "{steps}: {normal:?}");
    }
}

#[test]
fn a_floor_turned_by_quarter_turns_is_exactly_level() {
    let floor = surface(
        "<shape type=\"rectangle\"><transform name=\"to_world\">
           <scale x=\"2\" y=\"2\" z=\"1\"/><rotate x=\"1\" angle=\"-90\"/></transform></shape>",
    );
    let point = floor.point(0.3, 0.9).unwrap();
    assert_eq!(point.x.y, 0.0);
    assert_eq!(floor.local(&point).unwrap().n.into_inner(), Vector3::y());
}

#[test]
fn points_are_given_in_every_way_that_mitsuba_takes() {
    let centre =
        |point: &str| surface(&format!("<shape type=\"sphere\">{point}</shape>")).bounds().centre();
    let (a, b) = (Point3::new(1.0, 2.0, 3.0), Point3::new(1.0, 1.0, 1.0));
    for (point, expected) in [
        ("<point name=\"center\" x=\"1\" y=\"2\" z=\"3\"/>", a),
        ("<point name=\"center\" value=\" 1, 2 3 \"/>", a),
        ("<vector name=\"center\" value=\"1 2,3\"/>", a),
        ("<point name=\"center\" value=\"1\"/>", b),
    ] {
        assert!((centre(point) - expected).norm() < 1e-12, "{point}");
    }
    for point in ["x=\"1\"", "value=\"1\" x=\"2\"", "value=\"1,2\"", "", "x=\"1\" y=\"2\" z=\"\""] {
        refused(&format!("<shape type=\"sphere\"><point name=\"center\" {point}/></shape>"));
    }
}

/// Horizontal field of view [degrees] for fov = 40 and each axis, on a wide and on a high film.
#[test]
fn fields_of_view_are_mitsuba_s() {
    let fov_x = |inside: &str, width: u32, height: u32| {
        let scene = load(&format!(
            "<sensor type=\"perspective\">{inside}<film type=\"hdrfilm\">
               <integer name=\"width\" value=\"{width}\"/><integer name=\"height\" value=\"{height}\"/>
             </film></sensor>"
        ));
        scene.scene.sensors[0].fov_x.to_degrees()
    };
    for (axis, wide, high) in [
        ("x", 40.0, 40.0),
        ("y", 72.10477447509766, 20.628210067749023),
        ("diagonal", 36.064788818359375, 18.49018669128418),
        ("smaller", 72.10477447509766, 40.0),
        ("larger", 40.0, 20.628210067749023),
    ] {
        let inside = format!(
            "<float name=\"fov\" value=\"40\"/><string name=\"fov_axis\" value=\"{axis}\"/>"
        );
        assert!((fov_x(&inside, 200, 100) - wide).abs() < 1e-5, "{axis}");
        assert!((fov_x(&inside, 100, 200) - high).abs() < 1e-5, "{axis}");
    }
    assert!((fov_x("", 768, 576) - 38.1848).abs() < 1e-4, "50 mm");
    let default = fov_x("<string name=\"focal_length\" value=\"50mm\"/>", 768, 576);
    assert_eq!(fov_x("", 768, 576), default);
    let short = fov_x("<string name=\"focal_length\" value=\"35 mm\"/>", 768, 576);
    assert_eq!(fov_x("<string name=\"focal_length\" value=\"35\"/>", 768, 576), short);
    assert!(short > default);
}

#[test]
fn a_sensor_without_anything_has_mitsuba_s_defaults() {
    let sensor = load("<sensor type=\"perspective\"/>").scene.sensors.remove(0);
    assert_eq!((sensor.near_clip, sensor.far_clip), (1e-2, 1e4));
    assert_eq!((sensor.film.width, sensor.film.height), (768, 576));
    assert_eq!(sensor.film.filter, ReconstructionFilter::Gaussian { stddev: 0.5 });
    assert_eq!(sensor.principal_point_offset, [0.0, 0.0]);
    assert_eq!(sensor.world_from_camera, Transform::identity());
    for (filter, expected) in [
        ("<rfilter type=\"box\"/>", ReconstructionFilter::Box),
        ("<rfilter type=\"tent\"/>", ReconstructionFilter::Tent { radius: 1.0 }),
        (
            "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.7\"/></rfilter>",
            ReconstructionFilter::Gaussian { stddev: 0.7 },
        ),
    ] {
        let loaded = load(&format!(
            "<sensor type=\"perspective\"><film type=\"hdrfilm\">{filter}</film></sensor>"
        ));
        assert_eq!(loaded.scene.sensors[0].film.filter, expected);
    }
    let loaded = load(
        "<sensor type=\"perspective\"><film type=\"hdrfilm\"><rfilter type=\"mitchell\"/></film></sensor>",
    );
    assert!(loaded.notices.iter().any(|n| n.contains("mitchell")));
}

#[test]
fn parameters_act_from_their_line_on_and_the_command_line_goes_before() {
    let radius = |inside: &str, parameters: &[(String, String)]| {
        let text = format!("<scene version=\"3.0.0\">{inside}</scene>");
        let scene = load_str("test.xml", &text, parameters).unwrap().scene;
        scene.shapes[0].surface.bounds().extent().x / 2.0
    };
    let sphere = |value: &str| {
        format!("<shape type=\"sphere\"><float name=\"radius\" value=\"{value}\"/></shape>")
    };
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
    let two = "<default name=\"r\" value=\"2\"/>";
    near(radius(&format!("{two}{}", sphere("$r")), &[]), 2.0);
    near(radius(&format!("{two}{}", sphere("$r")), &given("r", "7")), 7.0);
    near(radius(&format!("{two}<default name=\"r\" value=\"3\"/>{}", sphere("$r")), &[]), 2.0);
    near(radius(&format!("{two}<default name=\"rr\" value=\"3\"/>{}", sphere("$rr")), &[]), 3.0);
    near(radius(&format!("{two}<default name=\"q\" value=\"1$r\"/>{}", sphere("$q")), &[]), 12.0);
    near(radius(&format!("{two}{}", sphere("$r.5")), &[]), 2.5);
    let inside = "<shape type=\"sphere\"><default name=\"r\" value=\"3\"/><float name=\"radius\" value=\"$r\"/></shape>";
    near(radius(inside, &[]), 3.0);
    near(radius("<default name=\"t\" value=\"sphere\"/><shape type=\"$t\"/>", &[]), 1.0);
    assert!(refused(&format!("{}{two}", sphere("$r"))).contains("\"$r\" has no value"));
    let unused = load_str("a.xml", "<scene version=\"3.0.0\"/>", &given("x", "1")).unwrap_err();
    assert!(unused.to_string().contains("does not use the parameter \"x\""), "{unused}");
    assert!(unused.location().is_none());
}

#[test]
fn references_go_both_ways_and_through_aliases() {
    let diffuse =
        "<bsdf type=\"diffuse\" id=\"b\"><float name=\"reflectance\" value=\"0.25\"/></bsdf>";
    for inside in [
        format!("{diffuse}<shape type=\"sphere\"><ref id=\"b\"/></shape>"),
        format!("<shape type=\"sphere\"><ref name=\"bsdf\" id=\"b\"/></shape>{diffuse}"),
        format!(
            "{diffuse}<alias id=\"b\" as=\"c\"/><shape type=\"sphere\"><ref id=\"c\"/></shape>"
        ),
        format!(
            "<shape type=\"sphere\">{diffuse}</shape><shape type=\"disk\"><ref id=\"b\"/></shape>"
        ),
    ] {
        for shape in load(&inside).scene.shapes {
            assert_eq!(shape.material.front.diffuse, Rgb::grey(0.25), "{inside}");
        }
    }
}

/// A material by its bsdf.
fn material(bsdf: &str) -> Material {
    load(&format!("<shape type=\"rectangle\">{bsdf}</shape>")).scene.shapes[0].material
}

const NOTHING: SideMaterial = SideMaterial { diffuse: Rgb::BLACK, mirror: None };
const PERFECT: SideMaterial = SideMaterial {
    diffuse: Rgb::BLACK,
    mirror: Some(Mirror { weight: Rgb::WHITE, conductor: None }),
};

fn diffuse(reflectance: f64) -> SideMaterial {
    SideMaterial { diffuse: Rgb::grey(reflectance), mirror: None }
}

#[test]
fn sides_of_materials_are_mitsuba_s() {
    let d = |value: &str| {
        format!("<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"{value}\"/></bsdf>")
    };
    let both = |front, back| Material { front, back, dielectric: None };
    for (bsdf, expected) in [
        (String::new(), both(diffuse(0.5), NOTHING)),
        ("<emitter type=\"area\"/>".into(), both(NOTHING, NOTHING)),
        ("<bsdf type=\"diffuse\"/><emitter type=\"area\"/>".into(), both(diffuse(0.5), NOTHING)),
        (d("0.1"), both(diffuse(0.1), NOTHING)),
        ("<bsdf type=\"conductor\"/>".into(), both(PERFECT, NOTHING)),
        (
            "<bsdf type=\"conductor\"><string name=\"material\" value=\"none\"/></bsdf>".into(),
            both(PERFECT, NOTHING),
        ),
        (format!("<bsdf type=\"twosided\">{}</bsdf>", d("0.1")), both(diffuse(0.1), diffuse(0.1))),
        (
            format!("<bsdf type=\"twosided\">{}{}</bsdf>", d("0.1"), d("0.9")),
            both(diffuse(0.1), diffuse(0.9)),
        ),
        (
            format!("<bsdf type=\"twosided\"><bsdf type=\"twosided\">{}</bsdf></bsdf>", d("0.2")),
            both(diffuse(0.2), diffuse(0.2)),
        ),
        (
            "<bsdf type=\"twosided\"><bsdf type=\"conductor\"/></bsdf>".into(),
            both(PERFECT, PERFECT),
        ),
    ] {
        assert_eq!(material(&bsdf), expected, "{bsdf}");
    }
}

#[test]
fn blends_add_up_their_parts() {
    let blend = |weight: &str, parts: &str| {
        material(&format!(
            "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"{weight}\"/>{parts}</bsdf>"
        ))
    };
    let grey = |value: &str| {
        format!("<bsdf type=\"diffuse\"><float name=\"reflectance\" value=\"{value}\"/></bsdf>")
    };
    // Mitsuba 3.9.1: .75 × .1 + .25 × .9 = .3.
    let mixed = blend("0.25", &(grey("0.1") + &grey("0.9"))).front.diffuse;
    assert!((mixed[0] - 0.3).abs() < 1e-15 && mixed[0] == mixed[1] && mixed[1] == mixed[2]);

    let paper = blend("0.25", &(grey("0.8") + "<bsdf type=\"conductor\"/>"));
    assert!((paper.front.diffuse[0] - 0.6).abs() < 1e-15);
    assert_eq!(paper.front.mirror, Some(Mirror { weight: Rgb::grey(0.25), conductor: None }));
    assert_eq!(paper.back, NOTHING);

    let glass = blend("0.5", &(grey("0.8") + "<bsdf type=\"dielectric\"/>"));
    let boundary = glass.dielectric.unwrap();
    assert_eq!((boundary.reflectance, boundary.transmittance), (Rgb::grey(0.5), Rgb::grey(0.5)));
    assert_eq!((glass.front, glass.back), (diffuse(0.4), NOTHING));

    // The ends are one part alone.
    let parts = grey("0.8") + "<bsdf type=\"conductor\"/>";
    assert_eq!(blend("0", &parts).front, diffuse(0.8));
    assert_eq!(blend("1", &parts).front, PERFECT);
    let message = refused(&format!(
        "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"1.5\"/>{parts}</bsdf>"
    ));
    assert!(message.contains("a weight must be between 0 and 1"), "{message}");
    let two = "<bsdf type=\"conductor\"/><bsdf type=\"conductor\"><string name=\"material\" value=\"Au\"/></bsdf>";
    let message = refused(&format!(
        "<bsdf type=\"blendbsdf\"><float name=\"weight\" value=\"0.5\"/>{two}</bsdf>"
    ));
    assert!(message.contains("two different conductors"), "{message}");
}

#[test]
fn indices_come_as_numbers_names_colours_and_spectra() {
    let index = |bsdf: &str| material(bsdf).dielectric.map(|d| (d.interior_ior, d.exterior_ior));
    assert_eq!(index("<bsdf type=\"dielectric\"/>"), Some((1.5046, 1.000277)));
    assert_eq!(
        index(
            "<bsdf type=\"dielectric\"><string name=\"int_ior\" value=\"Water\"/><float name=\"ext_ior\" value=\"1\"/></bsdf>"
        ),
        Some((1.333, 1.0))
    );
    let conductor = |inside: &str| {
        let bsdf = format!("<bsdf type=\"conductor\">{inside}</bsdf>");
        material(&bsdf).front.mirror.and_then(|m| m.conductor)
    };
    assert_eq!(
        conductor("<string name=\"material\" value=\"Au\"/>"),
        Some((Rgb([0.14304, 0.37531, 1.442]), Rgb([3.983, 2.3856, 1.6034])))
    );
    assert_eq!(
        conductor("<rgb name=\"eta\" value=\".2,3,4\"/><spectrum name=\"k\" value=\"3\"/>"),
        Some((Rgb([0.2, 3.0, 4.0]), Rgb::grey(3.0)))
    );
    // What is not given is η = 0 or k = 1.
    assert_eq!(conductor("<float name=\"eta\" value=\"2\"/>"), Some((Rgb::grey(2.0), Rgb::WHITE)));
    assert_eq!(conductor("<float name=\"k\" value=\"2\"/>"), Some((Rgb::BLACK, Rgb::grey(2.0))));
    let message = refused(
        "<bsdf type=\"conductor\"><string name=\"material\" value=\"Au\"/><float name=\"k\" value=\"2\"/></bsdf>",
    );
    assert!(message.contains("both a material and its index"), "{message}");
}

#[test]
fn radiances_are_mitsuba_s() {
    let radiance = |inside: &str| {
        let shape =
            format!("<shape type=\"rectangle\"><emitter type=\"area\">{inside}</emitter></shape>");
        load(&shape).scene.shapes[0].radiance
    };
    assert_eq!(radiance(""), Rgb::WHITE);
    assert_eq!(radiance("<float name=\"radiance\" value=\"3\"/>"), Rgb::grey(3.0));
    assert_eq!(radiance("<rgb name=\"radiance\" value=\"1,2,3\"/>"), Rgb([1.0, 2.0, 3.0]));
    // A uniform spectrum is the equal-energy white, which is reddish in Rec. 709.
    let uniform = radiance("<spectrum name=\"radiance\" value=\"3\"/>");
    for (ours, mitsuba) in uniform.0.iter().zip([3.6143818, 2.8448730, 2.7267482]) {
        assert!((ours - mitsuba).abs() < 2e-3 * mitsuba, "{uniform:?}");
    }
}

#[test]
fn integrators_of_other_light_are_answered_with_one_notice_and_depths_kept() {
    let integrator = |inside: &str| {
        let loaded =
            load(&format!("{inside}<shape type=\"disk\"><emitter type=\"area\"/></shape>"));
        let is_other = loaded.scene.max_depth.is_some() || !inside.contains("\"path\"");
        assert_eq!(loaded.notices.len(), usize::from(is_other), "{:?}", loaded.notices);
        loaded.scene.max_depth
    };
    assert_eq!(integrator("<integrator type=\"path\"/>"), None);
    let depth = |n: &str| format!("<integer name=\"max_depth\" value=\"{n}\"/>");
    assert_eq!(
        integrator(&format!("<integrator type=\"path\">{}</integrator>", depth("8"))),
        Some(8)
    );
    assert_eq!(
        integrator(&format!("<integrator type=\"path\">{}</integrator>", depth("-1"))),
        None
    );
    assert_eq!(
        integrator(&format!("<integrator type=\"volpath\">{}</integrator>", depth("0"))),
        Some(0)
    );
    let nested = "<integrator type=\"aov\"><string name=\"aovs\" value=\"dd:depth\"/>
        <integrator type=\"path\"><integer name=\"max_depth\" value=\"5\"/><texture type=\"any\"/></integrator></integrator>";
    assert_eq!(integrator(nested), Some(5));
    assert!(
        refused(&format!("<integrator type=\"path\">{}</integrator>", depth("-2")))
            .contains("max_depth")
    );
}

/// Two triangles at an angle, in the formats of Mitsuba's own answers.
const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 1\nvt 0 0\nvt 1 0\nvt 0 .25\nvt 1 1\n\
    f 1/1 2/2 3/3\nf 3/3 2/2 4/4\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nproperty float u\nproperty float v\nelement face 2\n\
    property list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 0.25\n1 1 1 1 1\n3 0 1 2\n3 2 1 3\n";
const PLY_NORMALS: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n\
    property float y\nproperty float z\nproperty float nx\nproperty float ny\nproperty float nz\n\
    element face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0.6 0.8\n1 0 0 0 0 2\n0 1 0 0 0 1\n3 0 1 2\n";

/// Where a ray down the z axis at (±.3, .2) meets the mesh: shading normal and v.
#[test]
fn meshes_have_mitsuba_s_normals_and_texture_coordinates() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR"));
    for (name, text) in [("angle.obj", OBJ), ("angle.ply", PLY), ("normals.ply", PLY_NORMALS)] {
        std::fs::write(folder.join(name), text).unwrap();
    }
    let mirrored = "<transform name=\"to_world\"><scale x=\"-1\"/></transform>";
    let high = "<transform name=\"to_world\"><scale z=\"2\"/></transform>";
    let flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
    let flat = "<boolean name=\"face_normals\" value=\"true\"/>";
    let both = format!("{mirrored}{flip}");
    let tex = |on: bool| format!("<boolean name=\"flip_tex_coords\" value=\"{on}\"/>");
    let smooth = [-0.19251, -0.19251, 0.96223];
    let across = [-0.19251, 0.19251, -0.96223];
    let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
    let given = [0.0, 0.31623, 0.94868];
    for (file, inside, normal, v) in [
        ("angle.obj", "", smooth, 0.95),
        ("angle.obj", flat, up, 0.95),
        ("angle.obj", &tex(true), smooth, 0.95),
        ("angle.obj", &tex(false), smooth, 0.05),
        ("angle.obj", flip, smooth.map(|x: f64| -x), 0.95),
        ("angle.obj", high, [-0.26728, -0.26728, 0.92581], 0.95),
        ("angle.obj", mirrored, across, 0.95),
        ("angle.obj", &both, across.map(|x: f64| -x), 0.95),
        ("angle.ply", "", smooth, 0.05),
        ("angle.ply", flat, up, 0.05),
        ("angle.ply", &tex(true), smooth, 0.95),
        ("angle.ply", mirrored, across, 0.05),
        ("normals.ply", "", given, 0.2),
        ("normals.ply", flat, up, 0.2),
        ("normals.ply", flip, given.map(|x: f64| -x), 0.2),
        ("normals.ply", high, [0.0, 0.47186, 0.88167], 0.2),
        ("normals.ply", mirrored, given, 0.2),
        ("normals.ply", &both, given.map(|x: f64| -x), 0.2),
        ("normals.ply", &format!("{mirrored}{flat}"), down, 0.2),
    ] {
        let plugin = &file[file.len() - 3..];
        let path = folder.join(file);
        let surface = surface(&format!(
            "<shape type=\"{plugin}\"><string name=\"filename\" value=\"{}\"/>{inside}</shape>",
            path.display()
        ));
        let Surface::Mesh(mesh) = surface else { panic!("{file}") };
        // Mitsuba's surface is the facets.
        let mesh = mesh.with_smoothing(MeshSmoothing::Facets);
        let x = Point3::new(if inside.contains("-1") { -0.3 } else { 0.3 }, 0.2, 0.0);
        let point = mesh.nearest_on(0, &x);
        let n = mesh.local(&point).unwrap().n.into_inner();
        assert!((n - Vector3::from(normal)).norm() < 1e-5, "{file} {inside}: {n:?}");
        let uv = mesh.uv(&point);
        // Flipping turns a triangle's vertices round, and with them the uv of a mesh without any.
        if file != "normals.ply" {
            assert!(
                (uv[0] - 0.3).abs() < 1e-12 && (uv[1] - v).abs() < 1e-12,
                "{file} {inside}: {uv:?}"
            );
        }
    }
}

#[test]
fn files_are_looked_for_beside_the_file_that_names_them() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("include");
    let inner = folder.join("inner");
    std::fs::create_dir_all(&inner).unwrap();
    let write = |path: &std::path::Path, text: &str| std::fs::write(path, text).unwrap();
    write(&inner.join("mesh.obj"), OBJ);
    write(
        &inner.join("part.xml"),
        "<scene version=\"3.0.0\"><default name=\"r\" value=\"3\"/><include filename=\"glass.xml\"/>
         <shape type=\"obj\" id=\"mesh\"><string name=\"filename\" value=\"mesh.obj\"/><ref id=\"glass\"/></shape></scene>",
    );
    write(&inner.join("glass.xml"), "<bsdf version=\"3.0.0\" type=\"dielectric\" id=\"glass\"/>");
    write(
        &folder.join("scene.xml"),
        "<scene version=\"3.0.0\"><include filename=\"inner/part.xml\"/>
         <shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/><ref id=\"glass\"/></shape>
         <path value=\"inner\"/><shape type=\"obj\"><string name=\"filename\" value=\"mesh.obj\"/></shape></scene>",
    );
    let loaded = load_file(folder.join("scene.xml"), &[]).unwrap();
    let ids: Vec<&str> = loaded.scene.shapes.iter().map(|s| s.id.as_str()).collect();
    assert_eq!(ids, ["mesh", "shape 2, sphere", "shape 3, obj"]);
    assert_eq!(loaded.scene.name, "scene");
    assert_eq!(loaded.files.len(), 3);
    assert!(loaded.scene.shapes[0].material.dielectric.is_some());
    // A default of an included file acts after it, too.
    assert!((loaded.scene.shapes[1].surface.bounds().extent().x - 6.0).abs() < 1e-12);
}

#[test]
fn errors_in_formulas_point_into_the_attribute() {
    let message = refused(
        "<default name=\"bad\" value=\"sine(s)\"/>\n<shape type=\"parametric\">\n<string name=\"x\" value=\"1 &lt; s\"/>\n\
         <string name=\"y\" value=\"t\"/><string name=\"z\" value=\"s\"/></shape>",
    );
    assert!(message.contains("test.xml:4:27"), "{message}");
    let message = refused(
        "<default name=\"bad\" value=\"sine(s)\"/>\n<shape type=\"parametric\">\n<string name=\"x\" value=\"s\"/>\n\
         <string name=\"y\" value=\"t + $bad\"/><string name=\"z\" value=\"s\"/></shape>",
    );
    assert!(message.contains("test.xml:5:29") && message.contains("^^^^"), "{message}");
    assert!(message.contains("sin"), "{message}");
}

#[test]
fn constants_of_formulas_are_the_other_numbers() {
    let surface = surface(
        "<shape type=\"parametric\"><float name=\"a\" value=\"2\"/><integer name=\"b\" value=\"3\"/>
         <string name=\"x\" value=\"a*s\"/><string name=\"y\" value=\"b*t\"/><string name=\"z\" value=\"0\"/></shape>",
    );
    assert!((surface.area() - 6.0).abs() < 1e-9);
    let normal = surface.local(&surface.point(0.5, 0.5).unwrap()).unwrap().n;
    assert!((normal.into_inner() - Vector3::z()).norm() < 1e-12, "x_s × x_t");
    let message = refused("<shape type=\"parametric\"><string name=\"X\" value=\"s\"/></shape>");
    assert!(message.contains("unknown property \"X\""), "{message}");
}

#[test]
fn a_scene_without_a_lamp_says_so() {
    let loaded = load("<shape type=\"sphere\"/>");
    assert_eq!(loaded.notices, ["the scene has no lamp: nothing is lit"]);
}
