//! What is seen along one ray: a tree through mirrors and boundaries down to diffuse surfaces.
//!
//! At a boundary both branches are followed; a mirror with a diffuse part contributes that part and
//! the chain goes on. Radiance crosses a boundary from n₂ into n₁ by the factor T (n₁/n₂)². A branch
//! ends on a surface that sends nothing on, in the open, after the longest chain allowed, or where its
//! throughput falls below a bound; what the last two cut off is added up.
//!
//! Backwards the tree is where light goes that leaves along the ray: the same branches, and flux instead of
//! radiance, without the ratios of n². Of the flux of one unit, what is not in the leaves was absorbed by
//! specular surfaces or backs, escaped into the open, or is in the branches that were cut.

use std::ops::{AddAssign, Mul};

use serde::{Deserialize, Serialize};

use crate::geometry::{Ray, Rgb, UnitVector3};
use crate::optics::{
    ConductorIndex, DielectricBoundary, Interaction, reflect_direction, refract_direction,
};
use crate::scene::{Mirror, Scene, ShapeId};
use crate::surface::LocalGeometry;

use super::{Anchor, Hit, Tracer};

/// Where branches end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Longest chain between the eye and a diffuse surface or a lamp [interactions].
    pub max_specular: u32,
    /// Branches of less throughput (the largest channel) are cut.
    pub throughput: f64,
    /// Diffuse surfaces that are seen with less throughput than this are cut.
    pub diffuse_throughput: f64,
    /// Whether lamps are seen at all (a `max_depth` of 0 forbids even that).
    pub lamps: bool,
}

/// A diffuse surface that is seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leaf {
    /// Identifies the shapes met on the way and what happened there: two rays with the same path
    /// saw the same thing the same way.
    pub path: u64,
    /// Interactions before it.
    pub depth: u32,
    /// The shape and the point on it.
    pub anchor: Anchor,
    /// Whether its front is seen.
    pub front: bool,
    /// The normal on the side that is seen.
    pub normal: UnitVector3,
    /// Fraction of the surface's radiance that arrives, the ratio of n² included.
    pub throughput: Rgb,
    /// Fraction of the flux that arrives, and does not go on specularly, if light runs the other way.
    pub flux: Rgb,
    /// Diffuse reflectance on the side that is seen.
    pub reflectance: Rgb,
    /// Length of the path so far [m].
    pub distance: f64,
}

/// Where a tree begins.
#[derive(Clone, Copy, Debug)]
pub struct Trunk<'a> {
    /// The ray; its direction is of length one.
    pub ray: Ray,
    /// How far it goes [m].
    pub length: f64,
    /// The surfaces on which it starts.
    pub start: &'a [Anchor],
    /// Length of the path before its start [m].
    pub travelled: f64,
}

/// Flux that does not come to diffuse surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Losses {
    /// Leaves into the open.
    pub escaped: Rgb,
    /// Is absorbed by surfaces that are not diffuse.
    pub absorbed: Rgb,
    /// Is in branches that were cut.
    pub cut: Rgb,
}

impl Losses {
    /// All of it.
    pub fn sum(&self) -> Rgb {
        self.escaped + self.absorbed + self.cut
    }
}

impl AddAssign for Losses {
    fn add_assign(&mut self, other: Self) {
        self.escaped += other.escaped;
        self.absorbed += other.absorbed;
        self.cut += other.cut;
    }
}

impl Mul<Rgb> for Losses {
    type Output = Self;
    fn mul(self, factor: Rgb) -> Self {
        Self {
            escaped: self.escaped * factor,
            absorbed: self.absorbed * factor,
            cut: self.cut * factor,
        }
    }
}

/// What one ray sees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sight {
    /// Diffuse surfaces in the order of the tree, the reflected branch first.
    pub leaves: Vec<Leaf>,
    /// Radiance of lamps seen [W/(m² sr)].
    pub emitted: Rgb,
    /// Identifies everything that was met: differs from a neighbour's where an outline lies between.
    pub signature: u64,
    /// Throughput of the branches that were cut (largest channel), a factor on radiance in the medium
    /// where they were.
    pub cut: f64,
    /// Where the rest goes if light runs the other way, of one unit of flux: what does not come to a specular
    /// surface, and what does.
    pub losses: [Losses; 2],
    /// Rays traced.
    pub rays: u64,
}

/// What a branch has behind it.
struct Stem {
    throughput: Rgb,
    flux: Rgb,
    path: u64,
    depth: u32,
    distance: f64,
}

/// A ray still to be traced.
struct Branch {
    ray: Ray,
    start: Anchor,
    stem: Stem,
}

/// One of the ways on from a surface.
struct Way {
    interaction: Interaction,
    direction: UnitVector3,
    /// Factor on radiance.
    factor: Rgb,
    /// Factor on the flux if light runs the other way.
    share: Rgb,
}

