//! Light that comes to a receiver from diffuse surfaces, straight and by specular chains: an adaptive
//! cubature over the hemisphere, and the row of links that it leaves behind.
//!
//! Directions are (q, φ): πq/2 from the normal, φ about it. Light from surfaces that the receiver's own plane
//! meets is smooth in q up to the horizon; in coordinates that spread the cosine evenly it has infinite
//! derivatives there, and every room is then a few tenths of a percent too dark, all in the same direction.
//! A cell has samples at its centre and its corners, weighted so that uniform light is integrated exactly and
//! quadratic functions are but for the density's curvature. The worst cell is quartered until the error is within
//! the tolerance.
//!
//! The error is that of cells all of whose samples see the same things, added up, and that of cells with an
//! outline in them, of which nothing is known but what could be at most: these errors are as often positive
//! as negative, and are added up as such, at twice their standard deviation. Outlines that run along a row
//! of cells would be wrong in all of them alike: φ is turned against the axes of the scene, so that
//! straight edges of rooms do not.
//!
//! A row does not depend on radiosities, but for where it is fine; with other radiosities of much the same
//! pattern it can be used again without a ray.

use std::collections::{BTreeSet, BinaryHeap, HashMap};
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::hash::{BuildHasherDefault, Hasher};
use std::sync::LazyLock;

use super::bright::Shining;
use super::settings::Receiver;
use crate::geometry::{Ray, Rgb, UnitVector3, Vector3, math, tangent_frame};
use crate::scene::ShapeId;
use crate::surface::ChartPoint;
use crate::trace::tree::{Leaf, Limits, Losses, Trunk, Workspace, sight_in};
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

/// Samples are at multiples of 2⁻¹² along q, and of a turn's 2⁻¹³ along φ.
const UNITS: u32 = 1 << 12;
const TURN_UNITS: u32 = 2 * UNITS;

/// Cells of level 3 are 8 × 16: 257 samples.
const COARSEST: u8 = 3;
/// The finest have their centre between two units.
const FINEST: u8 = 11;

/// Directions end this far from the horizon, as a part of a right angle: where a ray in the surface's
/// own plane would meet what touches it by rounding.
const HORIZON: f64 = 1e-9;

/// Angle by which φ is turned about the normal [rad]: the golden one, far from all simple ones.
const TURN: f64 = 2.399_963_229_728_653;

/// What the quarters of a cell may be off by together, as a part of what they differ by from the whole: for
/// functions of bounded fourth derivatives it is a fifteenth.
const QUARTERS: f64 = 0.25;

/// What the middle of a cell that has not been quartered may differ from its corners' mean, as a part of it, for
/// other reasons than second derivatives.
const UNPROVED: f64 = 0.5;
const PROVED: f64 = 0.05;

/// Bright places in a cell are looked for if they may bring this part of the tolerance and fill less than this part of it (a disk as large as a cell meets one of its samples), and
/// down to cells of this level: 0.7°.
const WORTH: f64 = 0.25;
const FILLED: f64 = 1.0;
const MOST_FORCED: u8 = 7;

/// A bright place as a receiver sees it if nothing is in the way.
#[derive(Clone, Copy)]
struct Seen {
    /// q, and φ in turns.
    at: [f64; 2],
    irradiance: f64,
    solid_angle: f64,
}

/// Standard deviation of what a cell's five samples make of its irradiance, as a part of what they differ by, where a
/// straight outline runs through it somewhere: .1495, by 20,000 lines at random.
const OUTLINE: f64 = 0.15;

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

    /// The one of a level that holds q and φ in turns.
    fn at(level: u8, [q, turn]: [f64; 2]) -> Self {
        let across = f64::from(1u32 << level);
        let place = |f: f64, n: f64| (f * n).min(n - 1.0) as u32;
        Self { level, x: place(q, across), y: place(turn, 2.0 * across) }
    }

    fn solid_angle(&self) -> f64 {
        let across = f64::from(1u32 << self.level);
        let cosine = |x: u32| math::cos(f64::from(x) / across * FRAC_PI_2);
        PI / across * (cosine(self.x) - cosine(self.x + 1))
    }

    /// Corners, the first and the third opposite each other, then the centre: q, φ [units].
    fn samples(&self) -> [(u32, u32); 5] {
        let s = self.size();
        let (x, y) = (self.x * s, self.y * s);
        // At the normal there is no φ.
        [(x, y), (x + s, y), (x + s, y + s), (x, y + s), (x + s / 2, y + s / 2)]
            .map(|(x, y)| (x, if x == 0 { 0 } else { y % TURN_UNITS }))
    }

    fn quarters(&self) -> [Self; 4] {
        let (x, y) = (2 * self.x, 2 * self.y);
        [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| Self {
            level: self.level + 1,
            x,
            y,
        })
    }

    /// Weights of the samples.
    fn weights(&self) -> [f64; 5] {
        let before = (1 << self.level) - (1 << COARSEST);
        TABLES.weights[(before + self.x) as usize]
    }
}

