//! The studies, each of which ends in a record.

pub mod ablation;
pub mod casting;
pub mod devices;
pub mod frames;
pub mod gpu;
mod meshes;
pub mod numerics;
mod plan;
pub mod reproduction;
mod resume;
pub mod robustness;
pub mod scale;
pub mod sensor;
pub mod sydney;
#[cfg(test)]
mod test_clouds;
pub mod trade;
pub mod uniform_raster;
