//! Trains PointNet and its Critical Points Layer on any CPU.
//!
//! A [`Job`] trains a network on labelled [`Clouds`] by a [`Recipe`], and writes a model file that
//! infer-cpu reads. [`evaluate()`] measures such a file.
//!
//! ```no_run
//! use std::path::Path;
//!
//! use formats::split::Split;
//! use infer_cpu::Options;
//! use train::{Clouds, Job, Progress, Recipe, evaluate};
//!
//! fn main() -> Result<(), train::Error> {
//!     let recipe = Recipe { epochs: 20, ..Recipe::read(Path::new("edge-64"))? };
//!     let clouds = Clouds::read(recipe.normalization, Path::new("train.npz"), Split::Train)?;
//!     let (data, out) = ("train.npz", Path::new("model.safetensors"));
//!     let job = Job { recipe, clouds: &clouds, data, data_name: data, out, overwrite: false };
//!     job.run(None, &mut |progress| {
//!         if let Progress::Epoch(epoch) = progress {
//!             println!("{epoch}");
//!         }
//!     })?;
//!     let found = evaluate(out, &clouds, &Options::default())?;
//!     println!("{:.1} % of its own training clouds", 100.0 * found.instance_accuracy());
//!     Ok(())
//! }
//! ```
//!
//! The way of a cloud: `training` splits the clouds and runs the epochs of a `run`; `batches` and
//! `augment` draw its batches; `trainer` takes a step on each: a forward and backward pass of the
//! `model`, whose layers compute their own gradients (`layer`), and an update by `adam`. After each
//! epoch, `run` evaluates the network and writes a `checkpoint`; at the end, `model_file` writes
//! the best weights.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]
#![deny(unsafe_code)]

mod accuracy_report;
mod adam;
mod augment;
mod batch;
mod batches;
mod calibration;
mod checkpoint;
#[doc(hidden)]
pub mod cli;
mod clouds;
mod cluster;
mod detections;
mod draws;
mod error;
mod evaluate;
mod explanation_drawing;
mod init;
mod job;
mod layer;
mod lime;
mod loss;
mod matrix;
mod metrics;
mod mlp;
mod model;
mod model_file;
mod network;
mod object_report;
mod parameter;
mod point_encoder;
mod recipe;
mod recipe_tables;
mod run;
#[cfg(test)]
mod tests;
mod trainer;
mod training;

pub use clouds::Clouds;
pub use error::Error;
pub use evaluate::evaluate;
pub use job::{Job, Progress};
pub use metrics::Epoch;
pub use recipe::{Augment, ClusterVariation, Cpl, Edge, Recipe, Sampling, Schedule, Shape};
