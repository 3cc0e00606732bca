//! Clusters in metres, varied as another scan of the same object would vary them,
//! and centred as infer-cpu centres them.
//!
//! The sensor is at the origin, so that its error lies along the line from there to
//! each point. Everything comes before the centring, because a network in use meets
//! the mean and the lowest point of what a sensor saw, errors included. A turn about
//! the up axis alone may follow: it and the centring can change places.

use infer_cpu::sampler::OutlierFilter;
use serde::{Deserialize, Serialize};

use crate::draws::Draws;
use crate::recipe::{Augment, FINITE, Recipe, finite};

/// How clusters in metres are varied, to be like those of other sensors, distances
/// and segmentations. Its default varies nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ClusterVariation {
    /// A cluster keeps a random number of its points, log-uniform between these two,
    /// before it is centred; all if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub density: Option<[usize; 2]>,
    /// The largest height, metres, up to which a cluster's foot is cut off.
    pub cut: f64,
    /// Share of clusters that get points of other things.
    pub stray_share: f64,
    /// The largest number of such points.
    pub strays: usize,
    /// How far such points are from the cluster's box at most, metres.
    pub stray_reach: f64,
    /// Share of clusters with strips of the ground under them, which a segmentation
    /// has left.
    pub ground_share: f64,
    /// How far such strips reach beyond the cluster's box at most, metres.
    pub ground_reach: f64,
    /// Share of clusters whose ground is taken to be unknown, as it may be in use.
    pub ground_unknown: f64,
}

impl ClusterVariation {
    /// Whether it varies nothing but what clouds of the unit sphere have, too.
    pub(crate) fn suits_whole_objects(&self) -> bool {
        let Self { cut, ground_share, ground_reach, ground_unknown, .. } = *self;
        [cut, ground_share, ground_reach, ground_unknown] == [0.0; 4]
    }

    /// Whether each value is in its range, with the recipe's key and what is expected.
    pub(crate) fn checks(&self) -> [(bool, &'static str, &'static str); 8] {
        let Self { density, cut, stray_share, strays, stray_reach, .. } = *self;
        let Self { ground_share, ground_reach, ground_unknown, .. } = *self;
        [
            (
                density.is_none_or(|[least, most]| (1..=most).contains(&least)),
                "clusters.density",
                "expected two numbers of points, 1 or more and ascending",
            ),
            (finite(cut), "clusters.cut", FINITE),
            ((0.0..=1.0).contains(&stray_share), "clusters.stray_share", "expected 0 to 1"),
            (
                stray_share <= 0.0 || strays > 0,
                "clusters.strays",
                "expected 1 or more with `stray_share`",
            ),
            (finite(stray_reach), "clusters.stray_reach", FINITE),
            ((0.0..=1.0).contains(&ground_share), "clusters.ground_share", "expected 0 to 1"),
            (finite(ground_reach), "clusters.ground_reach", FINITE),
            ((0.0..=1.0).contains(&ground_unknown), "clusters.ground_unknown", "expected 0 to 1"),
        ]
    }
}

/// A cut that leaves less than this share of a cluster takes an object away, and not
/// its foot.
const LEAST_LEFT: f64 = 0.5;

/// `cluster`, varied and centred.
pub(crate) fn varied(
    cluster: &[[f32; 3]],
    ground_z: Option<f32>,
    recipe: &Recipe,
    draws: &mut Draws,
) -> Vec<[f32; 3]> {
    let variation = &recipe.clusters;
    let cut = cut(cluster, variation.cut * draws.unit());
    let seen = thinned(&cut, variation, draws);
    let mut points = noisy(&seen, &recipe.augment, draws);
    add_strays(&mut points, variation, 0.0, draws);
    let ground_z = ground_z.map(f64::from).filter(|_| draws.unit() >= variation.ground_unknown);
    add_ground(&mut points, ground_z, variation, draws);
    let mut centred = Vec::new();
    infer_cpu::normalize(recipe.normalization, &points, ground_z, &mut centred);
    centred
}

/// `cloud`, a whole object in the unit sphere: thinned, among strays, and then as
/// infer-cpu makes it of that, without outliers and in the unit sphere again.
pub(crate) fn varied_object(
    cloud: &[[f32; 3]],
    recipe: &Recipe,
    draws: &mut Draws,
) -> Vec<[f32; 3]> {
    let variation = &recipe.clusters;
    let mut points: Vec<[f64; 3]> =
        thinned(cloud, variation, draws).iter().map(|point| point.map(f64::from)).collect();
    add_strays(&mut points, variation, variation.stray_reach, draws);
    let mut normalized = Vec::new();
    infer_cpu::to_unit_sphere(&points, &mut normalized);
    if recipe.outlier_filter && OutlierFilter::default().drop_outliers(&mut points, &normalized) > 0
    {
        infer_cpu::to_unit_sphere(&points, &mut normalized);
    }
    normalized
}

