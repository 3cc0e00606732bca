//! The C interface of `infer-cpu`, `include/edgepuck.h`: functions that take raw pointers, check
//! them, and return a status.
//!
//! Doc comments here are for readers of that header, which is generated from them.

mod classifier;
mod live;
mod options;
mod prediction;
mod status;

pub use classifier::{
    EdgepuckClassifier, edgepuck_class_name, edgepuck_classify, edgepuck_free, edgepuck_load,
    edgepuck_logits, edgepuck_n_classes, edgepuck_version,
};
pub use live::{
    EdgepuckLive, EdgepuckLiveCounts, EdgepuckObject, edgepuck_live_close, edgepuck_live_counts,
    edgepuck_live_end, edgepuck_live_next, edgepuck_live_open, edgepuck_live_take,
};
pub use options::{EdgepuckOptions, edgepuck_options_default};
pub use prediction::EdgepuckPrediction;
pub use status::{EdgepuckStatus, edgepuck_last_error};
