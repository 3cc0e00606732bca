//! Augmentation: chooses, drops and moves the points of a cloud.
//!
//! Random numbers are keyed by the run's seed, the epoch and the cloud, so that an augmented cloud
//! does not depend on the thread or the batch.

use std::borrow::Cow;

use formats::streams::Stream;
use infer_cpu::sampler::{FarthestPoints, FpsStart};

use crate::clouds::Clouds;
use crate::cluster::{self, JITTER_CLIP};
use crate::draws::Draws;
use crate::recipe::{Augment, Recipe, Sampling};

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
    let mut cloud = Cow::Borrowed(clouds.set.cloud(i));
    let mut moves = recipe.augment.clone();
    if recipe.normalization.is_metric() {
        cloud = cluster::varied(&cloud, clouds.set.ground_z(i), recipe, &mut draws).into();
        // Added before the centring.
        moves.jitter = 0.0;
    }
    let (candidates, mut places) = choose(cloud, recipe, &mut draws);
    let n = places.len();
    drop_points(&mut places, moves.drop, &mut draws);
    let pick = |from: &[[f32; 3]]| places.iter().map(|&place| from[place]).collect::<Vec<_>>();
    let (points, neighborhood) = if recipe.network.edges.is_empty() {
        let mut points = pick(&candidates);
        transform(&mut points, &moves, &mut draws);
        (points, Vec::new())
    } else {
        // All points move together, so that the chosen points stay among them.
        let mut all = candidates.into_owned();
        transform(&mut all, &moves, &mut draws);
        (pick(&all), all)
    };
    let first_weight = (n - points.len() + 1) as f32;
    let target = target(clouds.set.labels[i], clouds.classes.len(), recipe.label_smoothing as f32);
    TrainingCloud { points, neighborhood, first_weight, target }
}

/// The share of each class in the target: 1 for `label`, of which `smoothing` goes to all classes.
pub fn target(label: usize, n_classes: usize, smoothing: f32) -> Vec<f32> {
    let own = |class| f32::from(u8::from(class == label));
    (0..n_classes)
        .map(|class| own(class) * (1.0 - smoothing) + smoothing / n_classes as f32)
        .collect()
}

/// Chooses the points of `cloud` for the network: those among which neighbors are searched, and the
/// index of each chosen one.
fn choose<'a>(
    cloud: Cow<'a, [[f32; 3]]>,
    recipe: &Recipe,
    draws: &mut Draws,
) -> (Cow<'a, [[f32; 3]]>, Vec<usize>) {
    let n = recipe.points.min(cloud.len());
    match recipe.sampling {
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
    }
}

/// Drops points at random. The chance is the same for all points of a cloud, and uniform from 0 to
/// `most`. The first point stays, because the baseline moves dropped points onto it.
fn drop_points(points: &mut Vec<usize>, most: f64, draws: &mut Draws) {
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
    let angle = draws.between(-rotate_degrees, rotate_degrees).to_radians();
    let (sin, cos) = libm::sincos(angle);
    for point in points {
        let mut p = point.map(f64::from);
        if augment.jitter > 0.0 {
            let error = |draws: &mut Draws| augment.jitter * draws.normal();
            p = p.map(|x| x + error(draws).clamp(-JITTER_CLIP, JITTER_CLIP));
        }
        (p[0], p[1]) = (cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]);
        *point = [0, 1, 2].map(|k| (p[k] * factors[k] + shifts[k]) as f32);
    }
}
