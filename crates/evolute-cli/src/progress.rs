//! The bar on a terminal, and how long each stage took.

use std::io::IsTerminal;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::options::Common;

/// Counts finished work; shows a bar if standard error is a terminal and `-q` was not given.
pub struct Progress {
    bar: ProgressBar,
    done: AtomicU64,
    /// The present stage and when it began.
    stage: Mutex<Option<(&'static str, Instant)>>,
    /// Whether stages are told when they end.
    verbose: bool,
}

impl Progress {
    /// A bar of `total` steps (0: not known yet).
    pub fn new(common: &Common, what: &'static str, total: u64) -> Self {
        let shown = !common.quiet && std::io::stderr().is_terminal();
        let target =
            if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(total), target).with_message(what);
        if let Ok(style) =
            ProgressStyle::with_template("{msg} {wide_bar} {percent}% {elapsed}, {eta} to go")
        {
            bar.set_style(style);
        }
        Self { bar, done: AtomicU64::new(0), stage: Mutex::default(), verbose: common.verbose }
    }

    /// One more step is done.
    pub fn step(&self) {
        self.bar.set_position(self.done.fetch_add(1, Ordering::Relaxed) + 1);
    }

    /// A stage of so many steps begins.
    pub fn begin(&self, stage: &'static str, total: u64) {
        self.done.store(0, Ordering::Relaxed);
        self.set(stage, 0, total);
    }

    /// The radiosity loop: the fraction of the emitted flux that is unshot, and of the way to the end.
    pub fn set_unshot(&self, unshot: f64, done: f64) {
        const STEPS: f64 = 1000.0;
        self.set("unshot flux", (STEPS * done) as u64, STEPS as u64);
        self.bar.set_message(format!("unshot flux {:.2} %", 100.0 * unshot));
    }

    /// So much of so much of a stage is done.
    pub fn set(&self, stage: &'static str, done: u64, total: u64) {
        if let Ok(mut present) = self.stage.lock()
            && present.is_none_or(|(name, _)| name != stage)
        {
            self.end(present.replace((stage, Instant::now())));
            self.bar.set_message(stage);
            self.bar.reset();
        }
        self.bar.set_length(total);
        self.bar.set_position(done);
    }

    /// Tells how long a stage took.
    fn end(&self, stage: Option<(&'static str, Instant)>) {
        let Some((name, begin)) = stage.filter(|_| self.verbose) else { return };
        let seconds = begin.elapsed().as_secs_f64();
        self.bar.suspend(|| eprintln!("{name}: {seconds:.1} s"));
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        let last = self.stage.lock().ok().and_then(|mut stage| stage.take());
        self.end(last);
        self.bar.finish_and_clear();
    }
}
