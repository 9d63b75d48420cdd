//! Light that comes to a receiver from diffuse surfaces, straight and by specular chains: an adaptive
//! cubature over the hemisphere, and the row of links that it leaves behind.
//!
//! The hemisphere is the unit square, mapped so that equal areas receive equally (Shirley and Chiu's map
//! to the disk, raised to the directions above it): uniform light is integrated exactly, whatever the
//! cells. A cell has samples at its centre, of weight 2/3, and at its corners, 1/12 each, which is exact for
//! quadratics; corners are shared. The worst cell is quartered until the error is within the tolerance.
//!
//! The error is that of cells all of whose samples see the same things, added up, and that of cells with an
//! outline in them, of which nothing is known but what could be at most: these errors are as often positive
//! as negative, and are added up as such, at twice their standard deviation. Outlines that run along a row
//! of cells would be wrong in all of them alike: the square is turned against the axes of the scene, so that
//! straight edges of rooms do not.
//!
//! A row does not depend on radiosities, but for where it is fine; with other radiosities of much the same
//! pattern it can be used again without a ray.

use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::FRAC_PI_4;

use super::settings::Receiver;
use crate::geometry::{Ray, Rgb, UnitVector3, Vector3, math, tangent_frame};
use crate::scene::ShapeId;
use crate::surface::ChartPoint;
use crate::trace::tree::{Leaf, Limits, Losses, Sight, Trunk, sight};
use crate::trace::{Anchor, Tracer};

/// A diffuse surface point that shines on a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The shape.
    pub shape: ShapeId,
    /// Whether it is its front.
    pub front: bool,
    /// The point.
    pub site: ChartPoint,
    /// Irradiance for a radiosity of 1.
    pub weight: Rgb,
    /// Fraction of the receiver's flux that arrives there if it shines evenly itself.
    pub flux: Rgb,
    /// Interactions in between.
    pub depth: u32,
}

/// What a receiver sees of diffuse surfaces, and where its own light goes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Row {
    /// Points seen.
    pub links: Vec<Link>,
    /// Fractions of its flux that do not come to diffuse surfaces: without meeting a specular one, and after.
    pub losses: [Losses; 2],
}

/// Light from diffuse surfaces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gathered {
    /// Irradiance [W/m²].
    pub irradiance: Rgb,
    /// Estimated error of its luminance [W/m²]: of the cubature, not of the radiosities.
    pub error: f64,
    /// Whether that is within the tolerance.
    pub met: bool,
    /// Rays traced.
    pub rays: u64,
    /// Where it comes from.
    pub row: Row,
}

/// How finely.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HemisphereSettings {
    /// Where branches end.
    pub limits: Limits,
    /// Error that is allowed, of the luminance [W/m²].
    pub tolerance: f64,
    /// Most samples; a receiver that needs more is reported as not met.
    pub max_samples: usize,
}

/// Samples are at multiples of 2⁻¹².
const UNITS: u32 = 1 << 12;

/// Cells of level 3 are 8 × 8: 145 samples.
const COARSEST: u8 = 3;
/// The finest have their centre between two units.
const FINEST: u8 = 11;

/// Directions end this far from the horizon, as a part of the disk's radius: where a ray in the surface's
/// own plane would meet what touches it by rounding.
const HORIZON: f64 = 1e-9;

/// Angle by which the square is turned about the normal [rad]: the golden one, far from all simple ones.
const TURN: f64 = 2.399_963_229_728_653;

/// Standard deviations of the errors of outlines that count as error.
const DEVIATIONS: f64 = 2.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Cell {
    level: u8,
    x: u32,
    y: u32,
}

impl Cell {
    fn size(&self) -> u32 {
        UNITS >> self.level
    }

    /// Corners, the first and the third opposite each other, then the centre [units].
    fn samples(&self) -> [(u32, u32); 5] {
        let s = self.size();
        let (x, y) = (self.x * s, self.y * s);
        [(x, y), (x + s, y), (x + s, y + s), (x, y + s), (x + s / 2, y + s / 2)]
    }

    fn quarters(&self) -> [Self; 4] {
        let (x, y) = (2 * self.x, 2 * self.y);
        [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| Self {
            level: self.level + 1,
            x,
            y,
        })
    }

    /// Of the unit square.
    fn area(&self) -> f64 {
        let s = f64::from(self.size()) / f64::from(UNITS);
        s * s
    }
}

