//! The commands of the program `edgepuck`, each in its own module.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod adapters;
#[cfg(feature = "models")]
mod advise;
mod brightness;
mod calibrate;
mod card;
mod caster;
pub mod cli;
mod cluster;
mod colours;
mod corrupt;
mod cuboid;
#[cfg(feature = "models")]
pub mod detect;
mod effect_flags;
#[cfg(feature = "models")]
mod export_onnx;
pub mod flags;
pub mod gen_dataset;
mod gen_drive;
pub mod gen_scenes;
pub mod gen_shapes;
#[cfg(feature = "models")]
mod import_weights;
#[cfg_attr(not(feature = "models"), allow(dead_code, reason = "`detect` uses the rest"))]
mod kitti;
mod merge_dataset;
pub mod points;
mod preview;
mod preview_scan;
mod profile;
mod sample_surfaces;
mod scan;
mod segment;
mod shard;
mod shell;
mod signals;
pub mod significant_digits;
#[cfg_attr(not(feature = "models"), allow(dead_code, reason = "`detect` uses the rest"))]
mod street;
mod view;
mod weather;

pub use formats::outcome::{self, Outcome, Usage};
