//! Classifies point clouds on a CPU by PointNet, behind a Critical Points Layer
//! or another sampler.
//!
//! A [`Classifier`] takes a cloud to a class. It is loaded once, from a file or
//! from a program's memory, and then allocates nothing:
//!
//! ```
//! use infer_cpu::sampler::{SamplerKind, SamplerSpec};
//! use infer_cpu::{Classifier, Options};
//!
//! # let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/weights");
//! # let model = std::fs::read(format!("{weights}/edge-64.safetensors")).unwrap();
//! // A model file's bytes; `Classifier::load` takes a path.
//! let sampler = SamplerSpec { kind: SamplerKind::Fps, points: 64, ..SamplerSpec::default() };
//! let options = Options { threads: 2, sampler: Some(sampler), ..Options::default() };
//! let mut classifier = Classifier::from_bytes(&model, &options)?;
//!
//! let cloud: Vec<[f32; 3]> = (0..500u16)
//!     .map(|i| [f32::from(i).cos(), f32::from(i).sin(), f32::from(i) * 0.01])
//!     .collect();
//! let prediction = classifier.classify(&cloud)?;
//! println!("{} ({:.1} %)", prediction.answer(), 100.0 * prediction.confidence());
//! assert_eq!(prediction.n_used, 64);
//! # Ok::<(), infer_cpu::Error>(())
//! ```
//!
//! [`choose`] thins a cloud without a network, `evaluate` (feature `evaluate`)
//! measures accuracy on a labelled set, and [`inspect`] tells what a model file
//! holds. [`sampler`] chooses points; [`kernel`] lists the instruction sets.
//!
//! # Features
//! `npz`, `ply`, `pcd` and `las` read clouds of these formats by
//! `formats::cloud_file`. `evaluate` adds the evaluation. `cli` builds the
//! program `infer-cpu`; a library's user can leave it out:
//! `infer-cpu = { version = "0.1", default-features = false }`.

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

/// How a team of threads shares out a cloud, for models of its speed.
pub mod sharing {
    pub use crate::engine::{
        BLOCK, GROUP, RUN_BLOCKS, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, block_points,
        folding_pays,
    };
    pub use crate::prefilter::prefilter_pays;
}

/// What a model file holds, layer by layer, for programs that write it in
/// another form.
pub mod model_file {
    pub use crate::dense::Dense;
    pub use crate::network::{Network, TNet, read, read_bytes};
}

#[cfg(feature = "npz")]
pub use calibrate::on_set as activation_ranges_of_set;
pub use calibrate::{on_clouds as activation_ranges, on_shapes as activation_ranges_by_rule};
pub use choose::choose;
pub use classifier::Classifier;
pub use classifier_team::ClassifierTeam;
pub use error::Error;
#[cfg(feature = "evaluate")]
pub use evaluate::{Evaluation, evaluate, evaluate_some};
pub use formats::model_card::{ModelCard, Normalization};
pub use normalize::{normalize, to_unit_sphere};
pub use options::{Options, TNets, UpAxis};
pub use precision::Precision;
pub use prediction::{Prediction, UNKNOWN, energy};
pub use summary::{LayerShape, NetShape, Summary, inspect};
