//! Solutions as bytes.
//!
//! A header (magic, version of the format, fingerprint of the scene, lengths, checksum), then the content in
//! postcard's encoding, compressed by zstd. A mesh is kept as the cuts and seams that made it of the surface's first
//! triangles, and light as its values at vertices. The same solution gives the same bytes: there is no date in them, and no time.
//!
//! Nothing that a file says is believed before its checksum is right, and no more memory is taken than it announces;
//! numbers of sheets, triangles and vertices are checked even then.

use std::io::Read;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::fingerprint::{Hash, fingerprint};
use super::{
    Checkpoint, Layer, Ledger, Outcome, Sheet, Solution, SolverCounts, SolverSettings, VertexError,
    first_edge,
};
use crate::geometry::Rgb;
use crate::receiver::{Change, TriangleMesh};
use crate::scene::Scene;

/// The first bytes of every file. The last of them stops programs that would show it as text.
const MAGIC: &[u8; 8] = b"EVOLUTE\x1a";

/// Version of the format. To be raised when the content or its meaning changes.
const VERSION: u32 = 4;

/// Bytes before the content.
const HEADER: usize = 8 + 4 + 16 + 8 + 8 + 16;

/// Content beyond this [bytes] is not made, and not believed to be there: some hundred times that of a large room.
const LARGEST: u64 = 1 << 36;

/// zstd's own default: more takes longer and saves little, as most of it is digits.
const LEVEL: i32 = 3;

/// First triangles are about as large as a square over their edge, and meshes have a vertex for two of them, or more:
/// there are no more such squares than this for each vertex.
const FIRST_PER_VERTEX: f64 = 16.0;

/// What is wrong with a file.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SolutionError {
    /// Not a solution at all.
    #[error("it is not a solution file; name one that 'evolute solve' wrote")]
    Foreign,
    /// Of another version of the format.
    #[error(
        "it has version {found} of the format and this program reads version {VERSION}; {}",
        if *found > VERSION { "use a newer evolute, or solve the scene again" } else { "solve the scene again" }
    )]
    Version {
        /// The file's.
        found: u32,
    },
    /// Shorter, or longer, than it says.
    #[error(
        "it has {found} bytes and should have {expected}; copy it again, or solve the scene again"
    )]
    Length {
        /// Bytes that there are.
        found: u64,
        /// Bytes that its header announces.
        expected: u64,
    },
    /// Its checksum is wrong, or what is in it cannot be.
    #[error("it is damaged; copy it again, or solve the scene again")]
    Damaged,
    /// Made for other shapes, materials or lamps.
    #[error(
        "it was made for another scene: shapes, materials or lamps differ from what the scene, with what -D sets, \
         has now; solve the scene again, or name the scene that it was made for"
    )]
    OtherScene,
    /// Its unfinished work is another program's.
    #[error(
        "it was left unfinished by version {found} of evolute, and this is {}; solve the scene again without --resume",
        env!("CARGO_PKG_VERSION")
    )]
    OtherProgram {
        /// The file's.
        found: String,
    },
    /// Its unfinished work is that of other settings.
    #[error(
        "it was made with {what} {found}, and {asked} is asked for; repeat the options that it was made with, or solve \
         the scene again without --resume"
    )]
    OtherSettings {
        /// The option.
        what: &'static str,
        /// The file's.
        found: String,
        /// The run's.
        asked: String,
    },
    /// More than a file may hold.
    #[error("the solution is too large for a file; choose a larger --accuracy")]
    TooLarge,
}

/// What a file holds.
#[derive(Debug)]
pub struct SolutionFile<'s> {
    /// Version of the program that wrote it.
    pub program: String,
    /// What was asked of the solution.
    pub settings: SolverSettings,
    /// The solution; none if the run was interrupted.
    pub outcome: Option<Outcome<'s>>,
    /// What another run need not compute again; none if the solution is complete.
    pub checkpoint: Option<Checkpoint>,
}