/// Memory that trees of many trunks are made in, one after the other.
#[derive(Default)]
pub struct Workspace {
    sight: Sight,
    branches: Vec<Branch>,
}

/// Follows a trunk through the scene.
pub fn sight(tracer: &Tracer<'_>, trunk: &Trunk<'_>, limits: &Limits) -> Sight {
    let mut workspace = Workspace::default();
    sight_in(&mut workspace, tracer, trunk, limits);
    workspace.sight
}

/// The same without an allocation for each trunk.
pub fn sight_in<'w>(
    workspace: &'w mut Workspace,
    tracer: &Tracer<'_>,
    trunk: &Trunk<'_>,
    limits: &Limits,
) -> &'w Sight {
    let Workspace { sight, branches } = workspace;
    sight.leaves.clear();
    *sight =
        Sight { leaves: std::mem::take(&mut sight.leaves), signature: SEED, ..Sight::default() };
    let whole = Stem {
        throughput: Rgb::WHITE,
        flux: Rgb::WHITE,
        path: SEED,
        depth: 0,
        distance: trunk.travelled,
    };
    let hit = tracer.nearest(&trunk.ray, trunk.length, trunk.start);
    sight.meet(tracer.scene(), &whole, &trunk.ray, hit, limits, branches);
    while let Some(Branch { ray, start, stem }) = branches.pop() {
        let hit = tracer.nearest(&ray, f64::INFINITY, &[start]);
        sight.meet(tracer.scene(), &stem, &ray, hit, limits, branches);
    }
    sight
}

impl Sight {
    /// Adds what a branch meets at its end, and puts what goes on from there on the pile.
    fn meet(
        &mut self,
        scene: &Scene,
        stem: &Stem,
        ray: &Ray,
        hit: Option<Hit>,
        limits: &Limits,
        branches: &mut Vec<Branch>,
    ) {
        self.rays += 1;
        let Some(hit) = hit else {
            self.signature = mixed(self.signature, stem.path);
            self.losses[usize::from(stem.depth > 0)].escaped += stem.flux;
            return;
        };
        let shape = scene.shape(hit.anchor.shape);
        let distance = stem.distance + hit.t;
        let Some(local) = shape.surface.local(&hit.anchor.point) else {
            // A point without a normal (a degenerate corner) sends nothing to anyone.
            self.losses[usize::from(stem.depth > 0)].absorbed += stem.flux;
            return;
        };
        let seen = Seen::new(hit.anchor, &local, ray);
        let path = mixed(stem.path, 2 * u64::from(hit.anchor.shape.0) + u64::from(seen.front));
        self.signature = mixed(self.signature, path);
        if seen.front && limits.lamps {
            self.emitted += stem.throughput * shape.radiance;
        }
        // What does not go on specularly stays here.
        let mut stays = stem.flux;
        let mut specular = stem.depth > 0;
        // The refracted branch is put on the pile first, so that it is taken second.
        for way in seen.ways(scene) {
            let throughput = stem.throughput * way.factor;
            if throughput.max() <= 0.0 {
                continue;
            }
            let flux = stem.flux * way.share;
            stays = stays - flux;
            specular = true;
            if throughput.max() < limits.throughput || stem.depth >= limits.max_specular {
                self.cut += throughput.max();
                self.losses[1].cut += flux;
                continue;
            }
            branches.push(Branch {
                ray: Ray::new(hit.anchor.point.x, way.direction.into_inner()),
                start: hit.anchor,
                stem: Stem {
                    throughput,
                    flux,
                    path: mixed(path, u64::from(way.interaction == Interaction::Refraction)),
                    depth: stem.depth + 1,
                    distance,
                },
            });
        }
        let side = if seen.front { shape.material.front } else { shape.material.back };
        if side.diffuse.is_black() {
            self.losses[usize::from(specular)].absorbed += stays;
        } else if stem.throughput.max() < limits.diffuse_throughput {
            self.cut += stem.throughput.max();
            self.losses[usize::from(stem.depth > 0)].cut += stays;
        } else {
            self.leaves.push(Leaf {
                path,
                depth: stem.depth,
                anchor: hit.anchor,
                front: seen.front,
                normal: seen.normal,
                throughput: stem.throughput,
                flux: stays,
                reflectance: side.diffuse,
                distance,
            });
        }
    }
}

/// A surface as a ray meets it.
struct Seen {
    shape: ShapeId,
    /// Whether it is the front (the normal's side).
    front: bool,
    /// The normal on the side that is seen.
    normal: UnitVector3,
    direction: UnitVector3,
    /// Cosine of the angle of incidence, > 0.
    cos_i: f64,
}

