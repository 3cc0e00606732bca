//! PointNet behind a Critical Points Layer, without a GPU.

#![deny(unsafe_code)]

mod calibrate;
mod classifier;
mod dense;
mod engine;
mod error;
mod forward;
pub mod kernel;
mod layers;
mod network;
mod normalize;
mod precision;
mod prediction;
mod team;

pub use classifier::{Classifier, Options};
pub use error::Error;
pub use formats::model_card::{ModelCard, Normalization};
pub use precision::Precision;
pub use prediction::Prediction;
