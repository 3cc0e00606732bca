//! Trees, bushes, hedges and trunks.
//!
//! Leaves are loose triangles, so that beams pass between them and return from
//! different depths, as they do in real crowns.

mod bush;
mod foliage;
mod hedge;
mod tree;
mod trunk;
pub mod uneven;
mod wood;

pub use bush::build as bush;
pub use hedge::build as hedge;
pub use tree::build as tree;
pub use trunk::build as trunk;