impl Seen {
    fn new(anchor: Anchor, local: &LocalGeometry, ray: &Ray) -> Self {
        let front = local.ng.dot(&ray.direction) < 0.0;
        let normal = if front { local.n } else { -local.n };
        let direction = UnitVector3::new_unchecked(ray.direction);
        Self { shape: anchor.shape, front, normal, direction, cos_i: -normal.dot(&direction) }
    }

    /// Where light goes on specularly: the refraction, if any, first.
    fn ways(&self, scene: &Scene) -> impl Iterator<Item = Way> + use<> {
        let material = &scene.shape(self.shape).material;
        let mut reflected = Rgb::BLACK;
        let mut refracted = None;
        // On meshes with vertex normals the cosine with the shading normal can have the wrong sign.
        if self.cos_i > 0.0 {
            if let Some(boundary) = &material.dielectric {
                let (inside, outside) = (boundary.interior_ior, boundary.exterior_ior);
                let (n1, n2) = if self.front { (outside, inside) } else { (inside, outside) };
                let fresnel = DielectricBoundary { n1, n2 };
                let (reflectance, transmittance) = fresnel.split(self.cos_i);
                reflected += boundary.reflectance * reflectance;
                refracted = refract_direction(&self.direction, &self.normal, n1, n2).map(|r| {
                    let share = boundary.transmittance * transmittance;
                    Way {
                        interaction: Interaction::Refraction,
                        direction: r.direction,
                        factor: share * ((n1 / n2) * (n1 / n2)),
                        share,
                    }
                });
            }
            let side = if self.front { &material.front } else { &material.back };
            if let Some(mirror) = &side.mirror {
                reflected += mirror_reflectance(mirror, self.cos_i);
            }
        }
        let reflection = (!reflected.is_black()).then(|| Way {
            interaction: Interaction::Reflection,
            direction: reflect_direction(&self.direction, &self.normal),
            factor: reflected,
            share: reflected,
        });
        refracted.into_iter().chain(reflection)
    }
}

/// Reflected fraction of the flux a channel.
fn mirror_reflectance(mirror: &Mirror, cos_i: f64) -> Rgb {
    match &mirror.conductor {
        None => mirror.weight,
        Some((eta, k)) => {
            let fresnel =
                std::array::from_fn(|i| ConductorIndex { eta: eta[i], k: k[i] }.reflectance(cos_i));
            mirror.weight * Rgb(fresnel)
        }
    }
}

/// Any odd number does; this one is 2⁶⁴ over the golden ratio.
const SEED: u64 = 0x9e37_79b9_7f4a_7c15;

