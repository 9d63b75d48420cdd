//! The bar on a terminal.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::options::Common;

/// Counts finished work; shows a bar if standard error is a terminal and `-q` was not given.
pub struct Progress {
    bar: ProgressBar,
    done: AtomicU64,
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
        Self { bar, done: AtomicU64::new(0) }
    }

    /// One more step is done.
    pub fn step(&self) {
        self.bar.set_position(self.done.fetch_add(1, Ordering::Relaxed) + 1);
    }

    /// So much of so much is done.
    pub fn set(&self, done: u64, total: u64) {
        self.bar.set_length(total);
        self.bar.set_position(done);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
