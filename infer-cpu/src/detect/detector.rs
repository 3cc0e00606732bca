use std::path::Path;

use edgepuck_segment::{
    Cluster, Label, OrientedBox, SegmentError, Segmenter, Settings, SettingsError, Sweep,
};
use formats::FormatError;

use super::candidates::{Candidate, Candidates};
use super::confidence::Confidence;
use super::object::{Object, is_possible, whole};
use crate::birdseye::{BirdsEye, Heights, Seen};
use crate::classify::classifier::Classifier;
use crate::classify::options::Options;
use crate::classify::team::ClassifierTeam;
use crate::error::Error;
use crate::model::source::ModelSource;

/// The least confidence of an object, chosen with one source of labelled sweeps left out after the other
/// (assets/reports/reality/by-class.md).
pub const LEAST_CONFIDENCE: f64 = 0.5;

/// An object keeps the points that no surer one has, if these are this share of its points.
const LEAST_SHARE: f64 = 0.5;

/// Detects and classifies objects in sweeps.
pub struct Detector {
    segmenter: Segmenter,
    candidates: Candidates,
    asked: ClassifierTeam,
    joint: Confidence,
    min_points: usize,
    /// The least confidence of an object, [`LEAST_CONFIDENCE`] at first; what is less sure counts as
    /// unknown.
    pub min_confidence: f64,
}

/// The objects of a sweep.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Detections {
    /// The label of each point.
    pub labels: Vec<Label>,
    /// The objects of known classes with enough confidence, the surest first: the first clusters.
    pub objects: Vec<Object>,
    /// The number of the other clusters, which are unknown.
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
}

impl Detections {
    /// The index of the object whose points have this label.
    #[must_use]
    pub fn object(&self, label: Label) -> Option<usize> {
        let Label::Cluster(number) = label else { return None };
        Some(number as usize).filter(|&number| number < self.objects.len())
    }
}

/// A candidate, its class and the confidence in it.
struct Named {
    seen: Seen,
    points: Vec<u32>,
    ground_z_m: f32,
    class: String,
    confidence: f64,
}

impl Detector {
    /// A detector with a bundled bird's-eye model or the one at a path, for objects of at least
    /// `min_points` points. The model that it asks is beside it, or bundled.
    ///
    /// # Errors
    /// A model that cannot be loaded with these options.
    pub fn open(model: &Path, options: &Options, min_points: usize) -> Result<Self, DetectError> {
        let mut settings = Settings::default();
        settings.min_points = min_points;
        Self::with(model, options, min_points, settings)
    }

    /// The same, whose other clusters are those of a segmentation with these settings.
    ///
    /// # Errors
    /// As [`Detector::open`]; invalid settings.
    pub fn with(
        model: &Path,
        options: &Options,
        min_points: usize,
        settings: Settings,
    ) -> Result<Self, DetectError> {
        let (mut file, card) =
            ModelSource::of(model).and_then(|source| source.open()).map_err(Error::from)?;
        let wrong =
            |part: &str, cause: String| Error::from(FormatError::malformed(model, part, cause));
        let name = card.asked.as_deref().ok_or_else(|| {
            let cause = "expected a bird's-eye model, such as street-bev, found a model of clouds";
            wrong("card", cause.to_owned())
        })?;
        let birdseye = BirdsEye::new(&mut file, &card, options)?;
        let asked = Classifier::load(&beside(model, name), options)?;
        asked.unsuited_to_clusters().map_or(Ok(()), |cause| Err(Error::WholeObjects(cause)))?;
        let joint = Confidence::new(&card, &asked).map_err(|cause| wrong("card", cause))?;
        Ok(Self {
            segmenter: Segmenter::new(settings)?,
            candidates: Candidates::new(birdseye, min_points)?,
            asked: ClassifierTeam::new(asked)?,
            joint,
            min_points,
            min_confidence: LEAST_CONFIDENCE,
        })
    }

    /// The names of the known classes.
    #[must_use]
    pub fn classes(&self) -> Vec<String> {
        self.joint.classes()
    }