/// A hash of a history and what comes next (the finaliser of MurmurHash3 over their sum).
fn mixed(history: u64, next: u64) -> u64 {
    let mut x = history.rotate_left(5).wrapping_add(next).wrapping_mul(SEED);
    x = (x ^ (x >> 33)).wrapping_mul(0xff51_afd7_ed55_8ccd);
    x = (x ^ (x >> 33)).wrapping_mul(0xc4ce_b9fe_1a85_ec53);
    x ^ (x >> 33)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Point3, Vector3};
    use crate::scene::load_str;

    const LIMITS: Limits =
        Limits { max_specular: 256, throughput: 1e-6, diffuse_throughput: 1e-6, lamps: true };

    fn scene(shapes: &str) -> Scene {
        let text = format!("<scene version=\"3.0.0\">{shapes}</scene>");
        load_str("test.xml", &text, &[]).unwrap().scene
    }

    fn look(scene: &Scene, origin: [f64; 3], towards: [f64; 3], limits: &Limits) -> Sight {
        let ray = Ray::new(Point3::from(origin), Vector3::from(towards).normalize());
        let trunk = Trunk { ray, length: f64::INFINITY, start: &[], travelled: 0.5 };
        sight(&Tracer::new(scene), &trunk, limits)
    }

    /// Directions all around.
    fn around() -> impl Iterator<Item = [f64; 3]> {
        (0..200).map(|i| {
            let z = 1.0 - (f64::from(i) + 0.5) / 100.0;
            let (s, c) = crate::geometry::math::sin_cos(f64::from(i) * 2.4);
            let r = (1.0 - z * z).sqrt();
            [r * c, r * s, z]
        })
    }

    const LAMP_AROUND: &str = r#"<shape type="sphere">
        <float name="radius" value="10"/> <boolean name="flip_normals" value="true"/>
        <emitter type="area"><rgb name="radiance" value="3, 2, 1"/></emitter>
        <bsdf type="diffuse"><rgb name="reflectance" value="0"/></bsdf>
    </shape>"#;

    #[test]
    fn in_a_uniform_surrounding_glass_and_mirrors_vanish() {
        let scene = scene(&format!(
            r#"{LAMP_AROUND}
            <shape type="sphere"><point name="center" x="2" y="0" z="0"/> <float name="radius" value="1.5"/>
                <bsdf type="dielectric">
                    <float name="int_ior" value="1.5"/> <float name="ext_ior" value="1"/>
                </bsdf>
            </shape>
            <shape type="sphere"><point name="center" x="-2" y="0" z="0"/> <float name="radius" value="1"/>
                <bsdf type="conductor"><string name="material" value="none"/></bsdf>
            </shape>"#
        ));
        for d in around() {
            let sight = look(&scene, [0.0; 3], d, &LIMITS);
            assert!(sight.leaves.is_empty());
            let missing = 3.0 - sight.emitted[0];
            // What is cut inside the glass would have met radiance n² times that outside.
            let cut = 3.0 * 1.5 * 1.5 * sight.cut;
            assert!(missing > -1e-12 && missing <= cut + 1e-12, "{d:?} {sight:?}");
            // A chain that is caught by total reflection for long is cut by its throughput only.
            assert!(sight.cut < 1e-4, "{d:?} {}", sight.cut);
        }
    }

    #[test]
    fn an_eye_under_water_sees_lamps_outside_brighter_by_the_square_of_the_index() {
        let scene = scene(&format!(
            r#"{LAMP_AROUND}
            <shape type="sphere"><float name="radius" value="1"/>
                <bsdf type="dielectric">
                    <float name="int_ior" value="1.33"/> <float name="ext_ior" value="1"/>
                </bsdf>
            </shape>"#
        ));
        // Along the radius: internal reflections add up to all of it.
        let sight = look(&scene, [0.0; 3], [1.0, 0.0, 0.0], &LIMITS);
        assert!((sight.emitted[1] - 2.0 * 1.33 * 1.33).abs() < 1e-4, "{}", sight.emitted[1]);
    }

    #[test]
    fn a_blend_shows_its_diffuse_part_and_what_it_mirrors() {
        let scene = scene(
            r#"<shape type="rectangle" id="floor">
                <bsdf type="blendbsdf">
                    <float name="weight" value="0.25"/>
                    <bsdf type="diffuse"><rgb name="reflectance" value="0.8"/></bsdf>
                    <bsdf type="conductor"><string name="material" value="none"/></bsdf>
                </bsdf>
            </shape>
            <shape type="rectangle" id="ceiling">
                <transform name="to_world"><rotate x="1" angle="180"/><translate z="2"/></transform>
                <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
            </shape>"#,
        );
        let sight = look(&scene, [0.0, 0.0, 1.0], [0.1, 0.0, -1.0], &LIMITS);
        let [floor, ceiling] = sight.leaves[..] else { panic!("{sight:?}") };
        assert!((floor.reflectance[0] - 0.6).abs() < 1e-12);
        assert_eq!((floor.throughput, floor.depth), (Rgb::WHITE, 0));
        assert!((ceiling.throughput[0] - 0.25).abs() < 1e-12);
        assert_eq!((ceiling.depth, ceiling.normal), (1, -Vector3::z_axis()));
        let length = 3.0 * (1.01f64).sqrt() + 0.5;
        assert!((ceiling.distance - length).abs() < 1e-12);
        assert!((ceiling.anchor.point.x - Point3::new(0.3, 0.0, 2.0)).norm() < 1e-12);
        // The diffuse part alone, if chains are forbidden; what is cut is told.
        let short = Limits { max_specular: 0, ..LIMITS };
        let sight = look(&scene, [0.0, 0.0, 1.0], [0.1, 0.0, -1.0], &short);
        assert_eq!(sight.leaves.len(), 1);
        assert!((sight.cut - 0.25).abs() < 1e-12);
    }

    #[test]
    fn backs_are_black_and_neighbours_share_their_path() {
        let scene = scene(
            r#"<shape type="rectangle">
                <emitter type="area"><rgb name="radiance" value="1"/></emitter>
                <bsdf type="diffuse"/>
            </shape>"#,
        );
        let front = look(&scene, [0.1, 0.0, 1.0], [0.0, 0.0, -1.0], &LIMITS);
        assert_eq!((front.emitted, front.leaves.len()), (Rgb::WHITE, 1));
        let beside = look(&scene, [0.2, 0.0, 1.0], [0.1, 0.0, -1.0], &LIMITS);
        assert_eq!(front.signature, beside.signature);
        assert_eq!(front.leaves[0].path, beside.leaves[0].path);
        let back = look(&scene, [0.1, 0.0, -1.0], [0.0, 0.0, 1.0], &LIMITS);
        assert_eq!((back.emitted, back.leaves.len()), (Rgb::BLACK, 0));
        let past = look(&scene, [0.1, 0.0, 1.0], [0.0, 0.0, 1.0], &LIMITS);
        let signatures = [front.signature, back.signature, past.signature];
        assert!(signatures[0] != signatures[1] && signatures[1] != signatures[2]);
        assert_ne!(signatures[0], signatures[2]);
    }
}
