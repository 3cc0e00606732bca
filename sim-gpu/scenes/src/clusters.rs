use edgepuck_segment::Segmentation;

use crate::recipe::OTHER;
use crate::scene::DrawnScene;
use crate::stage::Stage;
use crate::sweep::Sweep;

/// The least fraction of a cluster's points that lie on the object that it shows. Clusters below
/// mix objects.
const MIN_PURITY: f64 = 0.7;

/// The least fraction of an object's points in the cluster that shows it. Clusters below are
/// pieces of an object.
const MIN_COMPLETENESS: f64 = 0.4;

/// A cluster with its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledCluster {
    /// The indices of its points in the sweep.
    pub points: Vec<u32>,
    /// The index of its class in [`Stage::classes`].
    pub label: usize,
    /// The surface that most of its points lie on, numbered as in [`Sweep::surfaces`]; `u32::MAX`
    /// if most are in the air.
    pub surface: u32,
    /// The fraction of its points that lie on that surface.
    pub truth_share: f32,
    /// The mean horizontal distance of its points from the sensor, metres.
    pub range_m: f32,
    /// The height of its lowest point above the ground, metres; NaN where the segmentation found
    /// no ground.
    pub height_m: f32,
}

/// Labels each cluster that a segmentation `found` in `sweep` with the class of the object that
/// most of its points lie on.
#[must_use]
pub fn label_clusters(
    stage: &Stage,
    scene: &DrawnScene,
    sweep: &Sweep,
    found: &Segmentation,
) -> Vec<LabelledCluster> {
    let (surfaces, visible) = (sweep.surfaces(), sweep.points_by_surface(scene));
    let mut counts = vec![0u32; visible.len()];
    let air = scene.objects.len() + 1;
    let clusters = found.clusters().map(|cluster| {
        counts.fill(0);
        cluster.points.iter().for_each(|&i| counts[air.min(surfaces[i as usize] as usize)] += 1);
        // `max_by_key` returns the last of equal counts; reversed, the first surface wins.
        let most = (0..counts.len()).rev().max_by_key(|&surface| counts[surface]).unwrap_or(0);
        let share = f64::from(counts[most]) / cluster.points.len() as f64;
        let is_complete = f64::from(counts[most]) >= MIN_COMPLETENESS * f64::from(visible[most]);
        let class = match most.checked_sub(1) {
            Some(object) if most != air && share >= MIN_PURITY && is_complete => {
                &stage.recipe().object[scene.objects[object].entry].class
            }
            _ => OTHER,
        };
        let label = stage.classes().binary_search_by(|known| known.as_str().cmp(class));
        let (range_m, lowest_m) = range_and_lowest(sweep.points(), cluster.points);
        LabelledCluster {
            points: cluster.points.to_vec(),
            label: label.expect("invariant: a stage has the classes of all its objects"),
            surface: if most == air { u32::MAX } else { most as u32 },
            truth_share: share as f32,
            range_m,
            height_m: cluster.ground_z_m.map_or(f32::NAN, |ground_z_m| lowest_m - ground_z_m),
        }
    });
    clusters.collect()
}

fn range_and_lowest(points: &[[f32; 3]], chosen: &[u32]) -> (f32, f32) {
    let chosen = chosen.iter().map(|&i| points[i as usize]);
    let sum_m: f64 = chosen.clone().map(|[x, y, _]| f64::from(libm::hypotf(x, y))).sum();
    let lowest_m = chosen.clone().map(|[.., z]| z).fold(f32::INFINITY, f32::min);
    ((sum_m / chosen.len().max(1) as f64) as f32, lowest_m)
}
