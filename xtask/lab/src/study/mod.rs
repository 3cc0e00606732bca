//! The studies, each of which ends in a record.

pub mod ablation;
pub mod casting;
mod datasets;
pub mod devices;
pub mod frames;
pub mod gpu;
pub mod mutants;
pub mod numerics;
mod plan;
pub mod reproduction;
mod resume;
pub mod robustness;
pub mod scale;
pub mod sensor;
pub mod sydney;
pub mod trade;
