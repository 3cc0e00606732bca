//! PointNet behind a Critical Points Layer, without a GPU.
//!
//! [`Classifier`] goes from a cloud to a class; [`sampler`] chooses points,
//! [`kernel`] multiplies.

#![deny(unsafe_code)]

mod calibrate;
mod choose;
mod classifier;
mod dense;
mod edge_conv;
mod engine;
mod error;
#[cfg(feature = "evaluate")]
mod evaluate;
mod forward;
pub mod kernel;
mod layers;
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
        BLOCK, GROUP, RUN_BLOCKS, SMALL_VECTOR, VECTOR_BLOCK, VECTOR_CHUNK, folding_pays,
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
pub use error::Error;
#[cfg(feature = "evaluate")]
pub use evaluate::{Evaluation, evaluate, evaluate_some};
pub use formats::model_card::{ModelCard, Normalization};
pub use normalize::to_unit_sphere;
pub use options::{Options, TNets, UpAxis};
pub use precision::Precision;
pub use prediction::Prediction;
pub use summary::{LayerShape, NetShape, Summary, inspect};
