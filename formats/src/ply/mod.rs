//! PLY, Stanford's polygon format: the one reader of its vertices, ASCII or
//! binary of either byte order, which clouds and scans share.
//!
//! The crate `ply-rs-bw` is not used here: it reads neither `nan` nor `.5` as a
//! number, rounds text to f32, and keeps every property of every element.

mod header;
#[cfg(feature = "dataset")]
mod scan;
mod vertices;

#[cfg(feature = "dataset")]
pub use scan::{read_scan, write_scan};
pub(crate) use vertices::read_vertices;
