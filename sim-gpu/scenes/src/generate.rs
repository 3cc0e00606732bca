//! Makes a training set of clusters from many scenes.

use std::ops::Range;
use std::path::Path;

use edgepuck_segment::{Label, Segmenter, Settings, Sweep as Points};
use formats::packed::{ClusterWriter, Remarks};
use rayon::prelude::*;

use crate::clusters::{LabelledCluster, label_clusters};
use crate::error::SceneError;
use crate::scene::DrawnScene;
use crate::stage::Stage;
use crate::sweep::Sweep;

/// The number of scenes in memory at once: enough to keep all cores busy.
const BATCH: u32 = 32;

/// One scene of this many goes to the test set.
const TEST_EACH: u32 = 10;

/// A scene with its sweep, segmented and labelled.
pub struct LabelledScene {
    /// The scene.
    pub scene: DrawnScene,
    /// The sweep of its sensor.
    pub sweep: Sweep,
    /// The segmentation's label of each point.
    pub labels: Vec<Label>,
    /// The clusters with their ground truth.
    pub clusters: Vec<LabelledCluster>,
}

/// The number of packed clusters by class, in the order of [`Stage::classes`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ClusterCounts {
    /// Clusters in the training set.
    pub train: Vec<usize>,
    /// Clusters in the test set.
    pub test: Vec<usize>,
}

/// Scans the scenes of `stage` with these `numbers`, segments them with `settings`, and packs the
/// clusters into `train.npz` and `test.npz` in `folder`; every tenth scene goes to the test set.
/// `each` is called with every scene, in order.
///
/// # Errors
/// A scene that cannot be scanned or segmented, a file that cannot be written, or an error of
/// `each`.
pub fn generate<E: From<SceneError>>(
    stage: &Stage,
    settings: &Settings,
    numbers: Range<u32>,
    folder: &Path,
    mut each: impl FnMut(&LabelledScene) -> Result<(), E>,
) -> Result<ClusterCounts, E> {
    let classes = stage.classes().to_vec();
    let n_classes = classes.len();
    let writer = |name: &str| ClusterWriter::create(&folder.join(name), classes.clone());
    let mut splits = [
        (writer("train.npz").map_err(SceneError::from)?, vec![0; n_classes]),
        (writer("test.npz").map_err(SceneError::from)?, vec![0; n_classes]),
    ];
    for first in numbers.clone().step_by(BATCH as usize) {
        let batch: Vec<LabelledScene> = (first..numbers.end.min(first.saturating_add(BATCH)))
            .into_par_iter()
            .map(|number| LabelledScene::new(stage, number, settings))
            .collect::<Result<_, SceneError>>()?;
        for done in &batch {
            let (writer, counts) = &mut splits[usize::from(is_test(done.scene.number))];
            pack(stage, done, writer, counts)?;
            each(done)?;
        }
    }
    let [(train, train_counts), (test, test_counts)] = splits;
    train.finish().map_err(SceneError::from)?;
    test.finish().map_err(SceneError::from)?;
    Ok(ClusterCounts { train: train_counts, test: test_counts })
}

/// Whether the scene of this number is for the test set.
#[must_use]
pub fn is_test(number: u32) -> bool {
    number % TEST_EACH == TEST_EACH - 1
}

/// How many scenes with smaller numbers than this are in the same set.
#[must_use]
pub fn place_in_set(number: u32) -> u32 {
    let n_tests = number / TEST_EACH;
    if is_test(number) { n_tests } else { number - n_tests }
}

impl LabelledScene {
    /// Draws scene number `number` of `stage`, scans it, and segments it with `settings`.
    ///
    /// # Errors
    /// The scene cannot be scanned or segmented.
    pub fn new(stage: &Stage, number: u32, settings: &Settings) -> Result<Self, SceneError> {
        let scene = DrawnScene::draw(stage, number);
        let mut settings = settings.clone();
        if let Some(clearance_m) = scene.ground_clearance_m {
            settings.ground_clearance_m = clearance_m as f32;
        }
        let mut segmenter =
            Segmenter::new(settings).map_err(|e| SceneError::Segment(e.to_string()))?;
        let sweep = stage.sweep(&scene)?;
        let points = Points { points: sweep.points(), rings: Some(sweep.rings()) };
        let found = segmenter.segment(&points).map_err(|e| SceneError::Segment(e.to_string()))?;
        let clusters = label_clusters(stage, &scene, &sweep, found);
        let labels = found.labels().to_vec();
        Ok(Self { scene, sweep, labels, clusters })
    }
}

fn pack(
    stage: &Stage,
    done: &LabelledScene,
    writer: &mut ClusterWriter,
    counts: &mut [usize],
) -> Result<(), SceneError> {
    let LabelledScene { scene, sweep, clusters, .. } = done;
    let sensor = stage.sensor(scene).name();
    let mut points = Vec::new();
    for (cluster, n) in clusters.iter().zip(0..) {
        points.clear();
        points.extend(cluster.points.iter().map(|&i| sweep.points()[i as usize]));
        counts[cluster.label] += 1;
        let class = &stage.classes()[cluster.label];
        let remarks = Remarks {
            // Training never splits the clusters of one name: those of a scene stay together.
            name: &format!("scene{:06}_v{n}", scene.number),
            id: &format!("{:06}#{class}{}", scene.number, cluster.surface),
            sensor,
            range_m: cluster.range_m,
            truth_share: cluster.truth_share,
            height_m: cluster.height_m,
        };
        writer.push(&points, cluster.label, &remarks)?;
    }
    Ok(())
}