impl SolutionFile<'_> {
    /// Whether a run with these settings can go on from here.
    ///
    /// # Errors
    /// A sentence if the file is of other settings or of another version of the program.
    pub fn is_resumable(&self, settings: &SolverSettings) -> Result<(), SolutionError> {
        if self.program != env!("CARGO_PKG_VERSION") {
            return Err(SolutionError::OtherProgram { found: self.program.clone() });
        }
        let (found, asked) = (&self.settings.transfer, &settings.transfer);
        for (what, found, asked) in [
            ("--accuracy", found.relative, asked.relative),
            ("--accuracy-abs", found.absolute, asked.absolute),
            ("--max-specular", f64::from(found.max_specular), f64::from(asked.max_specular)),
        ] {
            if found != asked {
                let [found, asked] = [found, asked].map(|x| x.to_string());
                return Err(SolutionError::OtherSettings { what, found, asked });
            }
        }
        if self.settings != *settings {
            let [found, asked] = [&self.settings, settings].map(|s| format!("{s:?}"));
            return Err(SolutionError::OtherSettings { what: "settings", found, asked });
        }
        Ok(())
    }
}

/// The content.
#[derive(Serialize, Deserialize)]
struct Content<'a, C> {
    program: &'a str,
    settings: SolverSettings,
    outcome: Option<StoredOutcome>,
    checkpoint: Option<C>,
}

#[derive(Serialize, Deserialize)]
struct StoredOutcome {
    layers: [StoredLayer; 3],
    ledger: Ledger,
    counts: SolverCounts,
    is_complete: bool,
}

/// Light of one component.
#[derive(Serialize, Deserialize)]
struct StoredLayer {
    /// By sheet.
    changes: Vec<Vec<Change>>,
    /// By vertex, numbered through all sheets: irradiance [W/m²] and the estimated errors of its luminance.
    irradiance: Vec<Rgb>,
    error: Vec<VertexError>,
    /// By patch: the same of interpolation [W/m²].
    interpolation: Vec<f64>,
}

/// Encodes a solution of a scene, and what another run may go on from.
///
/// # Errors
/// [`SolutionError::TooLarge`].
pub fn encode_solution(
    scene: &Scene,
    settings: &SolverSettings,
    outcome: Option<&Outcome<'_>>,
    checkpoint: Option<&Checkpoint>,
) -> Result<Vec<u8>, SolutionError> {
    let outcome = outcome.map(|o| StoredOutcome {
        layers: o.solution.layers.each_ref().map(StoredLayer::of),
        ledger: o.ledger,
        counts: o.counts,
        is_complete: o.is_complete,
    });
    let program = env!("CARGO_PKG_VERSION");
    let content = Content { program, settings: *settings, outcome, checkpoint };
    let raw = postcard::to_allocvec(&content).map_err(|_| SolutionError::TooLarge)?;
    drop(content);
    if raw.len() as u64 > LARGEST {
        return Err(SolutionError::TooLarge);
    }
    let packed = zstd::bulk::compress(&raw, LEVEL).map_err(|_| SolutionError::TooLarge)?;
    let mut bytes = Vec::with_capacity(HEADER + packed.len());
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(fingerprint(scene).to_le_bytes());
    bytes.extend((packed.len() as u64).to_le_bytes());
    bytes.extend((raw.len() as u64).to_le_bytes());
    bytes.extend(checksum(&bytes, &packed).to_le_bytes());
    bytes.extend(packed);
    Ok(bytes)
}

fn checksum(head: &[u8], packed: &[u8]) -> u128 {
    let mut hash = Hash::new();
    hash.add(head);
    hash.add(packed);
    hash.value()
}

/// The next bytes of a header.
fn next<const N: usize>(bytes: &mut &[u8]) -> Option<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk()?;
    *bytes = rest;
    Some(*first)
}