/// What depends on a cell's place alone.
struct Tables {
    /// By level from the coarsest, then by place along q.
    weights: Vec<[f64; 5]>,
    /// Sine and cosine of the angle to the normal and of that about it, by units.
    q: Vec<(f64, f64)>,
    phi: Vec<(f64, f64)>,
}

static TABLES: LazyLock<Tables> = LazyLock::new(|| {
    let angle = |i: u32| f64::from(i) / f64::from(UNITS) * (1.0 - HORIZON) * FRAC_PI_2;
    let turn = |i: u32| f64::from(i) / f64::from(TURN_UNITS) * TAU;
    let levels = COARSEST..=FINEST;
    Tables {
        weights: levels.flat_map(|l| (0..1 << l).map(move |x| weights(l, x))).collect(),
        q: (0..=UNITS).map(|i| math::sin_cos(angle(i))).collect(),
        phi: (0..TURN_UNITS).map(|i| math::sin_cos(turn(i))).collect(),
    }
});

/// ∫ of the density π/2 sin πq, over q and turns, times the functions that are 1 at one of a cell's samples and 0 at the
/// others: bilinear, and 2 (s (1 − s) + t (1 − t)) for the centre.
fn weights(level: u8, x: u32) -> [f64; 5] {
    let side = 1.0 / f64::from(1u32 << level);
    let start = f64::from(x) * side;
    let mut moments = [0.0; 3];
    for (s, w) in GAUSS {
        let density = FRAC_PI_2 * math::sin(PI * (start + s * side));
        for (k, m) in moments.iter_mut().enumerate() {
            *m += w * density * s.powi(k as i32);
        }
    }
    let area = 0.5 * side * side;
    let [m0, m1, m2] = moments.map(|m| m * area);
    let centre = 2.0 * (m1 - m2) + m0 / 3.0;
    let (low, high) = (0.5 * (m0 - m1) - 0.25 * centre, 0.5 * m1 - 0.25 * centre);
    [low, high, high, low, centre]
}

/// Gauss's three points of [0, 1] and their weights.
const GAUSS: [(f64, f64); 3] = [
    (0.112_701_665_379_258_3, 5.0 / 18.0),
    (0.5, 4.0 / 9.0),
    (0.887_298_334_620_741_7, 5.0 / 18.0),
];

struct Sample {
    /// Identifies all that is seen there.
    signature: u64,
    /// π times the luminance of the radiance that comes from there [W/m²].
    light: f64,
    rgb: Rgb,
    /// Part of all light that comes to the receiver if it is uniform.
    weight: f64,
    /// Its leaves and losses begin here, in the lists of all.
    first_leaf: usize,
    first_loss: usize,
}

/// Points of the lattice as keys: a multiplication mixes them well enough, and costs a hundredth of
/// what the standard hash does.
#[derive(Default)]
struct PointHasher(u64);

impl Hasher for PointHasher {
    fn finish(&self) -> u64 {
        self.0
    }

    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u32(u32::from(*b)));
    }

    fn write_u32(&mut self, x: u32) {
        let mixed = (self.0.rotate_left(26) ^ u64::from(x)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        self.0 = mixed ^ (mixed >> 29);
    }
}