    /// The clusters of the last sweep: the objects, in their order, and then the others.
    pub fn clusters(&self) -> impl ExactSizeIterator<Item = Cluster<'_>> {
        self.segmenter.segmentation().clusters()
    }

    /// Finds the objects of `sweep`, in the sensor's frame, and cuts what is left into clusters.
    ///
    /// # Errors
    /// A wrong number of rings, or more than four billion points.
    pub fn detect(&mut self, sweep: &Sweep<'_>) -> Result<Detections, DetectError> {
        let segmented = self.segmenter.segment(sweep)?;
        // Without ground, nothing is seen from above, and all clusters are unknown.
        let candidates = Heights::of(sweep.points, segmented.labels()).map(|ground| {
            let clusters = segmented.clusters().map(|cluster| cluster.points.to_vec());
            let labels = segmented.labels();
            self.candidates.of(sweep.points, labels, clusters, &ground, &self.joint)
        });
        let candidates = self.named(sweep.points, candidates.unwrap_or_default());
        let chosen = self.choose(candidates, sweep.points.len());
        let clusters = chosen.iter().map(|one| (&one.points[..], Some(one.ground_z_m)));
        self.segmenter.claim(clusters);
        let segmentation = self.segmenter.segmentation();
        let labels = segmentation.labels().to_vec();
        let n_other = segmentation.clusters().len() - chosen.len();
        let object = |(cluster, one): (u32, Named)| {
            let place = OrientedBox::around(&positions(sweep.points, &one.points));
            Object {
                cluster,
                n_points: one.points.len(),
                whole: whole(&one.seen, &place, one.ground_z_m),
                place,
                class: one.class,
                confidence: one.confidence,
            }
        };
        Ok(Detections { labels, objects: (0..).zip(chosen).map(object).collect(), n_other })
    }

    /// The likeliest class of each candidate, by the model of clusters that is asked about its points. One on
    /// which that overflows is none.
    fn named(&mut self, points: &[[f32; 3]], mut candidates: Vec<Candidate>) -> Vec<Named> {
        // No answer makes the others sure enough.
        candidates.retain(|Candidate { seen, is_cluster, .. }| {
            seen.iter().any(|seen| self.joint.at_most(seen, *is_cluster) >= self.min_confidence)
        });
        let clouds: Vec<_> = candidates
            .iter()
            .map(|one| (positions(points, &one.points), Some(one.ground_z_m)))
            .collect();
        let clouds = clouds.iter().map(|(cloud, ground_z_m)| (&cloud[..], *ground_z_m));
        let Self { asked, joint, .. } = self;
        let (mut waiting, mut named) = (candidates.into_iter(), Vec::new());
        asked.classify_many(clouds, |answer| {
            let (Some(one), Ok(answer)) = (waiting.next(), answer) else { return };
            let Candidate { points, ground_z_m, seen, is_cluster } = one;
            let joined = seen.into_iter().map(|seen| (joint.of(&seen, is_cluster, answer), seen));
            let possible = joined.filter(|((class, _), seen)| is_possible(class, seen.size_m));
            let best = possible.max_by(|((_, a), _), ((_, b), _)| a.total_cmp(b));
            if let Some(((class, confidence), seen)) = best {
                let class = class.to_owned();
                named.push(Named { seen, points, ground_z_m, class, confidence });
            }
        });
        named
    }

    /// The candidates that are sure enough, the surest first. A point belongs to the surest.
    fn choose(&self, mut candidates: Vec<Named>, n_points: usize) -> Vec<Named> {
        candidates.retain(|one| one.confidence >= self.min_confidence);
        candidates.sort_by(|a, b| b.confidence.total_cmp(&a.confidence));
        let mut is_free = vec![true; n_points];
        candidates.retain_mut(|one| {
            let n_before = one.points.len() as f64;
            one.points.retain(|&point| is_free[point as usize]);
            let n_left = one.points.len();
            let is_kept = n_left >= self.min_points && n_left as f64 >= LEAST_SHARE * n_before;
            if is_kept {
                one.points.iter().for_each(|&point| is_free[point as usize] = false);
            }
            is_kept
        });
        candidates
    }
}

/// The model `name` in the folder of the file `model`, or the bundled one.
fn beside(model: &Path, name: &str) -> std::path::PathBuf {
    let file = model.with_file_name(format!("{name}.safetensors"));
    if model.is_file() && file.exists() { file } else { name.into() }
}

