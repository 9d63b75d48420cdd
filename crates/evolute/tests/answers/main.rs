//! Light at a receiver against known answers: closed forms, and maps made by other programs. The cases are
//! described in `cases/*/README.md`; `cargo test --release -p evolute --test answers -- --nocapture`
//! prints the tables.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

#[path = "../common/mod.rs"]
mod common;
#[allow(dead_code)] // shared with the tracer's tests, which need more of it
#[path = "../brute/random.rs"]
mod random;

mod cases;
mod consistency;
mod criteria;
mod direct;
mod known;
mod lamps;
mod maps;
mod pipe;
mod polygon;
mod reference;
mod slats;
mod threads;
mod torn;
