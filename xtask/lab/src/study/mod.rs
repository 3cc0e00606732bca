//! The studies, each of which ends in a record.

pub mod ablation;
pub mod casting;
pub mod devices;
pub mod numerics;
pub mod reproduce;
pub mod trade;
pub mod uniform_raster;
