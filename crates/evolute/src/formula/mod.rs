//! Formulas of scene files: parsed with positions, compiled to one tape, evaluated over numbers,
//! intervals, and jets of either.
//!
//! Operators `+ - * / ^`: `^` associates to the right and binds tighter than a minus before it, so
//! `-x^2` is `-(x^2)` and `2^-1` is one half. Functions: `sin cos tan asin acos atan sqrt exp log abs`
//! of one argument, `atan2 hypot` of two, `min max` of two or more; `pi` is a constant.
//!
//! Guarantees: parsing takes time and stack bounded by the limits in [`Formula::parse`]; evaluation
//! allocates nothing; the interval evaluation contains the exact value and the rounded `f64` value at
//! every point of the box at which the formula is defined.

mod graph;
mod interval;
mod jets;
mod names;
mod parse;
mod scalar;
mod tape;

pub use interval::Interval;
pub use jets::{Jet1, Jet2};
pub use names::nearest_name;
pub use parse::{FUNCTIONS, Formula, FormulaError, check_constant_name};
pub use scalar::{Field, Scalar};
pub use tape::{MAX_LIVE_VALUES, Tape};
