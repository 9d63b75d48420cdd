//! Receivers of the radiosity solution: triangles over the parameter domains of diffuse surfaces
//! (Yu & Wu, 3.5).

mod mesh;
mod quadratic;
mod roots;
mod tessellation;

pub use mesh::{Change, Locator, Place, TriangleMesh, Vertex};
pub use quadratic::{Stencil, merged};
pub use tessellation::Tessellation;
