//! The commands of the program `edgepuck`, each in its own module.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod adapters;
#[cfg(feature = "models")]
mod advise;
mod brightness;
mod calibrate;
mod caster;
pub mod cli;
mod colours;
mod corrupt;
#[cfg(feature = "models")]
mod detect;
mod effect_flags;
mod flags;
mod gen_dataset;
mod gen_scenes;
mod gen_shapes;
#[cfg_attr(not(feature = "models"), allow(dead_code, reason = "`detect` uses the rest"))]
mod kitti;
mod merge_dataset;
mod points;
mod profile;
mod scan;
#[cfg(feature = "models")]
mod segment;
mod shard;
mod shell;
mod signals;
#[cfg_attr(not(feature = "models"), allow(dead_code, reason = "`detect` uses the rest"))]
mod street;
mod threads;
mod view;

pub use program::outcome::{self, Outcome, Usage};
