//! What a run has computed, so that another one need not compute it again.
//!
//! Growth is deterministic: a run that is given what was computed at vertices cuts the same triangles in the same
//! order, asks for the same vertices, and finds them known. So neither meshes nor the place at which a run stopped
//! need be kept, and the bits at the end are those of a run that was never stopped. What was put together from
//! neighbours for want of time is left out. The loop's state is kept as it is.

use serde::{Deserialize, Serialize};

use super::growth::Growth;
use super::lamps::LampLight;
use super::ledger::Ledger;
use super::rows::Seen;
use super::{Component, Shooter, Solver, SolverCounts};
use crate::geometry::Rgb;
use crate::receiver::TriangleMesh;
use crate::scene::Scene;
use crate::surface::ChartPoint;

/// What was computed at vertices, by sheet and number, each with its place: how vertices are numbered depends on how
/// meshes grow, so that a number alone would not make sure that the same one is meant.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Known<L>(Vec<Vec<Option<(ChartPoint, L)>>>);

impl<L> Default for Known<L> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<L> Known<L> {
    /// From all meshes, what they have at their vertices, and whether that was computed.
    pub fn new<'m, 's: 'm>(
        meshes: impl IntoIterator<Item = &'m TriangleMesh<'s>>,
        lights: impl IntoIterator<Item = (Vec<L>, Vec<bool>)>,
    ) -> Self {
        let of = |(mesh, (lights, computed)): (&TriangleMesh<'_>, (Vec<L>, Vec<bool>))| {
            let each = mesh.vertices().iter().zip(lights).zip(computed);
            each.map(|((vertex, light), is)| is.then_some((vertex.site, light))).collect()
        };
        Self(meshes.into_iter().zip(lights).map(of).collect())
    }

    /// What is known of the vertex of a sheet that lies there; it is forgotten here.
    pub fn take(&mut self, sheet: usize, vertex: u32, site: &ChartPoint) -> Option<L> {
        let slot = self.0.get_mut(sheet)?.get_mut(vertex as usize)?;
        slot.take_if(|(known, _)| known == site).map(|(_, light)| light)
    }

    /// All that is known.
    fn values(&self) -> impl Iterator<Item = &L> {
        self.0.iter().flatten().flatten().map(|(_, light)| light)
    }
}

impl<L: Clone> Known<L> {
    /// From meshes that have grown.
    pub fn of(growths: &[Growth<'_, L>]) -> Self {
        let lights = growths.iter().map(|g| (g.light.clone(), g.is_computed.clone()));
        Self::new(growths.iter().map(|g| &g.mesh), lights)
    }
}

/// What a run has computed so far.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Checkpoint {
    pub(super) direct: Known<LampLight>,
    pub(super) specular: Known<LampLight>,
    pub(super) rows: Known<Seen>,
    pub(super) state: Option<Box<LoopState>>,
}

/// Where the loop is.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct LoopState {
    /// Indirect light by vertex [W/m²].
    irradiance: Vec<Rgb>,
    /// What of it rows say [W/m²], and the factor on that.
    received: Vec<Rgb>,
    factor: Rgb,
    /// By component, way, patch and corner: radiosity that was shot [W/m²].
    shots: [[Vec<[Rgb; 3]>; 2]; 3],
    agenda: Vec<Shooter>,
    ledger: Ledger,
    counts: SolverCounts,
}

impl Checkpoint {
    /// Vertices at which light is known, by [`Component`], and iterations.
    pub fn counts(&self) -> ([usize; 3], u64) {
        let vertices = [
            self.direct.values().count(),
            self.specular.values().count(),
            self.rows.values().count(),
        ];
        (vertices, self.state.as_ref().map_or(0, |s| s.counts.iterations()))
    }

    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.counts() == ([0; 3], 0)
    }

    /// Whether all numbers are finite and all places exist, by the surface of each sheet: what a file says is not
    /// believed.
    pub(super) fn is_sound(&self, solution_sheets: &[super::Sheet], scene: &Scene) -> bool {
        let exists = |sheet: u32, chart: u32| {
            let sheet = solution_sheets.get(sheet as usize);
            sheet.is_some_and(|s| (chart as usize) < scene.shape(s.shape).surface.charts())
        };
        let lamps = self.direct.values().chain(self.specular.values());
        let state = self.state.as_ref();
        lamps.into_iter().all(LampLight::is_finite)
            && self
                .rows
                .values()
                .all(|seen| seen.is_finite() && seen.row.places().all(|p| exists(p.0, p.1)))
            && state.is_none_or(|s| {
                let shots = s.shots.iter().flatten().flatten().flatten();
                let light = s.irradiance.iter().chain(&s.received);
                shots.chain(light).chain([&s.factor]).all(Rgb::is_finite) && s.ledger.is_finite()
            })
    }
}

impl Solver<'_> {
    /// Keeps where the loop is, beside what [`Solver::resume`] has put into the checkpoint.
    pub fn keep_state(&self, checkpoint: &mut Checkpoint) {
        // On meshes for which there was no time another run would not find itself again.
        checkpoint.state = self.complete.then(|| {
            Box::new(LoopState {
                irradiance: self.solution.layer(Component::Indirect).irradiance.clone(),
                shots: self.sources.each_ref().map(|s| s.shot.clone()),
                received: self.received.clone(),
                factor: self.factor,
                agenda: self.agenda.clone(),
                ledger: self.ledger,
                counts: self.counts,
            })
        });
    }

    /// Goes on where the loop was; whether the state is one of this scene's meshes.
    pub(super) fn restore(&mut self, state: LoopState) -> bool {
        let patches = self.solution.layers.each_ref().map(|l| l.patches.len());
        let fits =
            |shots: &[Vec<[Rgb; 3]>; 2], count: usize| shots.iter().all(|s| s.len() == count);
        let vertices = self.solution.indirect_mut().irradiance.len();
        let is_own = state.irradiance.len() == vertices
            && state.received.len() == vertices
            && state.shots.iter().zip(patches).all(|(s, n)| fits(s, n))
            && state.agenda.iter().all(|&(l, p)| patches.get(l).is_some_and(|n| (p as usize) < *n));
        if is_own {
            self.solution.indirect_mut().irradiance = state.irradiance;
            for (source, shot) in self.sources.iter_mut().zip(state.shots) {
                source.shot = shot;
            }
            self.received = state.received;
            self.factor = state.factor;
            self.agenda = state.agenda;
            self.ledger = state.ledger;
            self.counts = state.counts;
        }
        is_own
    }
}
