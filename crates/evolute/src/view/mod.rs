//! The second pass: camera → layers of radiance.
//!
//! Rays from the camera run through mirrors and boundaries (both branches) to diffuse surfaces. Light there
//! is either read off the meshes of the first pass ([`Mode::Mesh`]), or computed anew ([`Mode::Recompute`]):
//! direct and specular irradiance by [`Transfer`](crate::transfer::Transfer), indirect by what is seen of the
//! meshes from there, on lattices over the film that are refined where interpolation would show
//! (`lattice.rs`). Outlines are sampled where neighbouring rays see different things (`resolve.rs`). No
//! random numbers: the same scene gives the same bits, whatever the number of threads.
//!
//! Limits: only `perspective` cameras.

mod camera;
mod filter;
mod lattice;
mod receiver;
mod resolve;

use crate::geometry::Rgb;
use crate::scene::{ReconstructionFilter, Scene, Sensor};
use crate::solve::Solution;
use crate::trace::Tracer;
use crate::trace::tree::{self, Leaf, Limits, Sight, Trunk};
use crate::transfer::{Control, Counts, LONGEST_CHAIN, Order, TransferSettings};

use camera::Camera;
use lattice::Lattice;
use receiver::{Indirect, Lighting, Part, PartLight};

/// What is asked of a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewSettings {
    /// Accuracy of the light at a point, which is also that of the interpolation between points.
    pub transfer: TransferSettings,
    /// Columns and rows instead of the film's own; the field of view across the width stays.
    pub size: Option<(u32, u32)>,
    /// Where light on diffuse surfaces is taken from.
    pub mode: Mode,
}

/// Where the second pass takes light on diffuse surfaces from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// From the meshes: quick, and as coarse as they are.
    Mesh,
    /// Direct and specular light is computed at the place, indirect light gathered there.
    #[default]
    Recompute,
}

/// A picture in layers: one value per pixel, row by row from the top, each from left to right.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picture {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Radiance of light that came to the last diffuse surface straight from lamps [W/(m² sr)].
    pub direct: Vec<[f32; 3]>,
    /// Radiance of light that came to the last diffuse surface by specular chains [W/(m² sr)].
    pub specular: Vec<[f32; 3]>,
    /// Radiance of light that was reflected diffusely before the last diffuse surface [W/(m² sr)].
    pub indirect: Vec<[f32; 3]>,
    /// Radiance of lamps seen, by specular chains too [W/(m² sr)].
    pub emitted: Vec<[f32; 3]>,
    /// Irradiance of the first diffuse surface at the pixel's centre, on the side seen [W/m²]; 0
    /// where there is none. Where several surfaces show, the one that shows most.
    pub irradiance: Vec<[f32; 3]>,
    /// Length of the path from the pinhole to that surface [m]; 0 where there is none.
    pub distance: Vec<f32>,
    /// Its normal on the side seen; 0 where there is none.
    pub normal: Vec<[f32; 3]>,
    /// Whether the accuracy was reached everywhere before an order to finish.
    pub complete: bool,
    /// Points of the film at which irradiance was computed.
    pub nodes: u64,
    /// Samples of the film.
    pub samples: u64,
    /// Rays from the camera on.
    pub rays: u64,
    /// Receivers that were computed.
    pub receivers: u64,
    /// Receivers that did not reach their tolerance.
    pub unmet: u64,
    /// The largest estimated error of a receiver's direct or specular irradiance, its luminance [W/m²].
    pub largest_error: f64,
    /// Work of all receivers.
    pub counts: Counts,
    /// Throughput of branches that were cut, mean over the samples.
    pub cut: f64,
}

impl Picture {
    fn new(width: usize, height: usize) -> Self {
        Self { width, height, ..Self::default() }
    }

    /// Direct + specular + indirect + emitted radiance [W/(m² sr)], row by row.
    pub fn radiance(&self) -> impl Iterator<Item = [f32; 3]> + Clone + '_ {
        (0..self.direct.len()).map(|i| {
            std::array::from_fn(|c| {
                self.direct[i][c] + self.specular[i][c] + self.indirect[i][c] + self.emitted[i][c]
            })
        })
    }
}

/// Branches of the camera's ray tree that carry less than this fraction of a lamp's radiance are cut.
/// Lamps are seldom more than a thousand times as bright as what they light.
const THROUGHPUT: f64 = 1e-5;

/// Branches behind a place that indirect light comes to are cut below this part of the accuracy.
const INDIRECT_THROUGHPUT: f64 = 0.01;

/// Irradiance by [`Part`] as the meshes of a first pass have it [W/m²].
type MeshLight<'s> = &'s (dyn Fn(&Leaf) -> [Rgb; 3] + Sync);