/// Weights of corners and centre.
const WEIGHTS: [f64; 5] = [1.0 / 12.0, 1.0 / 12.0, 1.0 / 12.0, 1.0 / 12.0, 2.0 / 3.0];

struct Sample {
    sight: Sight,
    /// π times the luminance of the radiance that comes from there [W/m²].
    light: f64,
    rgb: Rgb,
    weight: f64,
}

/// Gathers at a receiver; `radiosity` tells that of a surface point [W/m²].
pub fn gather(
    tracer: &Tracer<'_>,
    receiver: &Receiver,
    start: &[Anchor],
    radiosity: &dyn Fn(&Leaf) -> Rgb,
    settings: &HemisphereSettings,
) -> Gathered {
    let mut hemisphere = Hemisphere {
        tracer,
        receiver,
        frame: turned_frame(&receiver.normal),
        start,
        radiosity,
        limits: &settings.limits,
        samples: Vec::new(),
        known: HashMap::new(),
        rays: 0,
    };
    hemisphere.integrate(settings)
}

struct Hemisphere<'h> {
    tracer: &'h Tracer<'h>,
    receiver: &'h Receiver,
    frame: (Vector3, Vector3),
    start: &'h [Anchor],
    radiosity: &'h dyn Fn(&Leaf) -> Rgb,
    limits: &'h Limits,
    samples: Vec<Sample>,
    known: HashMap<(u32, u32), u32>,
    rays: u64,
}

/// A frame about a normal, turned against the axes.
fn turned_frame(normal: &UnitVector3) -> (Vector3, Vector3) {
    let (s, t) = tangent_frame(normal);
    let (sin, cos) = math::sin_cos(TURN);
    (s * cos + t * sin, t * cos - s * sin)
}

/// Error of one cell.
#[derive(Clone, Copy)]
enum CellError {
    /// By how much it may be off.
    Smooth(f64),
    /// Its standard deviation.
    Outline(f64),
}

impl CellError {
    fn size(self) -> f64 {
        match self {
            Self::Smooth(e) | Self::Outline(e) => e,
        }
    }
}

/// Sum of the errors of cells.
#[derive(Clone, Copy, Default)]
struct ErrorSum {
    smooth: f64,
    variance: f64,
}

impl ErrorSum {
    fn add(&mut self, error: CellError) {
        match error {
            CellError::Smooth(e) => self.smooth += e,
            CellError::Outline(e) => self.variance += e * e,
        }
    }

    fn remove(&mut self, error: CellError) {
        match error {
            CellError::Smooth(e) => self.smooth -= e,
            CellError::Outline(e) => self.variance -= e * e,
        }
    }

    fn total(&self) -> f64 {
        // Running sums may end a rounding below zero.
        self.smooth.max(0.0) + DEVIATIONS * self.variance.max(0.0).sqrt()
    }
}

/// A cell in the queue: the worst first, of equals the first made.
struct Queued {
    error: CellError,
    number: usize,
}

impl PartialEq for Queued {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}
impl Eq for Queued {}
impl PartialOrd for Queued {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Queued {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let sizes = self.error.size().total_cmp(&other.error.size());
        sizes.then(other.number.cmp(&self.number))
    }
}

