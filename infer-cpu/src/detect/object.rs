use edgepuck_segment::OrientedBox;

use crate::classify::prediction::Prediction;
use crate::classify::usual_size::usual_size_m;

/// A cluster of a known class.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Object {
    /// Its number among the clusters, as in [`Detections::labels`](super::Detections::labels).
    pub cluster: u32,
    /// Its class.
    pub class: String,
    /// The confidence of the network in the class, 0 to 1.
    pub confidence: f64,
    /// The number of its points.
    pub n_points: usize,
    /// The box around its points.
    pub place: OrientedBox<f32>,
    /// The box of the whole object, by the usual size of its class; the same as `place` for other
    /// classes than those of streets.
    pub whole: OrientedBox<f32>,
}

impl Object {
    /// The object in the cluster `number`, of the points `cloud`, on ground of this height.
    pub(super) fn new(
        number: u32,
        answer: &Prediction,
        cloud: &[[f32; 3]],
        ground_z_m: Option<f32>,
    ) -> Self {
        let (class, place) = (answer.label.to_string(), OrientedBox::around(cloud));
        Self {
            cluster: number,
            whole: usual_size_m(&class)
                .map_or(place, |usual_m| place.completed(usual_m, ground_z_m)),
            class,
            confidence: answer.confidence(),
            n_points: cloud.len(),
            place,
        }
    }
}
