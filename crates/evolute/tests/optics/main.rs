//! Wavefront optics against closed forms, against finite differences of traced rays, and against the
//! law between the two factors. `cargo test --release --test optics -- --nocapture` prints the tables.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod bodies;
mod chains;
mod families;
mod known;
mod meshes;
mod paths;
