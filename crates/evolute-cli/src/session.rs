//! What all verbs do before and around their work: threads, Ctrl-C, the clock, the scene.

use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use evolute::scene::{Loaded, Scene};
use evolute::transfer::TransferSettings;

use crate::failure::Failure;
use crate::options::Common;
use crate::summary::Summary;

/// Threads wait for each other; thousands do so for hours.
const MOST_THREADS: u16 = 256;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Whether the work looks at [`interrupted`] from time to time.
static WORKING: AtomicBool = AtomicBool::new(false);

/// Threads and Ctrl-C. The first Ctrl-C asks the run to stop, the second ends it at once, and so does
/// the first as long as input is read: nothing is written yet.
pub fn set_up(common: &Common) -> Result<(), Failure> {
    if let Some(n) = common.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(n.min(MOST_THREADS).into())
            .build_global()
            .map_err(|e| Failure::Usage(format!("{n} threads cannot be started: {e}")))?;
    }
    let handler = || {
        let again = INTERRUPTED.swap(true, Ordering::SeqCst);
        if !WORKING.load(Ordering::SeqCst) {
            eprintln!("{}", Failure::Interrupted.message());
        } else if !again {
            return;
        }
        std::process::exit(Failure::Interrupted.status().into());
    };
    // Without a handler Ctrl-C still ends the program, only less politely.
    if let Err(e) = ctrlc::set_handler(handler) {
        note(common, &format!("Ctrl-C cannot be handled: {e}"));
    }
    Ok(())
}

/// Input is read; from here on the run looks at [`interrupted`].
pub fn begin_work() {
    WORKING.store(true, Ordering::SeqCst);
}

/// Whether Ctrl-C was pressed.
pub fn interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

/// The moment at which `--max-time` ends, counted from now.
pub struct Deadline(Option<Instant>);

impl Deadline {
    /// Starts the clock.
    pub fn new(common: &Common) -> Self {
        // A time too far off to be represented is no limit.
        Self(common.max_time.and_then(|t| Instant::now().checked_add(t)))
    }

    /// The middle between now and then: for what others have to wait for.
    pub fn half(&self) -> Self {
        let now = Instant::now();
        Self(self.0.map(|end| now + end.saturating_duration_since(now) / 2))
    }

    /// Whether time is up.
    pub fn passed(&self) -> bool {
        self.0.is_some_and(|end| Instant::now() >= end)
    }
}

/// Puts a result on standard output.
pub fn print(bytes: &[u8]) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(bytes)
        .and_then(|()| out.flush())
        .map_err(|e| Failure::Input(format!("cannot write to standard output: {e}")))
}

/// A remark on standard error, unless `-q` was given.
pub fn note(common: &Common, text: &str) {
    if !common.quiet {
        eprintln!("{text}");
    }
}

/// A remark for `-v`.
pub fn detail(common: &Common, text: &str) {
    if common.verbose {
        eprintln!("{text}");
    }
}

/// Reads and checks a scene; its notices go to standard error.
pub fn load(path: &Path, common: &Common, summary: &mut Summary) -> Result<Scene, Failure> {
    let loaded = evolute::scene::load_file(path, &common.define);
    let loaded = loaded.map_err(|e| Failure::Input(e.to_string()))?;
    for notice in &loaded.notices {
        note(common, notice.trim_end());
    }
    summary.set("scene", path.display().to_string());
    Ok(finish(loaded, common, summary))
}

/// The scene of a file, or the one that is part of the program.
pub fn load_or_built_in(
    path: Option<&Path>,
    common: &Common,
    summary: &mut Summary,
) -> Result<Scene, Failure> {
    match path {
        Some(path) => load(path, common, summary),
        None => load_built_in(common, summary),
    }
}

/// The text of the scene that is part of the program.
pub const ROOM: &str = include_str!("../../../cases/room/scene.xml");

/// The scene that is part of the program. Nobody needs its notices: they are for those who write
/// scenes.
fn load_built_in(common: &Common, summary: &mut Summary) -> Result<Scene, Failure> {
    let loaded = evolute::scene::load_str("room.xml", ROOM, &common.define);
    let loaded = loaded.map_err(|e| Failure::Input(e.to_string()))?;
    summary.set("scene", "room");
    Ok(finish(loaded, common, summary))
}

fn finish(loaded: Loaded, common: &Common, summary: &mut Summary) -> Scene {
    summary.set("notices", loaded.notices);
    let seconds = summary.lap("load");
    detail(common, &format!("scene read and checked in {seconds:.3} s"));
    loaded.scene
}

/// Accuracy and limits as the command line asks for them.
pub fn transfer_settings(scene: &Scene, common: &Common) -> TransferSettings {
    let absolute = common.accuracy_abs.unwrap_or_else(|| {
        let area = scene.surface_area();
        let mean = if area > 0.0 { scene.emitted_flux().luminance() / area } else { 0.0 };
        // A thousandth of the relative tolerance on the scene's mean irradiance.
        common.accuracy * 1e-3 * mean
    });
    let default = TransferSettings::default();
    TransferSettings {
        relative: common.accuracy,
        absolute,
        max_specular: common.max_specular.unwrap_or(default.max_specular),
        ..default
    }
}
