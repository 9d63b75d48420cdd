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

mod balance;
mod lamps;
mod ledger;
mod rows;
mod sheet;
mod solution;
mod transport;

use crate::geometry::Rgb;
use crate::scene::Scene;
use crate::trace::Tracer;
use crate::trace::tree::{Limits, Losses};
use crate::transfer::{LONGEST_CHAIN, Transfer, TransferSettings};

pub use ledger::Ledger;
pub use sheet::Sheet;
pub use solution::Solution;
use transport::{Fate, Patch, Transport};

/// Who shoots next, and how far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolverSettings {
    /// Accuracy of the light of lamps; its relative accuracy is that of the whole.
    pub transfer: TransferSettings,
    /// Who shoots next.
    pub scheme: Scheme,
    /// Length of the first triangles' edges [m]; found from the scene if not given.
    pub edge: Option<f64>,
    /// Vertices at which meshes are no longer refined.
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
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolverCounts {
    /// Diffuse iterations.
    pub diffuse: u64,
    /// Specular iterations.
    pub specular: u64,
    /// Triangles that shoot.
    pub patches: usize,
    /// Vertices that receive.
    pub vertices: usize,
    /// Pairs of a patch and a vertex that it lights: straight, and by specular chains.
    pub links: [usize; 2],
    /// Rays traced to find them.
    pub rays: u64,
    /// Mean change of a link, as a part of it, that makes transport conserve flux.
    pub balance: f64,
}

/// What to do next.
enum Plan {
    /// Nothing: what waits does not matter.
    Rest,
    /// Patches to shoot, the last first.
    Diffuse(Vec<Patch>),
    Specular,
}

/// The loop, and the only state that changes.
pub struct Solver<'s> {
    settings: SolverSettings,
    solution: Solution<'s>,
    transport: Transport,
    /// By patch and corner: radiosity that was shot, straight and by specular chains.
    shot: Vec<[Rgb; 3]>,
    shot_specular: Vec<[Rgb; 3]>,
    /// Patches to shoot next, the last first.
    agenda: Vec<Patch>,
    ledger: Ledger,
    counts: SolverCounts,
}

/// Branches of a ray tree of less throughput than this part of the accuracy are cut.
const THROUGHPUT: f64 = 0.01;

/// Part of the tolerance that is for what is never shot.
const UNSHOT: f64 = 0.05;

/// Triangles at first, lamps' and mirrors' surfaces counted as if they had some too.
const FIRST_TRIANGLES: f64 = 2000.0;

/// Shortest edges of triangles, as a part of the first ones.
const SHORTEST: f64 = 1.0 / 32.0;

impl<'s> Solver<'s> {
    /// Makes meshes, lights them from lamps, and gathers rows.
    pub fn new(scene: &'s Scene, tracer: &'s Tracer<'s>, settings: &SolverSettings) -> Self {
        let edge = settings.edge.unwrap_or_else(|| (scene.surface_area() / FIRST_TRIANGLES).sqrt());
        let transfer = Transfer::new(scene, tracer, settings.transfer);
        let mut sheets = Sheet::all(scene, edge);
        lamps::illuminate(&mut sheets, &transfer, tracer, SHORTEST * edge, settings);
        let solution = Solution::new(sheets);
        let mut solver = Self {
            settings: *settings,
            transport: Transport::default(),
            shot: vec![[Rgb::BLACK; 3]; solution.patches.len()],
            shot_specular: vec![[Rgb::BLACK; 3]; solution.patches.len()],
            agenda: Vec::new(),
            ledger: Ledger::default(),
            counts: SolverCounts {
                patches: solution.patches.len(),
                vertices: solution.area.len(),
                ..SolverCounts::default()
            },
            solution,
        };
        solver.receive_from_lamps(scene, tracer);
        solver.gather_rows(tracer);
        solver
    }

    /// Lamps have shone: the first shots of all.
    fn receive_from_lamps(&mut self, scene: &Scene, tracer: &Tracer<'_>) {
        let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
        let solution = &self.solution;
        for (v, light) in solution.lamp_light().enumerate() {
            let flux = light * solution.area[v];
            received += flux;
            absorbed += flux - flux * solution.reflectance[v];
        }
        let losses = lamps::losses(scene, tracer, &self.limits());
        self.ledger.emitted = scene.emitted_flux();
        self.ledger.shoot(scene.emitted_flux(), &losses, received, absorbed);
    }

    /// Where branches of ray trees end.
    pub fn limits(&self) -> Limits {
        let accuracy = self.settings.transfer.relative;
        Limits {
            max_specular: self.settings.transfer.max_specular.min(LONGEST_CHAIN),
            throughput: THROUGHPUT * accuracy,
            diffuse_throughput: THROUGHPUT * accuracy,
            lamps: false,
        }
    }

    /// What waits at a patch's corners, given what was shot [W/m²].
    fn unshot(&self, patch: usize, shot: &[[Rgb; 3]]) -> [Rgb; 3] {
        let vertices = self.solution.patches[patch].vertices;
        [0, 1, 2].map(|c| self.solution.radiosity[vertices[c] as usize] - shot[patch][c])
    }

    /// Flux that waits at a patch, straight and towards specular surfaces, its luminance [W].
    fn waiting(&self, patch: usize) -> [f64; 2] {
        let corners = &self.solution.patches[patch];
        let (straight, specular) =
            (self.unshot(patch, &self.shot), self.unshot(patch, &self.shot_specular));
        let mut sum = [Rgb::BLACK; 2];
        for c in 0..3 {
            let share = self.transport.fates[corners.vertices[c] as usize].straight;
            sum[0] += straight[c] * share * corners.weights[c];
            sum[1] += specular[c] * (Rgb::WHITE - share) * corners.weights[c];
        }
        sum.map(|s| s.luminance())
    }

