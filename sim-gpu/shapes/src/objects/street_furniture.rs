//! Objects on pavements and in yards.

pub mod bench;
pub mod bin;
pub mod clutter;
pub mod cone;
