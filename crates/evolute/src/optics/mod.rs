//! Media, Fresnel's equations, wavefronts and what the paper's factors need of them.

pub mod differential;

pub use differential::{Dual, DualRay, DualVector};
