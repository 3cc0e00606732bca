use std::path::Path;

use edgepuck_segment::{
    Hierarchy, Label, Node, SegmentError, Segmenter, Settings, SettingsError, Sweep,
};

use super::cluster_classifier::ClusterClassifier;
use super::object::Object;
use super::rule::MARGIN_OF_WHOLES;
use crate::classify::classifier::Classifier;
use crate::classify::options::Options;
use crate::classify::prediction::Prediction;
use crate::error::Error;

/// The least confidence of an object, chosen by the false alarms on labelled sweeps
/// (assets/reports/reality/frames.md).
pub const LEAST_CONFIDENCE: f64 = 0.7;

/// Detects and classifies objects in sweeps.
pub struct Detector {
    segmenter: Segmenter,
    /// Wider clusters are no objects, metres.
    widest_m: f32,
    classifier: ClusterClassifier,
    /// The least confidence of an object, [`LEAST_CONFIDENCE`] at first; clusters below count as
    /// unknown.
    pub min_confidence: f64,
}

/// The objects of a sweep.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Detections {
    /// The label of each point.
    pub labels: Vec<Label>,
    /// The clusters of known classes with enough confidence, in the order of their numbers.
    pub objects: Vec<Object>,
    /// The number of the other clusters: of unknown class, with too little confidence, or too wide.
    pub n_other: usize,
}

/// An error of a detector.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DetectError {
    /// An invalid setting of the segmentation.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// The model cannot be used.
    #[error(transparent)]
    Model(#[from] Error),
    /// The sweep cannot be segmented.
    #[error(transparent)]
    Sweep(#[from] SegmentError),
    /// A cluster cannot be classified, for example because the network overflows; the cause in
    /// words.
    #[error("{0}")]
    Cluster(String),
}

impl Detections {
    /// The index of the object whose points have this label.
    #[must_use]
    pub fn object(&self, label: Label) -> Option<usize> {
        let Label::Cluster(number) = label else { return None };
        self.objects.binary_search_by_key(&number, |object| object.cluster).ok()
    }
}

impl Detector {
    /// A detector with a bundled model or the one at a path, for clusters of at least
    /// `min_points` points.
    ///
    /// # Errors
    /// A model that cannot be loaded with these options, or that has learnt whole objects.
    pub fn open(model: &Path, options: &Options, min_points: usize) -> Result<Self, DetectError> {
        let classifier = Classifier::load(model, options)?;
        let mut settings = Settings::default();
        settings.min_points = min_points;
        let widest_m = settings.max_size_m;
        Ok(Self {
            segmenter: Segmenter::new(settings)?,
            widest_m,
            classifier: ClusterClassifier::new(classifier)?,
            min_confidence: LEAST_CONFIDENCE,
        })
    }

    /// Cuts `sweep`, in the sensor's frame, into the clusters that are recognised best.
    ///
    /// # Errors
    /// A wrong number of rings; a network that overflows on a cluster.
    pub fn detect(&mut self, sweep: &Sweep<'_>) -> Result<Detections, DetectError> {
        let Self { segmenter, widest_m, classifier, min_confidence, .. } = self;
        let hierarchy = segmenter.hierarchy(sweep)?;
        let mut answers = answers(classifier, hierarchy, sweep.points, *widest_m)?;
        let worths: Vec<f64> = answers.iter().map(|(worth, _)| *worth).collect();
        let (nodes, cut) = segmenter.cut(&worths, MARGIN_OF_WHOLES);
        let mut found = Detections { labels: cut.labels().to_vec(), ..Detections::default() };
        for ((cluster, &node), number) in cut.clusters().zip(nodes).zip(0..) {
            let is_object =
                |answer: &Prediction| !answer.is_unknown && answer.confidence() >= *min_confidence;
            match answers[node].1.take().filter(is_object) {
                None => found.n_other += 1,
                Some(answer) => {
                    let cloud = positions(sweep.points, cluster.points);
                    found.objects.push(Object::new(number, &answer, &cloud, cluster.ground_z_m));
                }
            }
        }
        Ok(found)
    }
}

/// The worth of each node, and the answer of the network; `None` for those that are too wide for an
/// object, which are not classified.
fn answers(
    classifier: &mut ClusterClassifier,
    hierarchy: &Hierarchy,
    points: &[[f32; 3]],
    widest_m: f32,
) -> Result<Vec<(f64, Option<Prediction>)>, DetectError> {
    let is_asked = |node: &Node<'_>| node.diagonal_m <= widest_m;
    let asked = hierarchy.nodes().filter(is_asked);
    let clouds: Vec<_> =
        asked.map(|node| (positions(points, node.points), node.ground_z_m)).collect();
    let clouds = clouds.iter().map(|(cloud, ground_z_m)| (&cloud[..], *ground_z_m));
    let mut found = Vec::with_capacity(hierarchy.len());
    classifier.classify(clouds, |worth, answer| {
        let answer = answer.cloned().map_err(|error| DetectError::Cluster(error.to_string()));
        found.push(answer.map(|answer| (worth, Some(answer))));
    });
    let mut found = found.into_iter();
    let of = |node: Node<'_>| match is_asked(&node) {
        true => found.next().expect("invariant: there is an answer for each cloud"),
        false => Ok((classifier.worth_of_unknown(node.points.len()), None)),
    };
    hierarchy.nodes().map(of).collect()
}