    /// One turn of the loop of Fig. 4; `None` when what waits no longer matters.
    pub fn step(&mut self) -> Option<Iteration> {
        if self.agenda.is_empty() {
            match self.plan() {
                Plan::Rest => return None,
                Plan::Specular => {
                    self.shoot_specular(0..self.shot.len());
                    self.counts.specular += 1;
                    return Some(Iteration::Specular);
                }
                Plan::Diffuse(patches) => self.agenda = patches,
            }
        }
        let patch = self.agenda.pop()? as usize;
        self.shoot_straight(patch);
        if self.settings.scheme == Scheme::Joint {
            self.shoot_specular(patch..patch + 1);
        }
        self.counts.diffuse += 1;
        Some(Iteration::Diffuse)
    }

    /// What to do next. Looking for the next shooter costs as much as some shots, so that by flux all shoot
    /// that have at least half of the largest, the largest first.
    fn plan(&self) -> Plan {
        let all: Vec<[f64; 2]> = (0..self.shot.len()).map(|p| self.waiting(p)).collect();
        let sums = all.iter().fold([0.0; 2], |sum, w| [sum[0] + w[0], sum[1] + w[1]]);
        if sums[0] + sums[1] <= self.negligible() {
            return Plan::Rest;
        }
        let scheme = self.settings.scheme;
        if scheme != Scheme::Joint && sums[1] > sums[0] {
            return Plan::Specular;
        }
        let key = |patch: usize| match scheme {
            Scheme::Printed => {
                let unshot = self.unshot(patch, &self.shot);
                unshot.iter().map(Rgb::luminance).sum::<f64>() / 3.0
            }
            Scheme::Flux => all[patch][0],
            Scheme::Joint => all[patch][0] + all[patch][1],
        };
        let mut keys: Vec<(f64, Patch)> = (0..all.len()).map(|p| (key(p), p as Patch)).collect();
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
    /// the tolerance there [W].
    fn negligible(&self) -> f64 {
        let solution = &self.solution;
        let area: f64 = solution.area.iter().sum();
        let (mut reflected, mut received) = (0.0, 0.0);
        for ((v, light), indirect) in solution.lamp_light().enumerate().zip(&solution.indirect) {
            reflected += solution.reflectance[v].max() * solution.area[v] / area;
            received += (light + *indirect).luminance() * solution.area[v];
        }
        UNSHOT * self.settings.transfer.relative * received * (1.0 - reflected.min(0.999))
    }

    /// A diffuse iteration: one patch shoots straight.
    fn shoot_straight(&mut self, patch: usize) {
        let unshot = self.unshot(patch, &self.shot);
        let corners = self.solution.patches[patch].vertices;
        self.shot[patch] = corners.map(|v| self.solution.radiosity[v as usize]);
        let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
        for entry in self.transport.straight(patch as Patch) {
            let mut light = Rgb::BLACK;
            for c in 0..3 {
                light += unshot[c] * f64::from(entry.weights[c]);
            }
            let (flux, kept) = self.solution.receive(entry.vertex as usize, light);
            received += flux;
            absorbed += kept;
        }
        self.enter(patch, unshot, 0, received, absorbed);
    }

    /// A specular iteration for some patches: all specular surfaces shoot what waits there.
    fn shoot_specular(&mut self, patches: std::ops::Range<usize>) {
        let mut light = vec![Rgb::BLACK; self.solution.area.len()];
        let mut shots = Vec::with_capacity(patches.len());
        for patch in patches {
            let unshot = self.unshot(patch, &self.shot_specular);
            let solution = &self.solution;
            let corners = solution.patches[patch].vertices;
            self.shot_specular[patch] = corners.map(|v| solution.radiosity[v as usize]);
            let (mut received, mut absorbed) = (Rgb::BLACK, Rgb::BLACK);
            for entry in self.transport.specular(patch as Patch) {
                let v = entry.vertex as usize;
                let mut own = Rgb::BLACK;
                for c in 0..3 {
                    own += unshot[c] * Rgb(entry.weights[c].map(f64::from));
                }
                light[v] += own;
                let flux = own * solution.area[v];
                received += flux;
                absorbed += flux - flux * solution.reflectance[v];
            }
            shots.push((patch, unshot, received, absorbed));
        }
        for (v, light) in light.into_iter().enumerate() {
            self.solution.receive(v, light);
        }
        for (patch, unshot, received, absorbed) in shots {
            self.enter(patch, unshot, 1, received, absorbed);
        }
    }

    /// Enters a shot into the ledger: straight (0) or by specular chains (1).
    fn enter(&mut self, patch: usize, unshot: [Rgb; 3], way: usize, received: Rgb, absorbed: Rgb) {
        let corners = self.solution.patches[patch];
        let (mut shot, mut losses) = (Rgb::BLACK, Losses::default());
        for c in 0..3 {
            let fate: &Fate = &self.transport.fates[corners.vertices[c] as usize];
            let flux = unshot[c] * corners.weights[c];
            let share = if way == 0 { fate.straight } else { Rgb::WHITE - fate.straight };
            shot += flux * share;
            losses += fate.losses[way] * flux;
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

    /// What there is so far.
    pub fn solution(&self) -> &Solution<'s> {
        &self.solution
    }
}
