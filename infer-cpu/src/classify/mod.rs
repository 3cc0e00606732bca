//! From a cloud to its class: normalisation, sampling, the network, and the answer.

pub mod calibrate;
pub mod choose;
pub mod classifier;
#[cfg(feature = "evaluate")]
pub mod evaluate;
mod load;
pub mod normalize;
pub mod options;
pub mod prediction;
mod selection;
pub mod team;
