//! evolute computes where light goes in scenes with curved mirrors and lenses: deterministically,
//! independently of any camera, and with an error figure.
//!
//! The layers, each calling only those above it in this list (`ARCHITECTURE.md` has the picture):
//!
//! - [`geometry`]: points, frames, transforms, bounds
//! - [`formula`]: formulas of scene files, compiled to one tape
//! - [`surface`]: every surface: jets, fundamental forms, bounds
//! - [`optics`]: media, Fresnel, wavefronts, intensity and area factors
//! - [`scene`]: text → description → checked scene
//! - [`trace`]: nearest hit, occlusion, ray trees
//! - [`receiver`]: triangle meshes over parameter domains
//! - [`transfer`]: diffuse and specular light at a receiver
//! - [`solve`]: the first pass: radiosity
//! - [`view`]: camera → layers of radiance
//! - [`output`]: files; no physics

pub mod formula;
pub mod geometry;
pub mod optics;
pub mod output;
pub mod receiver;
pub mod scene;
pub mod solve;
pub mod surface;
pub mod trace;
pub mod transfer;
pub mod view;
