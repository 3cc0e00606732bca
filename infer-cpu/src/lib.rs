//! Classifies point clouds on a CPU by PointNet, behind a Critical Points Layer or another sampler.
//!
//! From a cloud to its class:
//!
//! ```no_run
//! use std::path::Path;
//!
//! use infer_cpu::{Classifier, Options, read_cloud};
//!
//! let mut classifier = Classifier::load(Path::new("model.safetensors"), &Options::default())?;
//! let cloud = read_cloud(Path::new("chair.ply"))?;
//! let prediction = classifier.classify_f64(&cloud)?;
//! println!("{} ({:.1} %)", prediction.answer(), 100.0 * prediction.confidence());
//! # Ok::<(), infer_cpu::Error>(())
//! ```
//!
//! A [`Classifier`] is loaded once, from a file or from a program's memory
//! ([`Classifier::from_bytes`]). It then allocates no memory for clouds of up to
//! [`Options::capacity`] points, as arrays of f32 ([`Classifier::classify`]) or f64. [`Options`]
//! choose the precision, the threads and the [`sampler`]. A [`ClassifierTeam`] classifies many clouds
//! at a time.
//!
//! [`choose`] thins a cloud without a network, `evaluate` measures accuracy on a labelled set, `detect`
//! finds the objects of a sweep, `live` tracks objects in the packets of a sensor, [`inspect`] summarises a model file, and [`kernel`]
//! lists instruction sets.
//!
//! # Features
//! `npz`, `ply`, `pcd` and `las` read clouds of these formats. `evaluate`, `detect` and `live` add what their
//! names say, and `mcap` recordings. `bundled` embeds the models of `edgepuck_assets`, which
//! [`Classifier::load`] then takes by their names. `cli` builds the program `infer-cpu`; a library's user leaves it
//! out and names the formats: `infer-cpu = { version = "0.1", default-features = false, features =
//! ["npz", "ply"] }`. Text, NPY and KITTI's `.bin` are always read.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]
#![forbid(unsafe_code)]

#[cfg(feature = "detect")]
mod birdseye;
mod classify;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(feature = "detect")]
pub mod detect;
mod engine;
mod error;
mod limits;
#[cfg(feature = "live")]
pub mod live;
mod model;
mod precision;
pub mod sampler;

/// The instruction sets that inner loops are written for.
pub mod kernel {
    pub use edgepuck_kernels::{KernelName, Kernels, available, fastest};
    #[doc(hidden)]
    pub use edgepuck_kernels::{Neighborhood, PooledProducts, WIDTH_STEP};
}

/// How a team of threads divides a cloud, for models of its speed.
#[doc(hidden)]
pub mod sharing {
    pub use edgepuck_kernels::prefilter_pays;

    pub use crate::engine::{
        BLOCK, GROUP, RUN_BLOCKS, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, block_points,
        folding_pays,
    };
}

/// The layers of a model file, for programs that convert it.
#[doc(hidden)]
pub mod model_file {
    pub use edgepuck_kernels::Dense;

    pub use crate::model::network::{Network, SetAbstraction, TNet, open, read};
}

pub use classify::calibrate::on_clouds as activation_ranges;
#[cfg(feature = "npz")]
pub use classify::calibrate::on_set as activation_ranges_of_set;
#[doc(hidden)]
pub use classify::calibrate::on_shapes as activation_ranges_by_rule;
pub use classify::choose::choose;
pub use classify::classifier::Classifier;
#[cfg(feature = "evaluate")]
pub use classify::evaluate::{Evaluation, evaluate};
#[doc(hidden)]
pub use classify::normalize::{normalize, to_unit_sphere};
pub use classify::options::Options;
pub use classify::prediction::{Prediction, UNKNOWN};
pub use classify::team::ClassifierTeam;
pub use error::Error;
pub use formats::cloud_file::read_cloud;
pub use formats::model_card::{ModelCard, Normalization};
pub use model::summary::{LayerShape, NetShape, Summary, inspect};
pub use precision::Precision;
