//! Text → description (positions kept) → [`Scene`] (checked, world frame).

mod model;
mod totals;

pub use model::*;
