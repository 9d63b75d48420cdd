//! Text → description (positions kept) → [`Scene`] (checked, world frame).
//!
//! [`load_file`] does it all. On the way: `source` holds the texts and positions in them, `xml`
//! reads elements, `text` replaces parameters in their attributes, `describe` makes objects and
//! values of them, `schema` knows the plugins, `check` builds the scene with `shape`, `material`
//! and `sensor`; whatever is wrong becomes a `message`.
//!
//! The language is Mitsuba 3's scene XML and follows its conventions; it is stricter in that sizes
//! must be positive, reflectances at most 1, and every name known.

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
mod properties;
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
pub use source::Location;
