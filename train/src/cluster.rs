//! Varies clusters in metres as another scan of the same object would, and centres them as
//! infer-cpu does.
//!
//! The sensor is at the origin, so that its error is along the line from the origin to each point.
//! All variations precede the centring, because in use the mean and the lowest point of a cluster
//! include the sensor's errors. Only a rotation about the up axis may follow, since it commutes
//! with the centring.

use crate::draws::Draws;
use crate::recipe::{Augment, ClusterVariation, Recipe};

/// Largest number of strays.
const STRAYS: usize = 5;

/// Largest distance of strays from a cluster's box, metres.
const STRAY_REACH: f64 = 0.5;

/// Largest distance of strips of ground from a cluster's box, metres.
const GROUND_REACH: f64 = 0.3;

/// Share of clusters for which the height of the ground is taken as unknown, if strips are added.
const GROUND_UNKNOWN: f64 = 0.3;

/// Limit to which jitter is clipped.
pub(crate) const JITTER_CLIP: f64 = 0.05;

/// A cut must leave this share of a cluster; otherwise it would remove the object and not only its
/// foot.
const LEAST_LEFT: f64 = 0.5;

pub(crate) fn varied(
    cluster: &[[f32; 3]],
    ground_z: Option<f32>,
    recipe: &Recipe,
    draws: &mut Draws,
) -> Vec<[f32; 3]> {
    let variation = &recipe.clusters;
    let cut = cut(cluster, variation.cut * draws.unit());
    let thinned = thinned(&cut, variation, draws);
    let mut points = noisy(&thinned, &recipe.augment, draws);
    add_strays(&mut points, variation, draws);
    let unknown = if variation.ground_share > 0.0 { GROUND_UNKNOWN } else { 0.0 };
    let ground_z = ground_z.map(f64::from).filter(|_| draws.unit() >= unknown);
    add_ground(&mut points, ground_z, variation, draws);
    let mut centred = Vec::new();
    infer_cpu::normalize(recipe.normalization, &points, ground_z, &mut centred);
    centred
}

/// `cluster` without the points that are less than `height` above its lowest point, because a
/// segmentation removes the ground up to some height.
fn cut(cluster: &[[f32; 3]], height: f64) -> Vec<[f32; 3]> {
    let lowest = cluster.iter().fold(f32::INFINITY, |lowest, point| lowest.min(point[2]));
    let stays = |point: &&[f32; 3]| f64::from(point[2]) >= f64::from(lowest) + height;
    let left: Vec<_> = cluster.iter().filter(stays).copied().collect();
    let is_object = left.len() as f64 >= LEAST_LEFT * cluster.len() as f64;
    if is_object { left } else { cluster.to_vec() }
}

/// A random subset of the points of `cluster`, for another sensor or distance.
fn thinned(cluster: &[[f32; 3]], variation: &ClusterVariation, draws: &mut Draws) -> Vec<[f32; 3]> {
    let density = variation.density.map(|[least, most]| [least, most.min(cluster.len())]);
    let Some([least, most]) = density.filter(|[least, most]| least < most) else {
        return cluster.to_vec();
    };
    let n =
        libm::exp(draws.between(libm::log(least as f64), libm::log(most as f64 + 1.0))) as usize;
    let n = n.clamp(least, most);
    let mut points = draws.shuffled(cluster, n);
    points.truncate(n);
    points
}

/// `points` with a sensor's error along its rays, and jitter.
fn noisy(points: &[[f32; 3]], augment: &Augment, draws: &mut Draws) -> Vec<[f64; 3]> {
    let Augment { sensor_noise, jitter, .. } = *augment;
    let moved = |point: &[f32; 3]| {
        let mut p = point.map(f64::from);
        if sensor_noise > 0.0 {
            let range = p.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            let factor = 1.0 + sensor_noise * draws.normal() / range;
            p = p.map(|x| x * factor);
        }
        if jitter > 0.0 {
            p = p.map(|x| x + (jitter * draws.normal()).clamp(-JITTER_CLIP, JITTER_CLIP));
        }
        p
    };
    points.iter().map(moved).collect()
}

/// Largest number of strips of ground under a cluster.
const STRIPS: usize = 3;

/// Largest number of points of the strips of ground, as a share of the cluster's points.
const GROUND_POINTS: f64 = 0.3;

/// Largest distance of the ground below a cluster's lowest point, metres.
const GROUND_BELOW: f64 = 0.1;

/// Adds strips of ground to a share of clusters. They are level and across the line of sight, like
/// a sensor's rings.
fn add_ground(
    points: &mut Vec<[f64; 3]>,
    ground_z: Option<f64>,
    variation: &ClusterVariation,
    draws: &mut Draws,
) {
    let share = variation.ground_share;
    if share <= 0.0 || draws.unit() >= share {
        return;
    }
    let n = points.len() as f64;
    let middle = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / n);
    let range = libm::hypot(middle[0], middle[1]).max(f64::MIN_POSITIVE);
    let sight = middle.map(|x| x / range);
    // Along the line of sight, and to its left.
    let turned = |x: f64, y: f64| [sight[0] * x + sight[1] * y, sight[0] * y - sight[1] * x];
    let [along, across] = [0, 1].map(|axis| {
        let places = points.iter().map(|&[x, y, _]| turned(x - middle[0], y - middle[1])[axis]);
        let (low, high) = span(places);
        (low - GROUND_REACH, high + GROUND_REACH)
    });
    let (lowest, _) = span(points.iter().map(|point| point[2]));
    let height = ground_z.unwrap_or(lowest - draws.between(0.0, GROUND_BELOW));
    let n_strips = 1 + draws.below(STRIPS);
    let each = (draws.between(0.0, GROUND_POINTS) * n / n_strips as f64).ceil() as usize;
    for _ in 0..n_strips {
        let along = draws.between(along.0, along.1);
        let ends = [(); 2].map(|()| draws.between(across.0, across.1));
        for _ in 0..each {
            let across = draws.between(ends[0], ends[1]);
            let x = middle[0] + sight[0] * along - sight[1] * across;
            let y = middle[1] + sight[1] * along + sight[0] * across;
            points.push([x, y, height]);
        }
    }
}

/// Adds points of other things to a share of clusters. They are uniform in the cluster's box,
/// enlarged by [`STRAY_REACH`] to the sides and upwards; below it is the ground, which a segmentation
/// has removed.
fn add_strays(points: &mut Vec<[f64; 3]>, variation: &ClusterVariation, draws: &mut Draws) {
    let share = variation.stray_share;
    if share <= 0.0 || draws.unit() >= share {
        return;
    }
    let bounds = [0, 1, 2].map(|axis| span(points.iter().map(|point| point[axis])));
    let below = [STRAY_REACH, STRAY_REACH, 0.0];
    for _ in 0..=draws.below(STRAYS) {
        points.push([0, 1, 2].map(|axis| {
            let (low, high) = bounds[axis];
            draws.between(low - below[axis], high + STRAY_REACH)
        }));
    }
}

/// The least and the greatest of `values`.
fn span(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}
