//! Text → description (positions kept) → [`Scene`] (checked, world frame).

mod model;

pub use model::*;