/// Everything a sample needs.
struct View<'s> {
    tracer: &'s Tracer<'s>,
    camera: Camera,
    limits: Limits,
    /// One part of the light on a surface that is seen, with a floor of the tolerance [W/m²].
    light: &'s (dyn Fn(&Leaf, Part, f64) -> PartLight + Sync),
    /// The parts that there are, in the order in which they are computed.
    parts: &'s [Part],
    /// What tells where edges of light may lie, if there is a first pass.
    hint: Option<MeshLight<'s>>,
    /// What light is read off, if it is not computed anew.
    mesh: Option<MeshLight<'s>>,
    filter: ReconstructionFilter,
    width: u32,
    height: u32,
    relative: f64,
}

impl View<'_> {
    /// What is seen through (x, y) of the film [pixels].
    fn sight(&self, x: f64, y: f64) -> Sight {
        let first = self.camera.ray(x, y);
        let trunk = Trunk {
            ray: first.ray(),
            length: first.length,
            start: &[],
            travelled: first.travelled,
        };
        tree::sight(self.tracer, &trunk, &self.limits)
    }

    /// Irradiance [W/m²] that is known of a leaf before a part of it is computed, besides the parts that were: for
    /// direct light, which comes first, indirect light as the meshes of a first pass have it.
    fn foreknown(&self, leaf: &Leaf, part: Part) -> Rgb {
        match self.hint {
            Some(hint) if part == Part::Direct => hint(leaf)[Part::Indirect as usize],
            _ => Rgb::BLACK,
        }
    }

    /// The whole picture; `None` if told to abandon it.
    fn draw(&self, control: &Control<'_>) -> Option<Picture> {
        let mut lattices: Vec<Lattice> = Vec::new();
        let parts = if self.mesh.is_some() { &[] } else { self.parts };
        for part in parts {
            lattices.push(Lattice::build(self, *part, &lattices, control));
            if (control.order)() == Order::Abandon {
                return None;
            }
        }
        resolve::resolve(self, &lattices, control)
    }

    /// Relative error of interpolation that is allowed: that of the light itself, but no less than
    /// what an 8-bit display shows.
    fn tolerance(&self) -> f64 {
        self.relative.max(0.004)
    }
}

