//! What `--json` prints at the end.

use std::io::Write;
use std::time::Instant;

use serde_json::{Map, Value, json};

use evolute::transfer::Counts;

use crate::options::Common;

/// Collects facts about a run.
pub struct Summary {
    values: Map<String, Value>,
    timings: Map<String, Value>,
    files: Vec<String>,
    start: Instant,
    lap: Instant,
}

impl Summary {
    /// Starts the clock.
    pub fn new(verb: &str) -> Self {
        let mut values = Map::new();
        values.insert("verb".into(), verb.into());
        values.insert("version".into(), env!("CARGO_PKG_VERSION").into());
        let now = Instant::now();
        Self { values, timings: Map::new(), files: Vec::new(), start: now, lap: now }
    }

    /// Notes a fact.
    pub fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.values.insert(name.into(), value.into());
    }

    /// Notes the time since the last lap [s] under a name, and returns it.
    pub fn lap(&mut self, name: &str) -> f64 {
        let seconds = self.lap.elapsed().as_secs_f64();
        self.lap = Instant::now();
        self.timings.insert(name.into(), seconds.into());
        seconds
    }

    /// Notes a file that was written.
    pub fn file(&mut self, path: &std::path::Path) {
        self.files.push(path.display().to_string());
    }

    /// Notes the work of all receivers.
    pub fn counts(&mut self, receivers: u64, counts: &Counts) {
        self.set(
            "counts",
            json!({
                "receivers": receivers,
                "chains": counts.chains,
                "cells": counts.cells,
                "rays": counts.rays,
            }),
        );
    }

    /// Prints the object if it was asked for.
    pub fn finish(mut self, status: u8, common: &Common) {
        if !common.json {
            return;
        }
        self.timings.insert("total".into(), self.start.elapsed().as_secs_f64().into());
        self.values.insert("timings".into(), self.timings.into());
        self.values.insert("files".into(), self.files.into());
        self.values.insert("exit".into(), status.into());
        // Whoever closed the pipe does not want the object, and cannot be told.
        let _ = writeln!(std::io::stdout(), "{}", Value::Object(self.values));
    }
}