/// `cluster` without what is less than `height` above its lowest point: a
/// segmentation removes the ground up to some height.
fn cut(cluster: &[[f32; 3]], height: f64) -> Vec<[f32; 3]> {
    let lowest = cluster.iter().fold(f32::INFINITY, |lowest, point| lowest.min(point[2]));
    let stays = |point: &&[f32; 3]| f64::from(point[2]) >= f64::from(lowest) + height;
    let left: Vec<_> = cluster.iter().filter(stays).copied().collect();
    let is_object = left.len() as f64 >= LEAST_LEFT * cluster.len() as f64;
    if is_object { left } else { cluster.to_vec() }
}

/// As few of the points of `cluster` as another sensor or distance might leave.
fn thinned(cluster: &[[f32; 3]], variation: &ClusterVariation, draws: &mut Draws) -> Vec<[f32; 3]> {
    let Some([least, most]) = variation.density else { return cluster.to_vec() };
    let most = most.min(cluster.len());
    if most <= least {
        return cluster.to_vec();
    }
    let n = draws.between((least as f64).ln(), (most as f64 + 1.0).ln()).exp() as usize;
    let n = n.clamp(least, most);
    let mut points = draws.shuffled(cluster, n);
    points.truncate(n);
    points
}

/// `points` with a sensor's error along its rays, and jitter.
fn noisy(points: &[[f32; 3]], augment: &Augment, draws: &mut Draws) -> Vec<[f64; 3]> {
    let Augment { sensor_noise, jitter, jitter_clip, .. } = *augment;
    let moved = |point: &[f32; 3]| {
        let mut p = point.map(f64::from);
        if sensor_noise > 0.0 {
            let range = p.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
            let factor = 1.0 + sensor_noise * draws.normal() / range;
            p = p.map(|x| x * factor);
        }
        if jitter > 0.0 {
            p = p.map(|x| x + (jitter * draws.normal()).clamp(-jitter_clip, jitter_clip));
        }
        p
    };
    points.iter().map(moved).collect()
}

/// The most strips of ground under a cluster.
const STRIPS: usize = 3;

/// Strips of ground hold at most this share of a cluster's points.
const GROUND_POINTS: f64 = 0.3;

/// How far below a cluster's lowest point the ground may be, metres.
const GROUND_BELOW: f64 = 0.1;

/// Adds strips of ground to a share of clusters: level, across the line of sight as
/// a sensor's rings are.
fn add_ground(
    points: &mut Vec<[f64; 3]>,
    ground_z: Option<f64>,
    variation: &ClusterVariation,
    draws: &mut Draws,
) {
    let ClusterVariation { ground_share, ground_reach, .. } = *variation;
    if ground_share <= 0.0 || draws.unit() >= ground_share {
        return;
    }
    let n = points.len() as f64;
    let middle = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / n);
    let range = middle[0].hypot(middle[1]).max(f64::MIN_POSITIVE);
    let sight = middle.map(|x| x / range);
    // Along the line of sight, and to its left.
    let turned = |x: f64, y: f64| [sight[0] * x + sight[1] * y, sight[0] * y - sight[1] * x];
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &[x, y, _] in points.iter() {
        let place = turned(x - middle[0], y - middle[1]);
        for axis in 0..2 {
            low[axis] = low[axis].min(place[axis] - ground_reach);
            high[axis] = high[axis].max(place[axis] + ground_reach);
        }
    }
    let lowest = points.iter().fold(f64::INFINITY, |lowest, point| lowest.min(point[2]));
    let height = ground_z.unwrap_or(lowest - draws.between(0.0, GROUND_BELOW));
    let n_strips = 1 + draws.below(STRIPS);
    let each = (draws.between(0.0, GROUND_POINTS) * n / n_strips as f64).ceil() as usize;
    for _ in 0..n_strips {
        let along = draws.between(low[0], high[0]);
        let ends = [(); 2].map(|()| draws.between(low[1], high[1]));
        for _ in 0..each {
            let across = draws.between(ends[0], ends[1]);
            let x = middle[0] + sight[0] * along - sight[1] * across;
            let y = middle[1] + sight[1] * along + sight[0] * across;
            points.push([x, y, height]);
        }
    }
}

/// Adds points of other things to a share of clusters: anywhere in the cluster's
/// box, widened to its sides and upwards, and by `reach_below`: that is 0 where a
/// segmentation has removed the ground.
fn add_strays(
    points: &mut Vec<[f64; 3]>,
    variation: &ClusterVariation,
    reach_below: f64,
    draws: &mut Draws,
) {
    let ClusterVariation { stray_share, strays, stray_reach, .. } = *variation;
    if stray_share <= 0.0 || draws.unit() >= stray_share {
        return;
    }
    let bounds = [0, 1, 2].map(|axis| {
        let along = points.iter().map(|point| point[axis]);
        along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
    });
    let below = [stray_reach, stray_reach, reach_below];
    for _ in 0..=draws.below(strays) {
        points.push([0, 1, 2].map(|axis| {
            let (low, high) = bounds[axis];
            draws.between(low - below[axis], high + stray_reach)
        }));
    }
}
