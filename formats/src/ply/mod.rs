//! PLY, Stanford's polygon format. Clouds, scans and meshes share the reader of its elements, which
//! are ASCII, or binary of either byte order.

mod elements;
mod header;
#[cfg(feature = "dataset")]
mod scan;

pub use elements::read_elements;
pub use header::{Element, Frame};
#[cfg(feature = "dataset")]
pub use scan::read_scan;
