//! What a network says about a cloud, in C's types.

use infer_cpu::{Precision, Prediction};

/// The class of a cloud, and how it was found.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgepuckPrediction {
    /// The class: see edgepuck_class_name. Of equal logits the first wins.
    pub class_index: usize,
    /// Its probability by the network's softmax, 0 to 1.
    pub confidence: f64,
    /// Points of the cloud, without those that were dropped.
    pub n_points: usize,
    /// Points that were dropped because a coordinate was not finite.
    pub n_dropped: usize,
    /// Points that the network saw: those that the sampler kept, each once.
    pub n_used: usize,
    /// Activations that the calibrated ranges of "i8" clipped.
    pub n_clipped: u64,
    /// Whether the precision asked for overflowed on this cloud, so that it was
    /// classified in "f32".
    pub fell_back: bool,
    /// Whether the answer is "unknown", because the model is not meant to
    /// recognise such an object; class_index then states what it resembles most.
    pub is_unknown: bool,
}

impl EdgepuckPrediction {
    /// `found` by a classifier that was to compute in `precision`.
    pub(crate) fn new(found: &Prediction, precision: Precision) -> Self {
        Self {
            class_index: found.class,
            confidence: found.confidence(),
            n_points: found.n_points,
            n_dropped: found.n_dropped,
            n_used: found.n_used,
            n_clipped: found.n_clipped,
            fell_back: found.precision != precision,
            is_unknown: found.is_unknown,
        }
    }
}
