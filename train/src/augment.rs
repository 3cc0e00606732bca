//! Augmentation: chooses, drops and moves the points of a cloud.
//!
//! Random numbers are keyed by the run's seed, the epoch and the cloud, so that an augmented cloud
//! does not depend on the thread or the batch.

use std::borrow::Cow;

use formats::streams::Stream;
use infer_cpu::sampler::{FarthestPoints, FpsStart};

use crate::clouds::Clouds;
use crate::cluster;
use crate::draws::Draws;
use crate::recipe::{Augment, Axis, Recipe, Sampling};

/// One augmented cloud, as the network sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct TrainingCloud {
    /// Its points.
    pub points: Vec<[f32; 3]>,
    /// All points from which `points` were chosen, moved in the same way. Empty if the network has
    /// no EdgeConv layer.
    pub neighborhood: Vec<[f32; 3]>,
    /// The weight of the first point: 1, plus 1 for each dropped point.
    pub first_weight: f32,
    /// The target share of each class.
    pub target: Vec<f32>,
}

/// Augments cloud `i` of `clouds` for its draw number `turn`, counted from 0, in `epoch`.
#[must_use]
pub fn augment(
    clouds: &Clouds,
    i: usize,
    (epoch, turn): (u32, u32),
    recipe: &Recipe,
) -> TrainingCloud {
    let stream = match turn {
        0 => Stream::Augment { cloud: i, epoch },
        _ => Stream::AugmentAgain { cloud: i, turn, epoch },
    };
    let mut draws = Draws::new(stream.key(recipe.seed));
    let mut cloud = varied(clouds, i, recipe, &mut draws);
    let (mut other, mut replaced) = (i, 0.0);
    if recipe.augment.cut_mix > 0.0 && draws.unit() < recipe.augment.cut_mix {
        other = draws.below(clouds.len());
        let other_cloud = varied(clouds, other, recipe, &mut draws);
        replaced = mix_ball(cloud.to_mut(), &other_cloud, &mut draws);
    }
    let ChosenPoints { mut points, mut neighborhood, mut places } =
        choose(cloud, recipe, &mut draws);
    let n_classes = clouds.classes.len();
    let mut target = one_hot(clouds.set.labels[i], n_classes);
    for (share, other) in target.iter_mut().zip(one_hot(clouds.set.labels[other], n_classes)) {
        *share += replaced * (other - *share);
    }
    let smoothing = recipe.label_smoothing as f32;
    for share in &mut target {
        *share = *share * (1.0 - smoothing) + smoothing / n_classes as f32;
    }
    let mut moves = recipe.augment.clone();
    if recipe.normalization.is_metric() {
        // `cluster::varied` added these errors before the centring.
        (moves.jitter, moves.sensor_noise) = (0.0, 0.0);
    }
    let n = points.len();
    if neighborhood.is_empty() {
        drop_points(&mut points, moves.drop, &mut draws);
        transform(&mut points, &moves, &mut draws);
    } else {
        // All points move together, so that the chosen points stay among them.
        drop_points(&mut places, moves.drop, &mut draws);
        transform(&mut neighborhood, &moves, &mut draws);
        points = places.iter().map(|&place| neighborhood[place]).collect();
    }
    let first_weight = (n - points.len() + 1) as f32;
    TrainingCloud { points, neighborhood, first_weight, target }
}

/// The validation clouds `held`, followed by a copy of each, varied and turned as in training, so
/// that the choice of a checkpoint also depends on disturbed clouds.
#[must_use]
pub fn varied_too(held: &Clouds, recipe: &Recipe) -> Clouds {
    let mut both = held.clone();
    both.set.names = None;
    let turned = Augment { scale: [1.0; 2], shift: 0.0, stretch: 0.0, ..recipe.augment.clone() };
    for i in 0..held.len() {
        let mut draws = Draws::new(Stream::VaryValidation { cloud: i as u32 }.key(recipe.seed));
        let mut cloud = cluster::varied_object(held.set.cloud(i), recipe, &mut draws);
        transform(&mut cloud, &turned, &mut draws);
        both.set.push(&cloud, held.set.labels[i]);
    }
    both
}

/// The points of a cloud that were chosen for the network.
struct ChosenPoints {
    points: Vec<[f32; 3]>,
    neighborhood: Vec<[f32; 3]>,
    /// The index in `neighborhood` of each of `points`.
    places: Vec<usize>,
}

fn one_hot(label: usize, n_classes: usize) -> Vec<f32> {
    (0..n_classes).map(|class| f32::from(u8::from(class == label))).collect()
}

/// Cloud `i`, varied, and centred if it is a cluster in metres.
fn varied<'a>(
    clouds: &'a Clouds,
    i: usize,
    recipe: &Recipe,
    draws: &mut Draws,
) -> Cow<'a, [[f32; 3]]> {
    let cloud = clouds.set.cloud(i);
    if recipe.normalization.is_metric() {
        cluster::varied(cloud, clouds.set.ground_z(i), recipe, draws).into()
    } else if recipe.varies_objects() {
        cluster::varied_object(cloud, recipe, draws).into()
    } else {
        cloud.into()
    }
}

