//! The first pass: progressive radiosity with interleaved diffuse and specular iterations (Yu & Wu, 3.2).
//!
//! Lamps shine on the vertices of all meshes by [`Transfer`], exactly; light that was reflected diffusely
//! goes by rows that are gathered once at each vertex and replayed (`transport.rs`). [`Solver::step`] is one
//! turn of the loop of Fig. 4 (`iteration.rs`). The variables of the paper:
//!
//! | printed | here |
//! |---|---|
//! | `rad` | [`Solution`]'s radiosity of a vertex |
//! | `unshot_rad` | that less what a patch's corner has shot straight |
//! | `unshot_specular_rad` | that less what a patch's corner has shot by specular chains |
//! | `tmp_specular_rad` | not needed: in a specular iteration what waits is taken from all patches before any receives |
//!
//! Patches are the triangles of three layers of meshes: those that lamps light, directly and by specular chains,
//! which shoot once, and those that reflected light is received on, which shoot what they have received
//! (`layer.rs`).

mod bright;
mod checkpoint;
mod contact;
mod file;
mod fingerprint;
mod growth;
mod iteration;
mod lamps;
mod landing;
mod layer;
mod ledger;
mod outcome;
mod probe;
mod propagation;
mod rows;
mod sheet;
mod solution;
mod source;
mod transport;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::Rgb;
use crate::scene::Scene;
use crate::trace::Tracer;
use crate::trace::tree::Limits;
use crate::transfer::{Control, LONGEST_CHAIN, Order, TransferSettings};

pub use checkpoint::Checkpoint;
use checkpoint::Known;
pub use file::{SolutionError, SolutionFile, decode_solution, encode_solution};
pub use layer::{Layer, VertexError};
pub use ledger::Ledger;
pub use outcome::Outcome;
pub use probe::{Probe, ProbeLight};
pub use sheet::Sheet;
pub use solution::{Accuracy, Component, Solution};
use source::Source;
use transport::{BoundRow, Fate, Patch, StoredRow, Transport};

/// Who shoots next, and how far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Scheme {
    /// As printed: the patch with the largest unshot radiosity.
    Printed,
    /// The patch with the largest unshot flux.
    #[default]
    Flux,
    /// By flux, and each shot goes by specular chains too, at once.
    Joint,
}

/// What is asked of a solution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolverSettings {
    /// Accuracy of the light of lamps; its relative accuracy is that of the whole.
    pub transfer: TransferSettings,
    /// Who shoots next.
    pub scheme: Scheme,
    /// Length of the first triangles' edges [m]; found from the scene if not given.
    pub edge: Option<f64>,
    /// Vertices of reflected light at which its meshes are no longer refined, and those of specular light; of direct
    /// light, five times as many.
    pub max_vertices: usize,
}

impl Default for SolverSettings {
    fn default() -> Self {
        Self {
            transfer: TransferSettings::default(),
            scheme: Scheme::default(),
            edge: None,
            max_vertices: 40_000,
        }
    }
}

/// What a step did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Iteration {
    /// One patch shot.
    Diffuse,
    /// All specular surfaces shot.
    Specular,
}

/// Work and sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SolverCounts {
    /// Diffuse iterations.
    pub diffuse: u64,
    /// Specular iterations.
    pub specular: u64,
    /// Triangles that shoot, by [`Component`] of what they have received.
    pub patches: [usize; 3],
    /// Vertices that receive.
    pub vertices: [usize; 3],
    /// Pairs of a patch and a vertex that it lights: straight, and by specular chains.
    pub links: [usize; 2],
    /// Links followed in all shots, one by one: straight, and by specular chains.
    pub replayed: [u64; 2],
    /// Rays traced to find the links.
    pub rays: u64,
    /// What light is scaled by to conserve flux, less 1, without regard to sign; luminance.
    pub correction: f64,
}

impl SolverCounts {
    /// Iterations of either kind.
    pub fn iterations(&self) -> u64 {
        self.diffuse.saturating_add(self.specular)
    }
}

/// What all layers are made from.
#[derive(Clone, Copy)]
struct Job<'j, 's> {
    scene: &'s Scene,
    sheets: &'j [Sheet],
    tracer: &'j Tracer<'j>,
    /// Length of the first triangles' edges [m].
    edge: f64,
    settings: &'j SolverSettings,
    control: &'j Control<'j>,
}

/// A patch of a layer, that by the number of its [`Component`].
type Shooter = (usize, Patch);

