//! Files: OpenEXR, PNG, Radiance, CSV, NPY, NPZ and PLY. No physics.
//!
//! Every format is *encoded* to bytes and then *put in place* by [`replace_file`], so that a reader
//! never sees half a file and a failed run leaves what was there before. The bytes depend on the data
//! alone: no dates, no random names, no hash order.

mod csv;
mod exr;
mod file;
mod npz;
mod ply;
mod png;
mod radiance;
mod raster;
mod tone;

pub use self::csv::{csv_field, csv_number};
pub use self::exr::{ExrAttributes, encode_exr};
pub use self::file::{check_target, replace_file};
pub use self::npz::{Array, ArrayData, encode_npy, encode_npz};
pub use self::ply::{PlyMesh, encode_ply};
pub use self::png::encode_png;
pub use self::radiance::encode_radiance;
pub use self::raster::{Channel, Raster};
pub use self::tone::{Exposure, display_rgb};

use std::path::PathBuf;

/// Why a file was not written. Each message is a sentence.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The folder, the disk or the permissions.
    #[error("cannot write '{}': {source}", path.display())]
    File {
        /// The target.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// The data do not fit the format.
    #[error("{0}")]
    Format(String),
}
