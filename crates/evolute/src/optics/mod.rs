//! Media, Fresnel's equations, wavefronts and what the paper's factors need of them.

pub mod differential;
mod factors;
mod fresnel;
mod media;
mod principal;
mod tensor;
mod wavefront;

pub use differential::{Dual, DualRay, DualVector};
pub use factors::{Chain, CollimatedChain, CollimatedFactors, FactorLaw, Factors, Vertex};
pub use fresnel::{ConductorIndex, DielectricBoundary};
pub use media::{Interaction, Refraction, reflect_direction, refract_direction};
pub use principal::PrincipalWave;
pub use tensor::condition_number;
pub use wavefront::Wavefront;
