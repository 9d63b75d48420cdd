//! Slats, bars and balls at random places before a concave mirror: one reflection against a plain sum over the
//! mirror, every chain of which is traced.

use evolute::geometry::{Point3, Ray, UnitVector3, Vector3};
use evolute::scene::{Scene, ShapeId, load_str};
use evolute::surface::{Parametric, Surface};
use evolute::trace::{Anchor, Tracer};
use evolute::transfer::{Receiver, Transfer};

use crate::cases;
use crate::common::SPECULAR;
use crate::random::Random;

const SCENES: u64 = 30;
const RECEIVERS: usize = 5;
/// Rows and columns of the plain sums, first and second: their difference tells their own error.
const COARSE: [usize; 2] = [220, 301];
/// The same where the first are not enough to tell.
const FINE: [usize; 2] = [1301, 1800];

/// A mirror that is a part of a ball, a row of equal bodies before it, and a lamp.
fn scene(random: &mut Random) -> String {
    let mut between = |low, high| random.between(low, high);
    let radius = between(0.6, 1.6);
    let (count, kind) = (between(2.0, 12.0).floor(), between(0.0, 4.0).floor());
    let (angle, offset, y) = (between(-60.0, 60.0), between(0.0, 1.0), between(-0.26, -0.06));
    let (pitch, share) = (0.5 / count, between(0.1, 0.5));
    let black = r#"<bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>"#;
    let mut bodies = String::new();
    for k in 0..count as i32 {
        let z = 0.05 + pitch * (f64::from(k) + offset);
        let slat = |shape: &str, thick: f64| {
            format!(
                r#"<shape type="{shape}"><transform name="to_world"><scale x="0.5" y="{}" z="{thick}"/>
                <rotate x="1" angle="{angle}"/><translate y="{y}" z="{z}"/></transform>"#,
                pitch * share
            )
        };
        bodies += &match kind as i32 {
            0 => slat("cube", 0.002),
            1 => slat("rectangle", 1.0),
            2 => format!(
                r#"<shape type="cylinder"><point name="p0" x="-0.5" y="{y}" z="{z}"/>
                <point name="p1" x="0.5" y="{y}" z="{}"/><float name="radius" value="{}"/>"#,
                z + angle / 600.0,
                pitch * share * 0.8
            ),
            _ => format!(
                r#"<shape type="sphere"><point name="center" x="{}" y="{y}" z="{z}"/>
                <float name="radius" value="{}"/>"#,
                between(-0.15, 0.15),
                pitch * (share + 0.4)
            ),
        };
        bodies += black;
    }
    let size = 0.01 * 16f64.powf(between(0.0, 1.0));
    let (x, y, z) = (between(-0.5, 0.5), between(-1.6, -0.6), between(0.3, 1.3));
    format!(
        r#"<scene version="3.0.0">
        <shape type="parametric" id="dish">
            <float name="r" value="{radius}"/> <float name="a" value="0.5"/>
            <string name="x" value="a*(s-0.5)"/>
            <string name="y" value="sqrt(r^2-a^2*((s-0.5)^2+(t-0.5)^2))-r"/>
            <string name="z" value="0.3+a*(t-0.5)"/>
            <bsdf type="twosided"><bsdf type="conductor"><string name="material" value="none"/></bsdf></bsdf>
        </shape>
        {bodies}
        <shape type="rectangle" id="lamp">
            <transform name="to_world">
                <scale value="{size}"/> <lookat origin="{x},{y},{z}" target="0,0,0.3" up="0,0,1"/>
            </transform>
            <emitter type="area"><rgb name="radiance" value="800"/></emitter>
        </shape></scene>"#
    )
}

/// The mirror, which is the first shape.
fn dish(scene: &Scene) -> &Parametric {
    let Surface::Parametric(dish) = &scene.shapes[0].surface else { panic!("no formulas") };
    dish
}

