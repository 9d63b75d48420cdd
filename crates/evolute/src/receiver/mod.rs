//! Receivers of the radiosity solution: triangles over the parameter domains of diffuse surfaces
//! (Yu & Wu, 3.5).

mod mesh;
mod roots;

pub use mesh::{Place, TriangleMesh, Vertex};
