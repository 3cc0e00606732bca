//! Trees, bushes, hedges and trunks.
//!
//! Leaves are loose triangles, so that beams pass between them and return from different depths, as
//! they do in real crowns.

pub mod bush;
mod foliage;
pub mod hedge;
pub mod tree;
pub mod trunk;
pub mod uneven;
mod wood;
