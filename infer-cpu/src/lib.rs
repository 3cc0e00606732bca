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
//! [`choose`] thins a cloud without a network, `evaluate` measures accuracy on a labelled set, `live`
//! tracks objects in the packets of a sensor, [`inspect`] summarises a model file, and [`kernel`]
//! lists instruction sets.
//!
//! # Features
//! `npz`, `ply`, `pcd` and `las` read clouds of these formats. `evaluate` and `live` add what their
//! names say, and `mcap` recordings. `bundled` embeds the models of `edgepuck_assets`, which
//! [`Classifier::load`] then takes by their names. `cli` builds the program `infer-cpu`; a library's user leaves it
//! out and names the formats: `infer-cpu = { version = "0.1", default-features = false, features =
//! ["npz", "ply"] }`. Text, NPY and KITTI's `.bin` are always read.

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![deny(unsafe_code)]

mod calibrate;
mod choose;
mod classifier;
mod classifier_team;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
mod dense;
mod edge_conv;
mod engine;
mod error;
#[cfg(feature = "evaluate")]
mod evaluate;
mod forward;
pub mod kernel;
mod layers;
#[cfg(feature = "live")]
pub mod live;
mod network;
mod normalize;
mod options;
mod precision;
mod prediction;
mod prefilter;
pub mod rule;
pub mod sampler;
mod selection;
mod set_abstraction;
mod source;
mod summary;
mod team;
mod test_time_augmentation;
mod usual_size;

/// How a team of threads divides a cloud, for models of its speed.
#[doc(hidden)]
pub mod sharing {
    pub use crate::engine::{
        BLOCK, GROUP, RUN_BLOCKS, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, block_points,
        folding_pays,
    };
    pub use crate::prefilter::prefilter_pays;
}

/// The layers of a model file, for programs that convert it.
#[doc(hidden)]
pub mod model_file {
    pub use crate::dense::Dense;
    pub use crate::network::{Network, SetAbstraction, TNet, open, read};
}

pub use calibrate::on_clouds as activation_ranges;
#[cfg(feature = "npz")]
pub use calibrate::on_set as activation_ranges_of_set;
#[doc(hidden)]
pub use calibrate::on_shapes as activation_ranges_by_rule;
pub use choose::choose;
pub use classifier::Classifier;
pub use classifier_team::ClassifierTeam;
pub use error::Error;
#[cfg(feature = "evaluate")]
pub use evaluate::{Evaluation, evaluate, evaluate_some};
pub use formats::cloud_file::read_cloud;
pub use formats::model_card::{ModelCard, Normalization};
#[doc(hidden)]
pub use normalize::{normalize, to_unit_sphere};
pub use options::{Options, UpAxis};
pub use precision::Precision;
#[doc(hidden)]
pub use prediction::energy;
pub use prediction::{Prediction, UNKNOWN};
pub use summary::{LayerShape, NetShape, Summary, inspect};
pub use usual_size::usual_size_m;