/// Reads what [`encode_solution`] made for the same scene.
///
/// # Errors
/// [`SolutionError`]: sentences that are to follow the file's name.
pub fn decode_solution<'s>(
    bytes: &[u8],
    scene: &'s Scene,
) -> Result<SolutionFile<'s>, SolutionError> {
    let raw = unpack(bytes, || fingerprint(scene))?;
    let content: Content<'_, Checkpoint> =
        postcard::from_bytes(&raw).map_err(|_| SolutionError::Damaged)?;
    let Content { program, settings, outcome, checkpoint } = content;
    let sheets = Sheet::all(scene);
    if checkpoint.as_ref().is_some_and(|c| !c.is_sound(&sheets, scene)) {
        return Err(SolutionError::Damaged);
    }
    let outcome = match outcome {
        None => None,
        Some(stored) => {
            let edge = first_edge(scene, &settings);
            let [a, b, c] = stored.layers;
            let layer = |stored: StoredLayer| stored.grow(scene, &sheets, edge);
            let layers = [layer(a)?, layer(b)?, layer(c)?];
            Some(Outcome {
                settings,
                solution: Solution::new(scene, sheets, layers),
                ledger: stored.ledger,
                counts: stored.counts,
                is_complete: stored.is_complete,
            })
        }
    };
    Ok(SolutionFile { program: program.into(), settings, outcome, checkpoint })
}

/// The content's bytes, if the header is as it should be.
fn unpack(bytes: &[u8], fingerprint: impl Fn() -> u128) -> Result<Vec<u8>, SolutionError> {
    let head = &bytes[..bytes.len().min(HEADER - 16)];
    let mut left = bytes;
    let magic: Option<[u8; 8]> = next(&mut left);
    if magic.as_ref() != Some(MAGIC) {
        return Err(SolutionError::Foreign);
    }
    let cut_short = || SolutionError::Length { found: bytes.len() as u64, expected: HEADER as u64 };
    let version = u32::from_le_bytes(next(&mut left).ok_or_else(cut_short)?);
    if version != VERSION {
        return Err(SolutionError::Version { found: version });
    }
    let own = u128::from_le_bytes(next(&mut left).ok_or_else(cut_short)?);
    let packed = u64::from_le_bytes(next(&mut left).ok_or_else(cut_short)?);
    let raw = u64::from_le_bytes(next(&mut left).ok_or_else(cut_short)?);
    let sum = u128::from_le_bytes(next(&mut left).ok_or_else(cut_short)?);
    if left.len() as u64 != packed {
        return Err(SolutionError::Length {
            found: bytes.len() as u64,
            expected: packed.saturating_add(HEADER as u64),
        });
    }
    if sum != checksum(head, left) || raw > LARGEST {
        return Err(SolutionError::Damaged);
    }
    if own != fingerprint() {
        return Err(SolutionError::OtherScene);
    }
    // What comes out takes memory as it comes, and never more than was announced.
    let mut content = Vec::new();
    let decoder = zstd::stream::read::Decoder::new(left).map_err(|_| SolutionError::Damaged)?;
    let read = decoder.take(raw + 1).read_to_end(&mut content);
    match read {
        Ok(n) if n as u64 == raw => Ok(content),
        _ => Err(SolutionError::Damaged),
    }
}

impl StoredLayer {
    fn of(layer: &Layer<'_>) -> Self {
        Self {
            changes: layer.meshes().iter().map(|m| m.history().to_vec()).collect(),
            irradiance: layer.irradiance.clone(),
            error: layer.error.clone(),
            interpolation: layer.interpolation().to_vec(),
        }
    }

