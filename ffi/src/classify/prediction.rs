use infer_cpu::Prediction;

/// The class of a cloud, and how it was computed.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EdgepuckPrediction {
    /// The class: see edgepuck_class_name. If logits are equal, the first wins.
    pub class_index: usize,
    /// Its probability by the softmax of the network, 0 to 1.
    pub confidence: f64,
    /// The number of points of the cloud that are finite.
    pub n_points: usize,
    /// The number of points that were dropped because a coordinate was not finite.
    pub n_dropped: usize,
    /// The number of points that the network processed: those that the sampler kept, each once.
    pub n_used: usize,
    /// The number of activations that were clipped to the calibrated ranges of "i8".
    pub n_clipped: u64,
    /// Whether the object belongs to no known class; class_index is then the class that it
    /// resembles most.
    pub is_unknown: bool,
}

impl EdgepuckPrediction {
    pub(crate) fn new(found: &Prediction) -> Self {
        Self {
            class_index: found.class,
            confidence: found.confidence(),
            n_points: found.n_points,
            n_dropped: found.n_dropped,
            n_used: found.n_used,
            n_clipped: found.n_clipped,
            is_unknown: found.is_unknown,
        }
    }
}
