//! Text → description (positions kept) → [`Scene`] (checked, world frame).
//!
//! [`load_file`] does it all. On the way: `source` holds the texts and positions in them, `xml`
//! reads elements, `text` replaces parameters in their attributes, `describe` makes objects and
//! values of them, `schema` knows the plugins, `check` builds the scene with `shape`, `material`
//! and `sensor`; whatever is wrong becomes a `message`. `plain` writes a description down again, in words
//! that Mitsuba 3 knows.
//!
//! The language is Mitsuba 3's scene XML and follows its conventions (tests/scene_language.rs has its
//! answers). It is stricter where Mitsuba goes on with nonsense: numbers must be finite, sizes
//! positive, reflectances and weights at most 1, radiances at least 0, the axis of a rotation of
//! length 1, the last row of a matrix 0 0 0 1, text outside of tags white; a film is not cropped, and
//! a surface has one mirror component a side. It is laxer in that polygons of PLY files need not be
//! triangles.

mod check;
mod cie;
mod describe;
mod description;
mod index;
mod load;
mod material;
mod mesh_file;
mod message;
mod model;
mod number;
mod placement;
mod plain;
mod properties;
mod references;
mod schema;
mod sensor;
mod shape;
mod source;
mod spectrum;
mod text;
mod totals;
mod transform_tag;
mod xml;

pub use description::SceneDescription;
pub use load::{Loaded, load_file, load_str};
pub use message::SceneError;
pub use model::*;
pub use plain::{PlainCopy, PlainScene, PlainSurface};
pub use source::Location;
