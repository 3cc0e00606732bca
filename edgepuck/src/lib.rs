//! The commands of the program `edgepuck`, each in its own module.

pub mod adapters;
#[cfg(feature = "models")]
pub mod advise;
mod brightness;
pub mod card;
pub mod caster;
pub mod checkout;
pub mod cli;
pub mod cluster;
pub mod corrupt;
#[cfg(feature = "models")]
pub mod detect;
#[cfg(feature = "models")]
pub mod export_onnx;
pub mod flags;
pub mod gen_dataset;
pub mod gen_drive;
pub mod gen_scenes;
pub mod gen_shapes;
#[cfg(feature = "models")]
pub mod import_weights;
pub mod merge_dataset;
pub mod preview;
pub mod preview_scan;
pub mod profile;
pub mod sample_surfaces;
#[cfg(feature = "models")]
pub mod sampler_config;
pub mod scan;
pub mod segment;
mod shell;
pub mod significant_digits;
#[cfg(feature = "models")]
pub mod trade_record;
pub mod trainer;
pub mod weather;

pub use formats::outcome::{self, Outcome, Usage};
