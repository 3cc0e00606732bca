//! Classifies point clouds on a CPU by PointNet, behind a Critical Points Layer or another sampler.
//!
//! From a cloud to its class:
//!
//! ```
//! use std::path::Path;
//!
//! use infer_cpu::{Classifier, Options, read_cloud};
//!
//! # let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/weights/edge-64.safetensors");
//! # let folder = tempfile::tempdir().unwrap();
//! # let cloud = folder.path().join("chair.xyz");
//! # std::fs::write(&cloud, "0 0 0\n1 0 0\n0 2 0\n0 0 3\n").unwrap();
//! // `model` and `cloud` are paths; the checkout has models in assets/weights.
//! let mut classifier = Classifier::load(Path::new(model), &Options::default())?;
//! let cloud = read_cloud(&cloud)?;
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
//! names say, and `mcap` recordings. `cli` builds the program `infer-cpu`; a library's user can leave
//! it out: `infer-cpu = { version = "0.1", default-features = false }`.

#![deny(unsafe_code)]

mod calibrate;
mod choose;
mod classifier;
mod classifier_team;
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
pub mod sampler;
mod selection;
mod source;
mod summary;
mod team;
mod test_time_augmentation;

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
    pub use crate::network::{Network, TNet, read, read_bytes};
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
pub use options::{Options, TNets, UpAxis};
pub use precision::Precision;
#[doc(hidden)]
pub use prediction::energy;
pub use prediction::{Prediction, UNKNOWN};
pub use summary::{LayerShape, NetShape, Summary, inspect};
