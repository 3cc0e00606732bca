//! The studies, each of which ends in a record.

pub mod casting;
pub mod devices;
pub mod frames;
pub mod gpu;
pub mod mutants;
pub mod reproduction;
mod resume;
pub mod sydney;