impl Hemisphere<'_> {
    fn integrate(&mut self, settings: &HemisphereSettings) -> Gathered {
        let mut cells: Vec<(Cell, bool)> = Vec::new();
        let mut queue = BinaryHeap::new();
        let mut sum = ErrorSum::default();
        let side = 1 << COARSEST;
        for y in 0..side {
            for x in 0..side {
                sum.add(self.put(Cell { level: COARSEST, x, y }, &mut cells, &mut queue));
            }
        }
        while sum.total() > settings.tolerance && self.samples.len() < settings.max_samples {
            let Some(worst) = queue.pop() else { break };
            let cell = cells[worst.number].0;
            if worst.error.size() <= 0.0 || cell.level >= FINEST {
                break;
            }
            cells[worst.number].1 = false;
            sum.remove(worst.error);
            for quarter in cell.quarters() {
                sum.add(self.put(quarter, &mut cells, &mut queue));
            }
        }
        let mut sum = ErrorSum::default();
        for (cell, _) in cells.iter().filter(|c| c.1) {
            let numbers = cell.samples().map(|at| self.known[&at]);
            for (n, w) in numbers.iter().zip(WEIGHTS) {
                self.samples[*n as usize].weight += w * cell.area();
            }
            sum.add(self.error(cell, numbers));
        }
        let error = sum.total();
        let mut gathered = Gathered {
            error,
            met: error <= settings.tolerance,
            rays: self.rays,
            ..Gathered::default()
        };
        let surface = |shape: ShapeId| &self.tracer.scene().shape(shape).surface;
        let row = &mut gathered.row;
        for sample in &self.samples {
            gathered.irradiance += sample.rgb * sample.weight;
            for (sum, losses) in row.losses.iter_mut().zip(&sample.sight.losses) {
                *sum += *losses * Rgb::grey(sample.weight);
            }
            row.links.extend(sample.sight.leaves.iter().map(|leaf| Link {
                shape: leaf.anchor.shape,
                front: leaf.front,
                site: surface(leaf.anchor.shape).chart_point(&leaf.anchor.point),
                weight: leaf.throughput * sample.weight,
                flux: leaf.flux * sample.weight,
                depth: leaf.depth,
            }));
        }
        gathered
    }

    /// Puts a cell into the queue; its error.
    fn put(
        &mut self,
        cell: Cell,
        cells: &mut Vec<(Cell, bool)>,
        queue: &mut BinaryHeap<Queued>,
    ) -> CellError {
        let numbers = cell.samples().map(|at| self.sample(at));
        let error = self.error(&cell, numbers);
        queue.push(Queued { error, number: cells.len() });
        cells.push((cell, true));
        error
    }

    /// Estimated error of a cell's integral: where all samples see the same things the same way, what the
    /// corners and the centre disagree by, across either diagonal; else the standard deviation of what is
    /// somewhere between the least and the most that samples see.
    fn error(&self, cell: &Cell, numbers: [u32; 5]) -> CellError {
        let of = |i: usize| &self.samples[numbers[i] as usize];
        let light = [0, 1, 2, 3, 4].map(|i| of(i).light);
        if (0..4).all(|i| of(i).sight.signature == of(4).sight.signature) {
            let bend = |i: usize, j: usize| (light[4] - 0.5 * (light[i] + light[j])).abs();
            return CellError::Smooth(cell.area() * bend(0, 2).max(bend(1, 3)) / 3.0);
        }
        let most = light.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let least = light.into_iter().fold(f64::INFINITY, f64::min);
        // Of an even distribution.
        CellError::Outline(cell.area() * (most - least) / 12f64.sqrt())
    }

    /// The number of a sample, which is traced if it is new.
    fn sample(&mut self, at: (u32, u32)) -> u32 {
        if let Some(&n) = self.known.get(&at) {
            return n;
        }
        let direction = self.direction(at);
        let ray = Ray::new(self.receiver.position, direction.into_inner());
        let trunk = Trunk { ray, length: f64::INFINITY, start: self.start, travelled: 0.0 };
        let sight = sight(self.tracer, &trunk, self.limits);
        self.rays += sight.rays;
        let mut rgb = Rgb::BLACK;
        for leaf in &sight.leaves {
            rgb += leaf.throughput * (self.radiosity)(leaf);
        }
        let n = self.samples.len() as u32;
        self.samples.push(Sample { light: rgb.luminance(), rgb, weight: 0.0, sight });
        self.known.insert(at, n);
        n
    }

    /// The direction of a point of the square.
    fn direction(&self, at: (u32, u32)) -> UnitVector3 {
        let to = |i: u32| f64::from(2 * i) / f64::from(UNITS) - 1.0;
        let (a, b) = (to(at.0), to(at.1));
        let (r, angle) = match (a == 0.0 && b == 0.0, a.abs() > b.abs()) {
            (true, _) => (0.0, 0.0),
            (_, true) => (a, FRAC_PI_4 * (b / a)),
            (_, false) => (b, 2.0 * FRAC_PI_4 - FRAC_PI_4 * (a / b)),
        };
        let r = r * (1.0 - HORIZON);
        let (s, c) = math::sin_cos(angle);
        let up = (1.0 - r * r).sqrt();
        let (t1, t2) = self.frame;
        UnitVector3::new_normalize(
            t1 * (r * c) + t2 * (r * s) + self.receiver.normal.into_inner() * up,
        )
    }
}
