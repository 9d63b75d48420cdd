//! The first pass: progressive radiosity with interleaved diffuse and specular iterations (Yu & Wu, 3.2).
//!
//! Lamps shine on the vertices of all meshes by [`Transfer`], exactly; light that was reflected diffusely
//! goes by rows that are gathered once at each vertex and replayed (`transport.rs`). [`Solver::step`] is one
//! turn of the loop of Fig. 4. The variables of the paper:
//!
//! | printed | here |
//! |---|---|
//! | `rad` | [`Solution`]'s radiosity of a vertex |
//! | `unshot_rad` | that less what a patch's corner has shot straight |
//! | `unshot_specular_rad` | that less what a patch's corner has shot by specular chains |
//! | `tmp_specular_rad` | what all vertices receive in a specular iteration, given to them at its end |
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
use crate::trace::tree::{Limits, Losses};
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
use source::{Balance, Source, Way};
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
    /// What shots were scaled by to conserve flux, less 1, without regard to sign; mean over all flux shot.
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

/// What to do next.
enum Plan {
    /// Nothing: what waits does not matter.
    Rest,
    /// Patches to shoot, the last first.
    Diffuse(Vec<Shooter>),
    Specular,
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
    /// Patches to shoot next, the last first.
    agenda: Vec<Shooter>,
    ledger: Ledger,
    counts: SolverCounts,
    /// All flux shot so far, its luminance [W].
    shot: f64,
    /// What the lamps' shots lost or won [W].
    first_discretisation: Rgb,
    complete: bool,
    /// Whether what waits no longer matters.
    rests: bool,
}

/// Branches of a ray tree of less throughput than this part of the accuracy are cut.
const THROUGHPUT: f64 = 0.01;

/// For stages after one for which there was no time.
const HALT: Control<'static> = Control { order: &|| Order::Finish, progress: &|_, _, _| {} };