fn positions(points: &[[f32; 3]], of: &[u32]) -> Vec<[f32; 3]> {
    of.iter().map(|&i| points[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector(min_points: usize) -> Result<Detector, DetectError> {
        let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
        Detector::open(&weights.join("street-128.safetensors"), &Options::default(), min_points)
    }

    /// Level ground 1.2 m below the sensor, and a board of 2 m by 1.7 m that stands on it, 6 m ahead.
    fn sweep() -> (Vec<[f32; 3]>, Vec<u16>) {
        let (mut points, mut rings) = (Vec::new(), Vec::new());
        for (ring, elevation_deg) in (0u16..).zip((-15..=15).step_by(2)) {
            for azimuth_deg in 0..360 {
                let [azimuth, elevation] =
                    [azimuth_deg, elevation_deg].map(|degrees| f64::from(degrees).to_radians());
                let (sin, cos) = azimuth.sin_cos();
                let [y, z] = [6.0 * sin / cos, 6.0 * elevation.tan() / cos];
                if cos > 0.0 && y.abs() <= 1.0 && (-1.2..=0.5).contains(&z) {
                    points.push([6.0, y as f32, z as f32]);
                    rings.push(ring);
                } else if elevation < 0.0 {
                    let away = 1.2 / -elevation.tan();
                    points.push([(away * cos) as f32, (away * sin) as f32, -1.2]);
                    rings.push(ring);
                }
            }
        }
        (points, rings)
    }

    #[test]
    fn clusters_are_objects_or_counted() {
        let (points, rings) = sweep();
        let sweep = Sweep { points: &points, rings: Some(&rings) };
        let mut detector = detector(20).unwrap();
        assert_eq!(detector.min_confidence, LEAST_CONFIDENCE);
        for (min_confidence, n_objects) in [(0.0, None), (1.1, Some(0))] {
            detector.min_confidence = min_confidence;
            let found = detector.detect(&sweep).unwrap();
            assert_eq!(found.labels.len(), points.len());
            assert_eq!(found.objects.len() + found.n_other, 1);
            assert!(n_objects.is_none_or(|expected| expected == found.objects.len()));
            // The lowest points of the board are taken as ground.
            let mut clustered = found.labels.iter().zip(&points);
            let n_clustered =
                clustered.clone().filter(|(label, _)| **label == Label::Cluster(0)).count();
            assert!(clustered.all(|(label, at)| *label != Label::Cluster(0) || at[0] == 6.0));
            for object in &found.objects {
                assert_eq!(found.object(Label::Cluster(object.cluster)), Some(0));
                assert_eq!(object.n_points, n_clustered);
            }
        }
    }

    #[test]
    fn errors_have_types() {
        let absent = Detector::open(Path::new("absent.safetensors"), &Options::default(), 20);
        assert!(matches!(absent, Err(DetectError::Model(_))));
        let few_rings = Sweep { points: &[[1.0; 3]; 2], rings: Some(&[0]) };
        let found = detector(20).unwrap().detect(&few_rings);
        assert!(matches!(found, Err(DetectError::Sweep(_))));
    }
}