/// Chooses the points of `cloud` for the network.
fn choose(cloud: Cow<'_, [[f32; 3]]>, recipe: &Recipe, draws: &mut Draws) -> ChosenPoints {
    let n = recipe.points.min(cloud.len());
    let (candidates, places): (Cow<'_, [[f32; 3]]>, Vec<usize>) = match recipe.sampling {
        Sampling::First => (cloud, (0..n).collect()),
        Sampling::Random => (draws.shuffled(&cloud, n).into(), (0..n).collect()),
        Sampling::Fps => {
            let some = draws.between(0.5 * cloud.len() as f64, cloud.len() as f64) as usize;
            let some = some.max(n);
            let mut candidates = draws.shuffled(&cloud, some);
            candidates.truncate(some);
            let kernels = infer_cpu::kernel::available().next();
            let kernels = kernels.expect("invariant: the scalar kernels run everywhere");
            let mut picked = Vec::with_capacity(n);
            FarthestPoints::default().select(&candidates, n, FpsStart::First, kernels, &mut picked);
            (candidates.into(), picked.iter().map(|&i| i as usize).collect())
        }
    };
    let points = places.iter().map(|&place| candidates[place]).collect();
    let has_edges = !recipe.network.edges.is_empty();
    ChosenPoints {
        points,
        neighborhood: if has_edges { candidates.into_owned() } else { Vec::new() },
        places,
    }
}

/// Replaces the points of `cloud` in a ball about one of them, a random number, by as many points of
/// `other` that are nearest to the same place. Returns the replaced share.
fn mix_ball(cloud: &mut [[f32; 3]], other: &[[f32; 3]], draws: &mut Draws) -> f32 {
    let n = (draws.unit() * cloud.len().min(other.len()) as f64) as usize;
    let centre = cloud[draws.below(cloud.len())];
    let squared = |p: &[f32; 3]| (0..3).map(|k| (p[k] - centre[k]) * (p[k] - centre[k])).sum();
    let by_distance = |points: &[[f32; 3]]| {
        let mut order: Vec<(f32, usize)> = points.iter().map(squared).zip(0..).collect();
        // Distances come with their place, so that the order is the same everywhere.
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order
    };
    let nearest = by_distance(cloud).into_iter().zip(by_distance(other));
    for ((_, own), (_, from)) in nearest.take(n) {
        cloud[own] = other[from];
    }
    n as f32 / cloud.len() as f32
}

/// Drops points at random. The chance is the same for all points of a cloud, and uniform from 0 to
/// `most`. The first point stays, because the baseline moves dropped points onto it.
fn drop_points<T>(points: &mut Vec<T>, most: f64, draws: &mut Draws) {
    let chance = most * draws.unit();
    let mut is_first = true;
    points.retain(|_| {
        let stays = draws.unit() > chance || is_first;
        is_first = false;
        stays
    });
}

fn transform(points: &mut [[f32; 3]], augment: &Augment, draws: &mut Draws) {
    let Augment { scale: [low, high], shift, stretch, rotate_degrees, .. } = *augment;
    let scale = draws.between(low, high);
    let shifts = [(); 3].map(|()| draws.between(-shift, shift));
    let factors = [(); 3].map(|()| scale * draws.between(1.0 - stretch, 1.0 + stretch));
    let mut angle = draws.between(-rotate_degrees, rotate_degrees).to_radians();
    if augment.rotate_share < 1.0 && draws.unit() >= augment.rotate_share {
        angle = 0.0;
    }
    let [a, b, _] = axes(augment.up);
    let (sin, cos) = libm::sincos(angle);
    let sensor = (augment.sensor_noise > 0.0).then(|| sensor(augment.up, draws));
    for point in points {
        let mut p = point.map(f64::from);
        if augment.jitter > 0.0 {
            let clip = augment.jitter_clip;
            p = p.map(|x| x + (augment.jitter * draws.normal()).clamp(-clip, clip));
        }
        if let Some(sensor) = sensor {
            p = along_ray(p, sensor, augment.sensor_noise * draws.normal());
        }
        (p[a], p[b]) = (cos * p[a] - sin * p[b], sin * p[a] + cos * p[b]);
        *point = [0, 1, 2].map(|k| (p[k] * factors[k] + shifts[k]) as f32);
    }
}

/// The two axes perpendicular to `up`, and `up`.
fn axes(up: Axis) -> [usize; 3] {
    match up {
        Axis::X => [1, 2, 0],
        Axis::Y => [2, 0, 1],
        Axis::Z => [0, 1, 2],
    }
}

/// A sensor's position at gen-dataset's default distance and elevation, and a random azimuth.
fn sensor(up: Axis, draws: &mut Draws) -> [f64; 3] {
    const DISTANCE: f64 = 3.0;
    let (elevation, azimuth) = (20f64.to_radians(), draws.between(0.0, std::f64::consts::TAU));
    let [a, b, up] = axes(up);
    let mut sensor = [0.0; 3];
    sensor[a] = DISTANCE * libm::cos(elevation) * libm::cos(azimuth);
    sensor[b] = DISTANCE * libm::cos(elevation) * libm::sin(azimuth);
    sensor[up] = DISTANCE * libm::sin(elevation);
    sensor
}

/// `point` moved away from `sensor` by `error`.
fn along_ray(point: [f64; 3], sensor: [f64; 3], error: f64) -> [f64; 3] {
    let ray = [0, 1, 2].map(|k| point[k] - sensor[k]);
    let range = ray.iter().map(|x| x * x).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
    [0, 1, 2].map(|k| point[k] + error * ray[k] / range)
}