    /// Makes the meshes again, and puts the light on them.
    fn grow<'s>(
        self,
        scene: &'s Scene,
        sheets: &[Sheet],
        edge: f64,
    ) -> Result<Layer<'s>, SolutionError> {
        let Self { changes, irradiance, error, interpolation } = self;
        let is_finite = irradiance.iter().all(Rgb::is_finite)
            && error.iter().all(VertexError::is_finite)
            && interpolation.iter().all(|e| e.is_finite());
        // Edges that are no lengths, or so short that first triangles would fill the memory.
        let area: f64 = sheets.iter().map(|s| scene.shape(s.shape).surface.area()).sum();
        let most = FIRST_PER_VERTEX * irradiance.len() as f64;
        let can_be = edge > 0.0 && area / (edge * edge) <= most;
        if changes.len() != sheets.len() || !is_finite || !can_be {
            return Err(SolutionError::Damaged);
        }
        let mut meshes = Vec::with_capacity(sheets.len());
        for (sheet, changes) in sheets.iter().zip(&changes) {
            let mut mesh = TriangleMesh::new(&scene.shape(sheet.shape).surface, edge);
            if !changes.iter().all(|change| mesh.change(change)) {
                return Err(SolutionError::Damaged);
            }
            meshes.push(mesh);
        }
        let vertices: usize = meshes.iter().map(|m| m.vertices().len()).sum();
        if irradiance.len() != vertices || error.len() != vertices {
            return Err(SolutionError::Damaged);
        }
        let mut layer = Layer::new(sheets, meshes, irradiance, error);
        if interpolation.len() != layer.patches.len() {
            return Err(SolutionError::Damaged);
        }
        layer.set_interpolation(interpolation);
        layer.bend();
        Ok(layer)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::scene::load_str;
    use crate::solve::{Component, HALT, Solver};
    use crate::surface::ChartPoint;
    use crate::trace::Tracer;
    use crate::transfer::Control;

    /// Content that says other things, under a checksum that is right.
    fn wrapped(fingerprint: u128, raw: &[u8], announced: usize) -> Vec<u8> {
        let packed = zstd::bulk::compress(raw, LEVEL).unwrap();
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend(fingerprint.to_le_bytes());
        bytes.extend((packed.len() as u64).to_le_bytes());
        bytes.extend((announced as u64).to_le_bytes());
        bytes.extend(checksum(&bytes, &packed).to_le_bytes());
        bytes.extend(packed);
        bytes
    }

    /// What passes the checksum may still say anything. Files are read or refused; what is read can be used.
    #[test]
    fn content_is_not_believed() {
        let text = r#"<scene version="3.0.0">
            <shape type="rectangle"><bsdf type="diffuse"/></shape>
            <shape type="sphere"><point name="center" value="0, 0, 0.5"/><float name="radius" value="0.3"/>
                <bsdf type="diffuse"/></shape>
            <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="180"/><translate z="2"/></transform>
                <emitter type="area"><rgb name="radiance" value="1"/></emitter></shape></scene>"#;
        let scene = load_str("test.xml", text, &[]).unwrap().scene;
        let tracer = Tracer::new(&scene);
        let mut settings = SolverSettings { edge: Some(1.0), ..SolverSettings::default() };
        settings.transfer.relative = 0.2;
        let mut checkpoint = Checkpoint::default();
        let mut solver =
            Solver::resume(&scene, &tracer, &settings, &Control::GO, &mut checkpoint).unwrap();
        for _ in 0..20 {
            solver.step();
        }
        solver.keep_state(&mut checkpoint);
        let outcome = solver.into_outcome();
        let bytes = encode_solution(&scene, &settings, Some(&outcome), Some(&checkpoint)).unwrap();
        let own = fingerprint(&scene);
        let raw = unpack(&bytes, || own).unwrap();
        assert!(bytes == wrapped(own, &raw, raw.len()));
        // More, and less, than is announced.
        for announced in [0, raw.len() - 1, raw.len() + 1, usize::MAX] {
            assert!(unpack(&wrapped(own, &raw, announced), || own).is_err());
        }
        let (mut refused, mut read) = (0, 0);
        let mut random = 1u64;
        for round in 0..400 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let mut other = raw.clone();
            // Lengths stand near the beginning.
            let near = if round % 2 == 0 { 400 } else { raw.len() };
            let at = (random >> 33) as usize % near.min(raw.len());
            other[at] ^= (1 + (random >> 20) % 255) as u8;
            match decode_solution(&wrapped(own, &other, other.len()), &scene) {
                Err(_) => refused += 1,
                Ok(file) => {
                    read += 1;
                    for component in Component::ALL {
                        let layer = file.outcome.as_ref().unwrap().solution.layer(component);
                        layer.at(0, &ChartPoint { chart: 0, at: [0.3, -0.2] });
                    }
                    // What is asked is the run's, not the file's.
                    let mut known = file.checkpoint.unwrap_or_default();
                    let run = Solver::resume(&scene, &tracer, &settings, &HALT, &mut known);
                    let mut run = run.unwrap();
                    for _ in 0..20 {
                        run.step();
                    }
                    run.into_outcome();
                }
            }
        }
        assert!(refused > 50 && read > 50, "{refused} refused, {read} read");
    }
}