/// A place that a ray from the lamp passes after the mirror, if nothing stands in its way.
fn place(scene: &Scene, random: &mut Random) -> Point3 {
    let Some(id) = scene.lamps().next() else { panic!("no lamp") };
    let Surface::Rectangle(lamp) = &scene.shape(id).surface else { panic!("no rectangle") };
    let [p, q] = lamp.half_edges();
    let from = lamp.centre() + p * random.between(-1.0, 1.0) + q * random.between(-1.0, 1.0);
    let jet = dish(scene).jet(random.unit(), random.unit());
    let n = jet.xu.cross(&jet.xv).normalize();
    let d = (jet.x - from).normalize();
    jet.x + (d - n * (2.0 * d.dot(&n))) * random.between(0.15, 0.75)
}

/// The sum over the midpoints of n × n cells of the mirror's parameters [W/m²].
fn plain_sum(scene: &Scene, tracer: &Tracer<'_>, at: &Receiver, n: usize) -> f64 {
    let mirror = dish(scene);
    let middle = |k: usize| (k as f64 + 0.5) / n as f64;
    let one = |i: usize, j: usize| {
        let jet = mirror.jet(middle(i), middle(j));
        let to = jet.x - at.position;
        let (r, area) = (to.norm(), jet.xu.cross(&jet.xv));
        let d = to / r;
        let normal = area.normalize();
        let away = d - normal * (2.0 * d.dot(&normal));
        let start = Anchor { shape: ShapeId(0), point: mirror.point(middle(i), middle(j)) };
        let hit = tracer.nearest(&Ray::new(jet.x, away), f64::INFINITY, &[start])?;
        let lamp = scene.shape(hit.anchor.shape);
        let front = lamp.surface.local(&hit.anchor.point)?.ng.dot(&away) < 0.0;
        let free = || tracer.nearest(&Ray::new(at.position, d), r * (1.0 - 1e-9), &[]).is_none();
        let cos = d.dot(&at.normal);
        (front && cos > 0.0 && !lamp.radiance.is_black() && free())
            .then(|| lamp.radiance[1] * cos * d.dot(&area).abs() / (r * r))
    };
    let cells = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    cells.filter_map(|(i, j)| one(i, j)).sum::<f64>() / (n * n) as f64
}

#[test]
fn slats_before_a_concave_mirror() {
    let mut random = Random(1);
    let (mut lit, mut wrong, mut chains) = (0, 0, 0);
    for number in 0..SCENES {
        let scene = load_str("slats", &scene(&mut random), &[]).unwrap().scene;
        let tracer = Tracer::new(&scene);
        let transfer = Transfer::new(&scene, &tracer, cases::settings(&scene, 1e-2));
        for _ in 0..RECEIVERS {
            let normal = UnitVector3::new_normalize(Vector3::new(0.0, 1.0, 0.3));
            let at = Receiver { position: place(&scene, &mut random), normal };
            let (light, words) = transfer.light_by_word(&at, SPECULAR);
            let once = words.iter().filter(|w| w.letters.len() == 1);
            let got: f64 = once.map(|w| w.irradiance[1]).sum();
            let excess = |orders: [usize; 2]| {
                let [p, q] = orders.map(|n| plain_sum(&scene, &tracer, &at, n));
                (q, (got - q).abs() - light.error - 2.0 * (p - q).abs() - 1e-3 * q)
            };
            let mut told = excess(COARSE);
            if told.1 > 0.0 {
                told = excess(FINE);
            }
            lit += usize::from(told.0 > 0.0);
            chains += light.counts.chains;
            if told.1 > 0.0 {
                wrong += 1;
                println!(
                    "scene {number}, {:?}: {got:.6} ± {:.6}, plain sum {:.6}",
                    at.position, light.error, told.0
                );
            }
        }
    }
    println!("{wrong} of {lit} lit receivers outside the estimate; {chains} chains");
    assert!(lit > 100 && wrong == 0);
}