/// Part of the tolerance that is for what is never shot.
const UNSHOT: f64 = 0.05;

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
        let (direct, mut complete) = lamps::direct(&job, &mut checkpoint.direct);
        if !go() {
            return None;
        }
        // What a stage computes depends on all that the stage before has.
        let job = if complete { job } else { Job { control: &HALT, ..job } };
        let (specular, whole) = lamps::specular(&job, &mut checkpoint.specular, &direct);
        complete &= whole;
        let job = if complete { job } else { Job { control: &HALT, ..job } };
        let dark = Layer::dark(scene, &sheets, edge);
        let mut solution = Solution::new(sheets.clone(), [direct, specular, dark]);
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
            agenda: Vec::new(),
            shot: 0.0,
            first_discretisation: Rgb::BLACK,
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
        self.first_discretisation = self.ledger.discretisation;
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

    /// Flux that waits at all patches of a layer, straight and towards specular surfaces, luminances [W].
    fn waiting(&self, layer: usize) -> Vec<[f64; 2]> {
        let (source, layer) = (&self.sources[layer], &self.solution.layers[layer]);
        (0..layer.patches.len()).into_par_iter().map(|p| source.waiting(layer, p)).collect()
    }

    /// One turn of the loop of Fig. 4; `None` when what waits no longer matters.
    pub fn step(&mut self) -> Option<Iteration> {
        if self.agenda.is_empty() {
            match self.plan() {
                Plan::Rest => {
                    self.rests = true;
                    return None;
                }
                Plan::Specular => {
                    let all = |l: usize| {
                        (0..self.solution.layers[l].patches.len()).map(move |p| (l, p as Patch))
                    };
                    let shooters: Vec<Shooter> = (0..3).flat_map(all).collect();
                    self.conserve(Way::Specular);
                    self.shoot_specular(&shooters);
                    self.counts.specular += 1;
                    return Some(Iteration::Specular);
                }
                Plan::Diffuse(shooters) => {
                    self.conserve(Way::Straight);
                    if self.settings.scheme == Scheme::Joint {
                        self.conserve(Way::Specular);
                    }
                    self.agenda = shooters;
                }
            }
        }
        let shooter = self.agenda.pop()?;
        self.shoot_straight(shooter);
        if self.settings.scheme == Scheme::Joint {
            self.shoot_specular(&[shooter]);
        }
        self.counts.diffuse += 1;
        Some(Iteration::Diffuse)
    }

    /// Finds the factor by which what is shot one way is conserved.
    fn conserve(&mut self, way: Way) {
        let owed = self.ledger.discretisation - self.first_discretisation;
        let mut balance = Balance::default();
        for (source, layer) in self.sources.iter().zip(&self.solution.layers) {
            balance += source.balance(layer, way);
        }
        let factor = balance.factor(owed);
        for source in &mut self.sources {
            source.factors[way as usize] = factor;
        }
    }

    /// What to do next. Looking for the next shooter costs as much as some shots, so that by flux all shoot
    /// that have at least half of the largest, the largest first.
    fn plan(&self) -> Plan {
        let all = [0, 1, 2].map(|layer| self.waiting(layer));
        let each = || {
            all.iter()
                .enumerate()
                .flat_map(|(l, of)| of.iter().enumerate().map(move |(p, w)| ((l, p as Patch), *w)))
        };
        let sums = each().fold([0.0; 2], |sum, (_, w)| [sum[0] + w[0].abs(), sum[1] + w[1].abs()]);
        if sums[0] + sums[1] <= self.negligible() {
            return Plan::Rest;
        }
        let scheme = self.settings.scheme;
        if scheme != Scheme::Joint && sums[1] > sums[0] {
            return Plan::Specular;
        }
        let key = |(layer, patch): Shooter, waiting: [f64; 2]| match scheme {
            Scheme::Printed => {
                let source = &self.sources[layer];
                let unshot =
                    source.unshot(&self.solution.layers[layer], patch as usize, Way::Straight);
                unshot.iter().map(Rgb::luminance).sum::<f64>() / 3.0
            }
            // Where interpolation has overshot, less than nothing waits.
            Scheme::Flux => waiting[0].abs(),
            Scheme::Joint => (waiting[0] + waiting[1]).abs(),
        };
        let mut keys: Vec<(f64, Shooter)> = each().map(|(s, w)| (key(s, w), s)).collect();
        // Taken from the end; of equals the lower number first.
        keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        let largest = keys.last().map_or(0.0, |k| k.0);
        let first = match scheme {
            Scheme::Printed => keys.len().saturating_sub(1),
            _ => keys.partition_point(|k| k.0 < 0.5 * largest),
        };
        Plan::Diffuse(keys[first..].iter().map(|k| k.1).collect())
    }

    /// Flux that may be left waiting: what it could still bring, mean over all surfaces, is a small part of
    /// the accuracy, of the reflected light alone [W].
    fn negligible(&self) -> f64 {
        let solution = &self.solution;
        let indirect = solution.layer(Component::Indirect);
        let (_, reflected) = indirect.area_and_reflectance();
        let received = indirect.flux().0.luminance();
        UNSHOT * self.settings.transfer.relative * received * (1.0 - reflected.min(0.999))
    }

    /// A diffuse iteration: one patch shoots straight.
    fn shoot_straight(&mut self, (layer, patch): Shooter) {
        let patch = patch as usize;
        let unshot = self.sources[layer].take(&self.solution.layers[layer], patch, Way::Straight);
        let factor = self.sources[layer].factor(Way::Straight);
        let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
        for entry in self.sources[layer].transport.straight(patch as Patch) {
            let mut light = Rgb::BLACK;
            for c in 0..3 {
                light += unshot[c] * f64::from(entry.weights[c]);
            }
            light = light * factor;
            let (flux, kept) = self.solution.indirect_mut().receive(entry.vertex as usize, light);
            received += flux;
            absorbed += kept;
        }
        let followed = self.sources[layer].transport.straight(patch as Patch).len();
        self.counts.replayed[Way::Straight as usize] += followed as u64;
        self.enter((layer, patch as Patch), unshot, Way::Straight, received, absorbed);
    }

    /// A specular iteration for some patches: all specular surfaces shoot what waits there.
    fn shoot_specular(&mut self, shooters: &[Shooter]) {
        let mut light = vec![Rgb::BLACK; self.solution.layer(Component::Indirect).area.len()];
        let mut shots = Vec::with_capacity(shooters.len());
        for &(layer, patch) in shooters {
            let lit = &self.solution.layers[layer];
            let unshot = self.sources[layer].take(lit, patch as usize, Way::Specular);
            let factor = self.sources[layer].factor(Way::Specular);
            let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
            let reflected = self.solution.layer(Component::Indirect);
            let followed = self.sources[layer].transport.specular(patch);
            self.counts.replayed[Way::Specular as usize] += followed.len() as u64;
            for entry in followed {
                let v = entry.vertex as usize;
                let mut own = Rgb::BLACK;
                for c in 0..3 {
                    own += unshot[c] * Rgb(entry.weights[c].map(f64::from));
                }
                own = own * factor;
                light[v] += own;
                let flux = own * reflected.area[v];
                received += flux;
                absorbed += flux - flux * reflected.reflectance[v];
            }
            shots.push(((layer, patch), unshot, received, absorbed));
        }
        for (v, light) in light.into_iter().enumerate() {
            self.solution.indirect_mut().receive(v, light);
        }
        for (shooter, unshot, received, absorbed) in shots {
            self.enter(shooter, unshot, Way::Specular, received, absorbed);
        }
    }

    /// Enters a shot into the ledger.
    fn enter(
        &mut self,
        (layer, patch): Shooter,
        unshot: [Rgb; 3],
        way: Way,
        received: Rgb,
        absorbed: Rgb,
    ) {
        let corners = self.solution.layers[layer].patches[patch as usize];
        let (mut shot, mut losses) = (Rgb::BLACK, Losses::default());
        for c in 0..3 {
            let fate: &Fate = &self.sources[layer].transport.fates[corners.vertices[c] as usize];
            let flux = unshot[c] * corners.weights[c];
            shot += flux * fate.share(way);
            losses += fate.losses[way as usize] * flux;
        }
        let corrected = (self.sources[layer].factor(way) - Rgb::WHITE).map(f64::abs).luminance();
        let flux = shot.luminance();
        if flux > 0.0 {
            self.shot += flux;
            self.counts.correction += (corrected - self.counts.correction) * flux / self.shot;
        }
        self.ledger.unshot = self.ledger.unshot - shot;
        self.ledger.shoot(shot, &losses, received, absorbed);
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
        self.solution.indirect_mut().bend();
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
