//! PLY, Stanford's polygon format: the one reader of its elements, ASCII or
//! binary of either byte order, which clouds, scans and meshes share.

mod elements;
mod header;
#[cfg(feature = "dataset")]
mod scan;

pub use elements::read_elements;
pub use header::Element;
#[cfg(feature = "dataset")]
pub use scan::{read_scan, write_scan};