fn positions(points: &[[f32; 3]], of: &[u32]) -> Vec<[f32; 3]> {
    of.iter().map(|&i| points[i as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn detector(min_points: usize) -> Detector {
        let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
        let model = weights.join("street-bev.safetensors");
        Detector::open(&model, &Options::default(), min_points).unwrap()
    }

    /// A candidate of the points from `first` on, `n` of them.
    fn candidate(class: &str, confidence: f64, first: u32, n: u32) -> Named {
        let (centre_m, size_m) = ([8.0, 0.0], [4.0, 1.6, 1.5]);
        Named {
            seen: Seen { class: 0, score: 0.5, centre_m, size_m, yaw_rad: 0.0 },
            points: (first..first + n).collect(),
            ground_z_m: -1.5,
            class: class.to_owned(),
            confidence,
        }
    }

    /// Of the points of two candidates, the surer has its own, and the other at least half of its own and
    /// as many as an object needs, or it is none.
    #[test]
    fn a_point_belongs_to_the_surest_object() {
        let detector = detector(20);
        let chosen = |all: Vec<Named>| {
            let chosen = detector.choose(all, 1000).into_iter();
            chosen.map(|one| (one.confidence, one.points.len())).collect::<Vec<_>>()
        };
        let sure = || candidate("car", 0.9, 0, 100);
        assert_eq!(chosen(vec![candidate("car", 0.6, 50, 100), sure()]), [(0.9, 100), (0.6, 50)]);
        assert_eq!(chosen(vec![candidate("car", 0.6, 49, 100), sure()]), [(0.9, 100)]);
        assert_eq!(chosen(vec![candidate("car", 0.6, 90, 29), sure()]), [(0.9, 100)]);
        assert_eq!(chosen(vec![candidate("car", 0.49, 200, 100)]), []);
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
        let mut detector = detector(5);
        assert_eq!(detector.min_confidence, LEAST_CONFIDENCE);
        assert_eq!(detector.classes(), ["car", "person", "two-wheeler", "bus", "truck"]);
        for (min_confidence, n_objects) in [(0.0, None), (1.1, Some(0))] {
            detector.min_confidence = min_confidence;
            let found = detector.detect(&sweep).unwrap();
            assert_eq!(found.labels.len(), points.len());
            assert!(found.objects.len() + found.n_other >= 1);
            assert_eq!(detector.clusters().len(), found.objects.len() + found.n_other);
            assert!(n_objects.is_none_or(|expected| expected == found.objects.len()));
            let is_sure = |pair: &[Object]| pair[0].confidence >= pair[1].confidence;
            assert!(found.objects.windows(2).all(is_sure));
            for (number, object) in found.objects.iter().enumerate() {
                let label = Label::Cluster(object.cluster);
                assert_eq!(found.object(label), Some(number));
                let own = found.labels.iter().filter(|found| **found == label).count();
                assert_eq!(object.n_points, own);
                let bottom_m = |of: &OrientedBox<f32>| of.centre_m[2] - of.size_m[2] / 2.0;
                assert!((bottom_m(&object.whole) - bottom_m(&object.place).min(-1.2)).abs() < 1e-5);
            }
            let other = Label::Cluster(found.objects.len() as u32);
            assert_eq!(found.object(other), None);
        }
    }

    #[test]
    fn a_sweep_without_ground_has_no_objects() {
        let points: Vec<_> = (0..40).map(|i| [6.0, 0.02 * i as f32, 0.5]).collect();
        let mut settings = Settings::default();
        settings.radius_m = Some(0.3);
        let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
        let model = weights.join("street-bev.safetensors");
        let mut detector = Detector::with(&model, &Options::default(), 5, settings).unwrap();
        let found = detector.detect(&Sweep { points: &points, rings: None }).unwrap();
        assert_eq!((found.objects.len(), found.n_other), (0, 1));
    }

    #[test]
    fn errors_have_types() {
        let open = |model: &str| Detector::open(Path::new(model), &Options::default(), 20);
        assert!(matches!(open("absent.safetensors"), Err(DetectError::Model(_))));
        let weights = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/weights");
        let cause = open(&format!("{weights}/street-128.safetensors")).err().unwrap().to_string();
        assert!(cause.contains("expected a bird's-eye model"), "{cause}");
        let few_rings = Sweep { points: &[[1.0; 3]; 2], rings: Some(&[0]) };
        assert!(matches!(detector(20).detect(&few_rings), Err(DetectError::Sweep(_))));
    }

    #[test]
    fn a_candidate_that_is_dropped_takes_no_points() {
        let all = vec![
            candidate("car", 0.8, 40, 100),
            candidate("car", 0.7, 100, 40),
            candidate("car", 0.9, 0, 100),
        ];
        let chosen = detector(20).choose(all, 1000).into_iter();
        let chosen: Vec<_> = chosen.map(|one| (one.confidence, one.points.len())).collect();
        assert_eq!(chosen, [(0.9, 100), (0.7, 40)]);
    }

    /// A cluster is asked about if one of the answers may be sure enough, and is a car of no impossible size.
    #[test]
    fn one_possible_answer_of_a_cluster_suffices() {
        let (points, _) = sweep();
        let mut detector = detector(20);
        let seen = |score: f32, length_m: f32| {
            let (centre_m, size_m) = ([8.0, 0.0], [length_m, 1.6, 1.5]);
            Seen { class: 0, score, centre_m, size_m, yaw_rad: 0.0 }
        };
        let most = [0.1, 0.6].map(|score| detector.joint.at_most(&seen(score, 4.0), true));
        let mut n_named = |min_confidence: f64, seen: Vec<Seen>| {
            detector.min_confidence = min_confidence;
            let points_of = (0..100).collect();
            let one = Candidate { points: points_of, ground_z_m: -1.2, seen, is_cluster: true };
            detector.named(&points, vec![one]).len()
        };
        let between = most[0].midpoint(most[1]);
        assert_eq!(n_named(between, vec![seen(0.1, 4.0)]), 0);
        assert_eq!(n_named(between, vec![seen(0.1, 4.0), seen(0.6, 4.0)]), 1);
        assert_eq!(n_named(0.0, vec![seen(0.6, 9.0)]), 0);
        assert_eq!(n_named(0.0, vec![seen(0.6, 9.0), seen(0.1, 4.0)]), 1);
    }
}