/// Draws what a sensor sees, with indirect light if there is a solution. `None` if `control` said
/// [`Order::Abandon`].
///
/// The film's filter weighs samples as in Mitsuba 3: a film of the same size shows the same picture.
pub fn render(
    scene: &Scene,
    tracer: &Tracer<'_>,
    sensor: &Sensor,
    solution: Option<&Solution<'_>>,
    settings: &ViewSettings,
    control: &Control<'_>,
) -> Option<Picture> {
    let (width, height) = settings.size.unwrap_or((sensor.film.width, sensor.film.height));
    let transfer = &settings.transfer;
    let limits = Limits {
        max_specular: transfer.max_specular.min(LONGEST_CHAIN),
        throughput: INDIRECT_THROUGHPUT * transfer.relative,
        diffuse_throughput: INDIRECT_THROUGHPUT * transfer.relative,
        lamps: false,
    };
    let (relative, absolute) = (transfer.relative, transfer.absolute);
    let indirect =
        solution.map(|solution| Indirect { tracer, solution, limits, relative, absolute });
    let lighting = Lighting::new(scene, tracer, transfer, indirect);
    let parts: Vec<Part> = Part::ALL
        .into_iter()
        .filter(|part| match part {
            Part::Direct => true,
            Part::Indirect => solution.is_some(),
            Part::Specular => lighting.is_specular(scene),
        })
        .collect();
    let of_mesh = |leaf: &Leaf| {
        let [direct, specular, indirect] =
            solution.and_then(|s| s.at(scene, leaf)).unwrap_or_default();
        [direct, indirect, specular]
    };
    let stop = || (control.order)() != Order::Go;
    let light = |leaf: &Leaf, part, absolute| lighting.light(leaf, part, absolute, &stop);
    let view = View {
        tracer,
        camera: Camera::new(sensor, width, height),
        limits: Limits {
            max_specular: lighting.longest_sight(transfer.max_specular),
            throughput: THROUGHPUT,
            // What a surface adds may be off by a tenth of what is asked for.
            diffuse_throughput: 0.1 * transfer.relative,
            lamps: scene.max_depth != Some(0),
        },
        light: &light,
        parts: &parts,
        hint: solution.is_some().then_some(&of_mesh as MeshLight<'_>),
        mesh: (settings.mode == Mode::Mesh).then_some(&of_mesh as MeshLight<'_>),
        filter: sensor.film.filter,
        width,
        height,
        relative: transfer.relative,
    };
    view.draw(control)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::geometry::{Transform, Vector3, math};
    use crate::scene::{Film, Material, Shape, SideMaterial};
    use crate::surface::{Rectangle, Surface};

    const PIXELS: u32 = 96;

    fn square(world_from_object: Transform, radiance: Rgb) -> Shape {
        let diffuse = Rgb::grey(if radiance.is_black() { 0.5 } else { 0.0 });
        Shape {
            id: "square".into(),
            surface: Surface::Rectangle(Rectangle::new(world_from_object, false).unwrap()),
            material: Material {
                front: SideMaterial { diffuse, mirror: None },
                back: SideMaterial::default(),
                dielectric: None,
            },
            radiance,
        }
    }

    /// A camera at z = 10 that sees the square [−1, 1]² of the plane z = 0 exactly, x to the right.
    fn camera(filter: ReconstructionFilter) -> Sensor {
        let turned = Transform::rotation(Vector3::y(), std::f64::consts::PI).unwrap();
        Sensor {
            world_from_camera: Transform::translation(Vector3::new(0.0, 0.0, 10.0)).after(&turned),
            fov_x: 2.0 * math::atan(0.1),
            near_clip: 0.01,
            far_clip: 1e4,
            principal_point_offset: [0.0; 2],
            film: Film { width: PIXELS, height: PIXELS, filter },
        }
    }

    fn scene(shapes: Vec<Shape>) -> Scene {
        Scene { name: "test".into(), shapes, sensors: Vec::new(), max_depth: None }
    }

    /// A picture of the scene under an irradiance given by a formula of the place.
    fn drawn(
        scene: &Scene,
        filter: ReconstructionFilter,
        irradiance: &(dyn Fn(f64, f64) -> f64 + Sync),
    ) -> Picture {
        let tracer = Tracer::new(scene);
        let light = |leaf: &Leaf, _, _| PartLight {
            irradiance: Rgb::grey(irradiance(leaf.anchor.point.x.x, leaf.anchor.point.x.y)),
            met: true,
            ..PartLight::default()
        };
        let view = View {
            tracer: &tracer,
            camera: Camera::new(&camera(filter), PIXELS, PIXELS),
            limits: Limits {
                max_specular: 8,
                throughput: 1e-5,
                diffuse_throughput: 1e-3,
                lamps: true,
            },
            light: &light,
            parts: &[Part::Direct],
            hint: None,
            mesh: None,
            filter,
            width: PIXELS,
            height: PIXELS,
            relative: 0.01,
        };
        let control = Control { order: &|| Order::Go, progress: &|_, _, _| {} };
        view.draw(&control).unwrap()
    }

    /// The largest error of a pixel of the floor's radiance under a box filter, as a fraction of
    /// `white`, against 32 × 32 points a pixel.
    fn worst_error(picture: &Picture, irradiance: &dyn Fn(f64, f64) -> f64, white: f64) -> f64 {
        const POINTS: u32 = 32;
        let mut worst: f64 = 0.0;
        for y in 0..PIXELS {
            for x in 0..PIXELS {
                let mut sum = 0.0;
                for i in 0..POINTS * POINTS {
                    let at = |p: u32, i: u32| {
                        let p = f64::from(p) + (f64::from(i) + 0.5) / f64::from(POINTS);
                        2.0 * p / f64::from(PIXELS) - 1.0
                    };
                    sum += irradiance(at(x, i % POINTS), -at(y, i / POINTS));
                }
                let truth = sum / f64::from(POINTS * POINTS);
                let drawn = f64::from(picture.direct[(y * PIXELS + x) as usize][0]);
                let drawn = drawn * std::f64::consts::PI / 0.5;
                worst = worst.max((drawn - truth).abs() / white);
            }
        }
        worst
    }

    #[test]
    fn smooth_light_takes_few_nodes() {
        let scene = scene(vec![square(Transform::identity(), Rgb::BLACK)]);
        let light = |x: f64, y: f64| 1.0 / (1.0 + (x - 0.2) * (x - 0.2) + y * y);
        let picture = drawn(&scene, ReconstructionFilter::Box, &light);
        let error = worst_error(&picture, &light, 1.0);
        // The accuracy asked for.
        assert!(error < 0.01, "{error}");
        assert!(picture.nodes < u64::from(PIXELS * PIXELS) / 5, "{}", picture.nodes);
    }

    #[test]
    fn a_hard_edge_of_light_is_followed_and_smooth() {
        let scene = scene(vec![square(Transform::identity(), Rgb::BLACK)]);
        let light = |x: f64, y: f64| if x * x + y * y < 0.5 { 1.0 } else { 0.1 };
        let picture = drawn(&scene, ReconstructionFilter::Box, &light);
        let error = worst_error(&picture, &light, 1.0);
        // Nodes half a pixel apart know where an edge runs to a quarter of a pixel.
        assert!(error < 0.25, "{error}");
        assert!(picture.nodes < 2 * u64::from(PIXELS * PIXELS), "{}", picture.nodes);
    }

    #[test]
    fn a_line_narrower_than_the_lattice_is_not_lost() {
        // A ring one pixel wide, eight times as bright as what is around it.
        let scene = scene(vec![square(Transform::identity(), Rgb::BLACK)]);
        let light = |x: f64, y: f64| {
            let r = (x * x + y * y).sqrt();
            let across = (r - 0.71) * f64::from(PIXELS / 2);
            1.0 + 7.0 * math::exp(-2.0 * across * across)
        };
        let picture = drawn(&scene, ReconstructionFilter::Box, &light);
        let error = worst_error(&picture, &light, 8.0);
        // A tenth of its height; lost, it would be seven eighths.
        assert!(error < 0.1, "{error}");
    }

    #[test]
    fn outlines_have_many_shades() {
        // A lamp of 1 × 1 m, slightly turned, hides a quarter of the floor.
        let turned = Transform::rotation(Vector3::z(), 0.37).unwrap();
        let half = Transform::scaling(Vector3::new(0.5, 0.5, 1.0)).unwrap();
        let lifted =
            Transform::translation(Vector3::new(0.0, 0.0, 1e-3)).after(&turned).after(&half);
        let scene =
            scene(vec![square(Transform::identity(), Rgb::BLACK), square(lifted, Rgb::grey(3.0))]);
        for filter in [
            ReconstructionFilter::Box,
            ReconstructionFilter::Tent { radius: 1.0 },
            ReconstructionFilter::Gaussian { stddev: 0.5 },
        ] {
            let picture = drawn(&scene, filter, &|_, _| std::f64::consts::TAU);
            // The floor's radiance is 1, the lamp's 3: a sample is one or the other.
            for (d, e) in picture.direct.iter().zip(&picture.emitted) {
                assert!((d[0] + e[0] / 3.0 - 1.0).abs() < 1e-6);
            }
            let sum: f64 = picture.emitted.iter().map(|e| f64::from(e[0])).sum();
            let expected = 3.0 * f64::from(PIXELS * PIXELS) / 4.0 / (0.9999 * 0.9999);
            assert!((sum / expected - 1.0).abs() < 1e-3, "{filter:?} {sum} {expected}");
            let mut shades: Vec<u32> = picture.emitted.iter().map(|e| e[0].to_bits()).collect();
            shades.sort_unstable();
            shades.dedup();
            assert!(shades.len() > 40, "{filter:?} {}", shades.len());
        }
    }

    #[test]
    fn up_is_up_and_right_is_right() {
        let scene = scene(vec![square(Transform::identity(), Rgb::BLACK)]);
        let light =
            |x: f64, y: f64| (if x > 0.0 { 2.0 } else { 1.0 }) * if y > 0.0 { 4.0 } else { 1.0 };
        let picture = drawn(&scene, ReconstructionFilter::Box, &light);
        let at = |x: u32, y: u32| picture.irradiance[(y * PIXELS + x) as usize][0];
        let (near, far) = (PIXELS / 4, 3 * PIXELS / 4);
        let seen = [at(near, near), at(far, near), at(near, far), at(far, far)];
        assert_eq!(seen, [4.0, 8.0, 1.0, 2.0]);
        let i = (near * PIXELS + near) as usize;
        assert_eq!(picture.normal[i], [0.0, 0.0, 1.0]);
        assert!((picture.distance[i] - 10.0).abs() < 0.05);
    }

    #[test]
    fn orders_are_obeyed() {
        let scene = scene(vec![square(Transform::identity(), Rgb::BLACK)]);
        let tracer = Tracer::new(&scene);
        let sensor = camera(ReconstructionFilter::Box);
        let with = |order| {
            let control = Control { order: &|| order, progress: &|_, _, _| {} };
            render(&scene, &tracer, &sensor, None, &ViewSettings::default(), &control)
        };
        assert!(with(Order::Abandon).is_none());
        let unfinished = with(Order::Finish).unwrap();
        assert!(!unfinished.complete);
        assert_eq!(unfinished.direct.len(), (PIXELS * PIXELS) as usize);
        assert!(with(Order::Go).unwrap().complete);
    }
}
