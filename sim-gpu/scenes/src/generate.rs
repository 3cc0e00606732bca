//! Many scenes, scanned and cut, as a training set.

use std::path::Path;

use edgepuck_segment::{Label, Segmenter, Settings, Sweep as Points};
use formats::clusters::{ClusterWriter, Remarks};
use rayon::prelude::*;

use crate::clusters::{LabelledCluster, label_clusters};
use crate::error::SceneError;
use crate::scene::Scene;
use crate::stage::{Stage, Sweep};

/// Scenes that are in memory together: enough for all cores, and few.
const BATCH: u32 = 32;

/// One scene in so many is for testing.
const TEST_EACH: u32 = 10;

/// What became of one scene.
pub struct Generation {
    /// The scene.
    pub scene: Scene,
    /// What its sensor saw.
    pub sweep: Sweep,
    /// What segmentation made of each of its points.
    pub labels: Vec<Label>,
    /// The clusters, with their truth.
    pub clusters: Vec<LabelledCluster>,
}

/// How many clusters were packed, by class.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// In the half for training.
    pub train: Vec<usize>,
    /// In the half for testing.
    pub test: Vec<usize>,
}

/// Scans the first `count` scenes of `stage`, cuts them with `settings`, and packs
/// the clusters into `train.npz` and `test.npz` in `folder`; each tenth scene is
/// for testing. Each scene goes to `each`, in order.
///
/// # Errors
/// If a scene cannot be scanned or segmented, a file cannot be written, or `each`
/// fails.
pub fn generate<E: From<SceneError>>(
    stage: &Stage,
    settings: &Settings,
    count: u32,
    folder: &Path,
    mut each: impl FnMut(&Generation) -> Result<(), E>,
) -> Result<Counts, E> {
    let classes = stage.classes().to_vec();
    let n_classes = classes.len();
    let writer = |name: &str| ClusterWriter::create(&folder.join(name), classes.clone());
    let mut halves = [
        (writer("train.npz").map_err(SceneError::from)?, vec![0; n_classes]),
        (writer("test.npz").map_err(SceneError::from)?, vec![0; n_classes]),
    ];
    for first in (0..count).step_by(BATCH as usize) {
        let numbers = first..count.min(first.saturating_add(BATCH));
        let batch: Vec<Generation> = numbers
            .into_par_iter()
            .map(|number| Generation::new(stage, number, settings))
            .collect::<Result<_, SceneError>>()?;
        for done in &batch {
            let is_test = done.scene.number % TEST_EACH == TEST_EACH - 1;
            let (writer, counts) = &mut halves[usize::from(is_test)];
            pack(stage, done, writer, counts)?;
            each(done)?;
        }
    }
    let [(train, train_counts), (test, test_counts)] = halves;
    train.finish().map_err(SceneError::from)?;
    test.finish().map_err(SceneError::from)?;
    Ok(Counts { train: train_counts, test: test_counts })
}

impl Generation {
    /// Draws scene number `number` of `stage`, scans it, and cuts it with `settings`.
    ///
    /// # Errors
    /// If it cannot be scanned or segmented.
    pub fn new(stage: &Stage, number: u32, settings: &Settings) -> Result<Self, SceneError> {
        let scene = Scene::draw(stage, number);
        let mut settings = settings.clone();
        if let Some(clearance_m) = scene.ground_clearance_m {
            settings.ground_clearance_m = clearance_m as f32;
        }
        let unfit = |error: String| SceneError::Segment(error);
        let mut segmenter = Segmenter::new(settings).map_err(|e| unfit(e.to_string()))?;
        let sweep = stage.sweep(&scene)?;
        let points = Points { points: sweep.points(), rings: Some(sweep.rings()) };
        let found = segmenter.segment(&points).map_err(|e| unfit(e.to_string()))?;
        let clusters = label_clusters(stage, &scene, &sweep, found);
        let labels = found.labels().to_vec();
        Ok(Self { scene, sweep, labels, clusters })
    }
}

fn pack(
    stage: &Stage,
    done: &Generation,
    writer: &mut ClusterWriter,
    counts: &mut [usize],
) -> Result<(), SceneError> {
    let Generation { scene, sweep, clusters, .. } = done;
    let sensor = &stage.sensor(scene).name;
    let mut points = Vec::new();
    for (cluster, n) in clusters.iter().zip(0..) {
        points.clear();
        points.extend(cluster.points.iter().map(|&i| sweep.points()[i as usize]));
        counts[cluster.label] += 1;
        let class = &stage.classes()[cluster.label];
        let remarks = Remarks {
            // Training keeps what is of one name together: a scene.
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
