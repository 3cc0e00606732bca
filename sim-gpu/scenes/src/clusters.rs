//! Clusters cut from a sweep, and what they truly are.

use edgepuck_segment::Segmentation;

use crate::scene::Scene;
use crate::stage::{Stage, Sweep};

/// The class of what is no single object: mostly ground, two objects in one
/// cluster, or a small part of one.
pub const OTHER: &str = "other";

/// A cluster holds an object if at least this share of its points lie on it.
/// Below, it is two things in one.
const PURE: f64 = 0.7;

/// A cluster holds an object if at least this share of the points that the sensor
/// has of it are in the cluster. Below, the object is cut in pieces.
const WHOLE: f64 = 0.4;

/// A cluster and its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledCluster {
    /// Its points, as indices into the sweep.
    pub points: Vec<u32>,
    /// Its class, an index into [`Stage::classes`].
    pub label: usize,
    /// The surface that most of its points lie on, as in [`Sweep::surfaces`]; of what is in the
    /// air 2^32 - 1.
    pub surface: u32,
    /// The share of its points that lie on that surface.
    pub truth_share: f32,
    /// Mean horizontal distance of its points from the sensor, metres.
    pub range_m: f32,
    /// Height of its lowest point above the ground below it, metres; NaN where the
    /// ground is not known.
    pub height_m: f32,
}

/// The clusters that were `found` in `sweep`, each with the class of what most of
/// its points lie on.
#[must_use]
pub fn label_clusters(
    stage: &Stage,
    scene: &Scene,
    sweep: &Sweep,
    found: &Segmentation,
) -> Vec<LabelledCluster> {
    let (surfaces, visible) = (sweep.surfaces(), sweep.points_by_surface(scene));
    let mut counts = vec![0u32; visible.len()];
    let air = scene.objects.len() + 1;
    let clusters = found.clusters().map(|cluster| {
        counts.fill(0);
        cluster.points.iter().for_each(|&i| counts[air.min(surfaces[i as usize] as usize)] += 1);
        // Of equal counts, the first.
        let most = (0..counts.len()).rev().max_by_key(|&surface| counts[surface]).unwrap_or(0);
        let share = f64::from(counts[most]) / cluster.points.len() as f64;
        let is_whole = f64::from(counts[most]) >= WHOLE * f64::from(visible[most]);
        let class = match most.checked_sub(1) {
            Some(object) if most != air && share >= PURE && is_whole => {
                &stage.recipe().object[scene.objects[object].entry].class
            }
            _ => OTHER,
        };
        let label = stage.classes().binary_search_by(|known| known.as_str().cmp(class));
        let (range_m, lowest_m) = place(sweep.points(), cluster.points);
        LabelledCluster {
            points: cluster.points.to_vec(),
            label: label.expect("invariant: classes holds those of all objects"),
            surface: if most == air { u32::MAX } else { most as u32 },
            truth_share: share as f32,
            range_m,
            height_m: cluster.ground_z_m.map_or(f32::NAN, |ground_z_m| lowest_m - ground_z_m),
        }
    });
    clusters.collect()
}

/// Mean horizontal distance and lowest height of `chosen` points.
fn place(points: &[[f32; 3]], chosen: &[u32]) -> (f32, f32) {
    let chosen = chosen.iter().map(|&i| points[i as usize]);
    let (sum, lowest, n) = chosen
        .fold((0.0, f32::INFINITY, 0u32), |(sum, lowest, n), [x, y, z]| {
            (sum + f64::from(x.hypot(y)), lowest.min(z), n + 1)
        });
    ((sum / f64::from(n.max(1))) as f32, lowest)
}