/// Gathers at a receiver.
pub fn gather(
    tracer: &Tracer<'_>,
    receiver: &Receiver,
    start: &[Anchor],
    shining: &Shining<'_>,
    settings: &HemisphereSettings,
) -> Gathered {
    let mut hemisphere = Hemisphere {
        tracer,
        receiver,
        frame: turned_frame(&receiver.normal),
        start,
        shining,
        limits: &settings.limits,
        samples: Vec::new(),
        leaves: Vec::new(),
        losses: Vec::new(),
        known: HashMap::default(),
        workspace: Workspace::default(),
        rays: 0,
    };
    hemisphere.integrate(settings)
}

struct Hemisphere<'h> {
    tracer: &'h Tracer<'h>,
    receiver: &'h Receiver,
    frame: (Vector3, Vector3),
    start: &'h [Anchor],
    shining: &'h Shining<'h>,
    limits: &'h Limits,
    samples: Vec<Sample>,
    leaves: Vec<Leaf>,
    losses: Vec<[Losses; 2]>,
    known: HashMap<(u32, u32), u32, BuildHasherDefault<PointHasher>>,
    workspace: Workspace,
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

/// A cell that was looked at.
#[derive(Clone, Copy)]
struct Placed {
    cell: Cell,
    /// Its irradiance, the luminance [W/m²].
    light: f64,
    error: CellError,
    /// Whether it is not quartered.
    is_whole: bool,
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
        let mut cells: Vec<Placed> = Vec::new();
        let mut queue = BinaryHeap::new();
        let mut sum = ErrorSum::default();
        let side = 1 << COARSEST;
        let mut first: Vec<Cell> = (0..2 * side)
            .flat_map(|y| (0..side).map(move |x| Cell { level: COARSEST, x, y }))
            .collect();
        let quartered = self.around_bright(settings.tolerance);
        let mut next = 0;
        while let Some(&cell) = first.get(next) {
            next += 1;
            if quartered.contains(&cell) {
                first.extend(cell.quarters());
                continue;
            }
            let cell = self.place(cell, None);
            sum.add(cell.error);
            queue.push(Queued { error: cell.error, number: cells.len() });
            cells.push(cell);
        }
        while sum.total() > settings.tolerance && self.samples.len() < settings.max_samples {
            let Some(worst) = queue.pop() else { break };
            let whole = cells[worst.number];
            if worst.error.size() <= 0.0 || whole.cell.level >= FINEST {
                break;
            }
            cells[worst.number].is_whole = false;
            sum.remove(worst.error);
            let mut quarters = whole.cell.quarters().map(|q| self.place(q, None));
            if let CellError::Smooth(_) = whole.error {
                let parts: f64 = quarters.iter().map(|q| q.light).sum();
                let share = QUARTERS * 0.25 * (parts - whole.light).abs();
                quarters = whole.cell.quarters().map(|q| self.place(q, Some(share)));
            }
            for quarter in quarters {
                sum.add(quarter.error);
                queue.push(Queued { error: quarter.error, number: cells.len() });
                cells.push(quarter);
            }
        }
        let mut sum = ErrorSum::default();
        for placed in cells.iter().filter(|c| c.is_whole) {
            for (at, w) in placed.cell.samples().iter().zip(placed.cell.weights()) {
                self.samples[self.known[at] as usize].weight += w;
            }
            sum.add(placed.error);
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
        let next = self.samples.iter().skip(1).map(|s| (s.first_leaf, s.first_loss));
        let ends = next.chain([(self.leaves.len(), self.losses.len())]);
        for (sample, (last_leaf, last_loss)) in self.samples.iter().zip(ends) {
            gathered.irradiance += sample.rgb * sample.weight;
            for losses in &self.losses[sample.first_loss..last_loss] {
                for (sum, losses) in row.losses.iter_mut().zip(losses) {
                    *sum += *losses * Rgb::grey(sample.weight);
                }
            }
            row.links.extend(self.leaves[sample.first_leaf..last_leaf].iter().map(|leaf| Link {
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

    /// Cells that are quartered before any is judged, since samples of theirs may all miss what is small and bright.
    fn around_bright(&self, tolerance: f64) -> BTreeSet<Cell> {
        let mut quartered = BTreeSet::new();
        let mut seen: Vec<(Cell, Vec<Seen>)> = Vec::new();
        for bright in self.shining.bright {
            let irradiance = bright.irradiance(self.receiver);
            if irradiance <= 0.0 {
                continue;
            }
            let away = (bright.position - self.receiver.position).normalize();
            let (t1, t2) = self.frame;
            let at = [
                math::acos(self.receiver.normal.dot(&away).min(1.0)) / FRAC_PI_2,
                math::atan2(away.dot(&t2), away.dot(&t1)).rem_euclid(TAU) / TAU,
            ];
            let seen_there =
                Seen { at, irradiance, solid_angle: bright.solid_angle(self.receiver) };
            let cell = Cell::at(COARSEST, at);
            match seen.iter_mut().find(|s| s.0 == cell) {
                Some((_, list)) => list.push(seen_there),
                None => seen.push((cell, vec![seen_there])),
            }
        }
        while let Some((cell, list)) = seen.pop() {
            let irradiance: f64 = list.iter().map(|s| s.irradiance).sum();
            let filled: f64 = list.iter().map(|s| s.solid_angle).sum();
            if irradiance <= WORTH * tolerance
                || filled >= FILLED * cell.solid_angle()
                || cell.level >= MOST_FORCED
            {
                continue;
            }
            quartered.insert(cell);
            for quarter in cell.quarters() {
                let inside = list.iter().filter(|s| Cell::at(quarter.level, s.at) == quarter);
                let inside: Vec<Seen> = inside.copied().collect();
                if !inside.is_empty() {
                    seen.push((quarter, inside));
                }
            }
        }
        quartered
    }

    /// Looks at a cell's samples. Its error is estimated: where all samples see the same things the same way, from what
    /// the corners and the centre disagree by, across either diagonal, and what quartering the whole that it is
    /// a part of has `changed`, if that was smooth too; else it is the standard deviation of
    /// what samples make of an outline.
    fn place(&mut self, cell: Cell, changed: Option<f64>) -> Placed {
        let numbers = cell.samples().map(|at| self.sample(at));
        let weights = cell.weights();
        let all: f64 = weights.iter().sum();
        let of = |i: usize| &self.samples[numbers[i] as usize];
        let light = [0, 1, 2, 3, 4].map(|i| of(i).light);
        let error = if (0..4).all(|i| of(i).signature == of(4).signature) {
            let bend = |i: usize, j: usize| (light[4] - 0.5 * (light[i] + light[j])).abs();
            let bend = all * bend(0, 2).max(bend(1, 3)) / 3.0;
            CellError::Smooth(match changed {
                Some(changed) => changed + PROVED * bend,
                None => UNPROVED * bend,
            })
        } else {
            let most = light.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let least = light.into_iter().fold(f64::INFINITY, f64::min);
            CellError::Outline(all * (most - least) * OUTLINE)
        };
        let light = (0..5).map(|i| weights[i] * light[i]).sum();
        Placed { cell, light, error, is_whole: true }
    }

    /// The number of a sample, which is traced if it is new.
    fn sample(&mut self, at: (u32, u32)) -> u32 {
        if let Some(&n) = self.known.get(&at) {
            return n;
        }
        let direction = self.direction(at);
        let ray = Ray::new(self.receiver.position, direction.into_inner());
        let trunk = Trunk { ray, length: f64::INFINITY, start: self.start, travelled: 0.0 };
        let sight = sight_in(&mut self.workspace, self.tracer, &trunk, self.limits);
        self.rays += sight.rays;
        let mut rgb = Rgb::BLACK;
        for leaf in &sight.leaves {
            rgb += leaf.throughput * (self.shining.radiosity)(leaf);
        }
        let n = self.samples.len() as u32;
        self.samples.push(Sample {
            signature: sight.signature,
            light: rgb.luminance(),
            rgb,
            weight: 0.0,
            first_leaf: self.leaves.len(),
            first_loss: self.losses.len(),
        });
        self.leaves.extend_from_slice(&sight.leaves);
        if sight.losses != [Losses::default(); 2] {
            self.losses.push(sight.losses);
        }
        self.known.insert(at, n);
        n
    }

    /// The direction of a point.
    fn direction(&self, at: (u32, u32)) -> UnitVector3 {
        let (sin, cos) = TABLES.q[at.0 as usize];
        let (s, c) = TABLES.phi[at.1 as usize];
        let (t1, t2) = self.frame;
        UnitVector3::new_normalize(
            t1 * (sin * c) + t2 * (sin * s) + self.receiver.normal.into_inner() * cos,
        )
    }
}