/// The loop, and the only state that changes.
#[derive(Clone)]
pub struct Solver<'s> {
    settings: SolverSettings,
    solution: Solution<'s>,
    /// By [`Component`].
    sources: [Source; 3],
    /// By vertex: what rows say that is received of all that was shot [W/m²],
    received: Vec<Rgb>,
    /// and the factor on that, by which flux is conserved.
    factor: Rgb,
    /// Patches to shoot next, the last first.
    agenda: Vec<Shooter>,
    ledger: Ledger,
    counts: SolverCounts,
    complete: bool,
    /// Whether what waits no longer matters.
    rests: bool,
}

/// Branches of a ray tree of less throughput than this part of the accuracy are cut.
const THROUGHPUT: f64 = 0.01;

/// For stages after one for which there was no time.
const HALT: Control<'static> = Control { order: &|| Order::Finish, progress: &|_, _, _| {} };

/// Where all light is reflected, none comes to rest: more than this is not believed of a mean reflectance.
const MOST_REFLECTED: f64 = 0.999;

/// Triangles at first, lamps' and mirrors' surfaces counted as if they had some too.
const FIRST_TRIANGLES: f64 = 2000.0;

/// Shortest edges of triangles, as a part of the first ones.
const SHORTEST: f64 = 1.0 / 32.0;

impl<'s> Solver<'s> {
    /// Makes meshes, lights them from lamps, and gathers rows. `None` if `control` says [`Order::Abandon`].
    pub fn new(
        scene: &'s Scene,
        tracer: &Tracer<'_>,
        settings: &SolverSettings,
        control: &Control<'_>,
    ) -> Option<Self> {
        Self::build(scene, tracer, settings, control, &mut Checkpoint::default(), false)
    }

    /// The same, and what the checkpoint knows by a run with the same scene and settings is not computed again: the bits
    /// are those of [`Solver::new`]. In the end it knows what was computed, also if `control` says [`Order::Abandon`],
    /// but for the loop ([`Solver::keep_state`]).
    pub fn resume(
        scene: &'s Scene,
        tracer: &Tracer<'_>,
        settings: &SolverSettings,
        control: &Control<'_>,
        checkpoint: &mut Checkpoint,
    ) -> Option<Self> {
        Self::build(scene, tracer, settings, control, checkpoint, true)
    }

    /// Either; whether rows are to be `kept`, which takes memory.
    fn build(
        scene: &'s Scene,
        tracer: &Tracer<'_>,
        settings: &SolverSettings,
        control: &Control<'_>,
        checkpoint: &mut Checkpoint,
        kept: bool,
    ) -> Option<Self> {
        let edge = first_edge(scene, settings);
        let sheets = Sheet::all(scene);
        let go = || (control.order)() != Order::Abandon;
        let job = Job { scene, sheets: &sheets, tracer, edge, settings, control };
        let landings = lamps::Landings::new(&job);
        let (direct, mut complete) = lamps::direct(&job, &mut checkpoint.direct, &landings);
        if !go() {
            return None;
        }
        // What a stage computes depends on all that the stage before has.
        let job = if complete { job } else { Job { control: &HALT, ..job } };
        let (specular, whole) = lamps::specular(&job, &mut checkpoint.specular, &landings, &direct);
        complete &= whole;
        let job = if complete { job } else { Job { control: &HALT, ..job } };
        let dark = Layer::dark(scene, &sheets, edge);
        let mut solution = Solution::new(scene, sheets.clone(), [direct, specular, dark]);
        if !go() {
            return None;
        }
        let mut counts = SolverCounts::default();
        let limits = limits(&settings.transfer);
        let (growths, whole) = rows::gather_rows(&job, &solution, &limits, &mut checkpoint.rows);
        complete &= whole;
        let error: Vec<VertexError> =
            growths.iter().flat_map(|g| g.vertex_errors(|l| l.error)).collect();
        let (mut meshes, mut seen) = (Vec::new(), Vec::new());
        for g in growths {
            meshes.push(g.mesh);
            seen.push((g.light, g.is_computed));
        }
        if !go() {
            checkpoint.rows = Known::new(&meshes, seen);
            return None;
        }
        let each = || seen.iter().flat_map(|s| &s.0);
        counts.rays = each().map(|seen| seen.rays).sum();
        let rows: Vec<&StoredRow> = each().map(|seen| &seen.row).collect();
        let fates: Vec<Fate> = each().map(|seen| seen.fate).collect();
        let dark = vec![Rgb::BLACK; rows.len()];
        let indirect = Layer::new(solution.sheets(), meshes, dark, error);
        let sources = [&solution.layers[0], &solution.layers[1], &indirect].map(|layer| {
            // Where a vertex sends its light is known at the vertices that have rows.
            let of = |(sheet, v): (usize, u32)| {
                let site = layer.meshes()[sheet].vertices()[v as usize].site;
                let (patch, weights) = indirect.locate(sheet, &site);
                let corners = indirect.patches[patch as usize].vertices;
                Fate::between(corners.map(|c| &fates[c as usize]), weights)
            };
            let fates = layer.vertices().map(of).collect();
            let bind = |row| BoundRow::new(row, &|sheet, site| layer.locate(sheet, site));
            let bound: Vec<BoundRow> = rows.par_iter().copied().map(bind).collect();
            let transport = Transport::new(layer.patches.len(), &bound, fates);
            Source::new(transport, layer.patches.len(), &indirect.area)
        });
        if kept {
            checkpoint.rows = Known::new(indirect.meshes(), seen);
        }
        *solution.indirect_mut() = indirect;
        counts.patches = solution.layers.each_ref().map(|l| l.patches.len());
        counts.vertices = solution.layers.each_ref().map(|l| l.area.len());
        for source in &sources {
            let links = source.transport.counts();
            counts.links = [counts.links[0] + links[0], counts.links[1] + links[1]];
        }
        let mut solver = Self {
            settings: *settings,
            solution,
            sources,
            received: vec![Rgb::BLACK; counts.vertices[2]],
            factor: Rgb::WHITE,
            agenda: Vec::new(),
            ledger: Ledger::default(),
            counts,
            complete,
            rests: false,
        };
        let state = checkpoint.state.take().filter(|_| complete);
        if !state.is_some_and(|state| solver.restore(*state)) {
            solver.receive_from_lamps(scene, tracer);
        }
        Some(solver)
    }

    /// Lamps have shone: the first shots of all.
    fn receive_from_lamps(&mut self, scene: &Scene, tracer: &Tracer<'_>) {
        let [(direct, kept), (specular, also_kept), _] =
            self.solution.layers.each_ref().map(Layer::flux);
        let (received, kept) = (direct + specular, kept + also_kept);
        let losses = lamps::losses(scene, tracer, &self.limits());
        self.ledger.emitted = scene.emitted_flux();
        self.ledger.shoot(scene.emitted_flux(), &losses, received, kept);
    }

    /// Lets others shoot from now on. What has been shot stays as it is: the scheme changes the way to the answer.
    pub fn set_scheme(&mut self, scheme: Scheme) {
        self.agenda.clear();
        self.settings.scheme = scheme;
    }

    /// Where ray trees end.
    pub fn limits(&self) -> Limits {
        limits(&self.settings.transfer)
    }

    /// Where the flux is.
    pub fn ledger(&self) -> &Ledger {
        &self.ledger
    }

    /// Work so far.
    pub fn counts(&self) -> &SolverCounts {
        &self.counts
    }

    /// Makes the solution ready to be read: its interpolation quadratic, its errors those of all that lights it. To be
    /// called after the last step.
    pub fn finish(&mut self) {
        self.solution.indirect_mut().estimate_interpolation(&[]);
        propagation::pass_on(&mut self.solution.layers, &self.sources);
        // Either what rows say is right, or flux. What comes to black surfaces, or leaves, is known by rows only, as is what
        // comes to others: that it is wrong by as much adds up over all reflections.
        let lost = self.balance().lost();
        let indirect = self.solution.indirect_mut();
        let (_, reflected) = indirect.area_and_reflectance();
        let bounces = 1.0 / (1.0 - reflected.min(MOST_REFLECTED));
        let scaled = (self.factor - Rgb::WHITE).map(|x| x.abs() + x.abs().min(lost) * bounces);
        for (light, error) in self.received.iter().zip(&mut indirect.error) {
            error.own += (*light * scaled).luminance().abs();
        }
        indirect.clamp_to_positive();
        indirect.bend();
    }

    /// What there is so far.
    pub fn solution(&self) -> &Solution<'s> {
        &self.solution
    }

    /// Whether there was time for meshes and rows as fine as asked for.
    pub fn is_complete(&self) -> bool {
        self.complete
    }
}

/// Length of the first triangles' edges [m].
fn first_edge(scene: &Scene, settings: &SolverSettings) -> f64 {
    settings.edge.unwrap_or_else(|| (scene.surface_area() / FIRST_TRIANGLES).sqrt())
}

fn limits(settings: &TransferSettings) -> Limits {
    let accuracy = settings.relative;
    Limits {
        max_specular: settings.max_specular.min(LONGEST_CHAIN),
        throughput: THROUGHPUT * accuracy,
        diffuse_throughput: THROUGHPUT * accuracy,
        lamps: false,
    }
}
