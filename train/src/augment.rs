//! Clouds as they are drawn for a batch: points chosen, dropped, moved.
//!
//! Every draw is keyed by the run's seed, the epoch and the cloud, so that a
//! cloud is the same whichever thread makes it, and in whichever batch it is.

use formats::rng::StreamKey;
use infer_cpu::sampler::{FarthestPoints, FpsStart};

use crate::clouds::Clouds;
use crate::recipe::{Augment, Axis, Recipe, Sampling};

/// One cloud as the network sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Its points.
    pub points: Vec<[f32; 3]>,
    /// How often the first counts: once, and once for each that was dropped.
    pub first_weight: f32,
    /// The share of each class.
    pub target: Vec<f32>,
}

/// Random numbers of one cloud in one epoch.
struct Draws {
    stream: StreamKey,
    n: u64,
}

impl Draws {
    fn unit(&mut self) -> f64 {
        self.n += 1;
        self.stream.unit(self.n)
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    fn below(&mut self, bound: usize) -> usize {
        self.n += 1;
        self.stream.below(bound as u64, self.n) as usize
    }

    /// Standard normal (Box and Muller 1958).
    fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.unit(), self.unit());
        (-2.0 * radius.ln()).sqrt() * (std::f64::consts::TAU * angle).cos()
    }
}

/// Cloud `i` of `clouds` in epoch `epoch` of `recipe`.
#[must_use]
pub fn draw(clouds: &Clouds, i: usize, epoch: u32, recipe: &Recipe) -> Drawn {
    let stream = StreamKey::new(recipe.seed, &format!("augment {i}"), epoch);
    let mut draws = Draws { stream, n: 0 };
    let mut points = chosen(clouds.set.cloud(i), recipe, &mut draws);
    let n_classes = clouds.classes.len();
    let mut target = one_hot(clouds.set.labels[i], n_classes);
    if recipe.augment.cut_mix > 0.0 && draws.unit() < recipe.augment.cut_mix {
        let other = draws.below(clouds.len());
        let replaced =
            mix(&mut points, &chosen(clouds.set.cloud(other), recipe, &mut draws), &mut draws);
        for (share, other) in target.iter_mut().zip(one_hot(clouds.set.labels[other], n_classes)) {
            *share += replaced * (other - *share);
        }
    }
    let smoothing = recipe.label_smoothing as f32;
    for share in &mut target {
        *share = *share * (1.0 - smoothing) + smoothing / n_classes as f32;
    }
    let n = points.len();
    drop_points(&mut points, recipe.augment.drop, &mut draws);
    let first_weight = (n - points.len() + 1) as f32;
    transform(&mut points, &recipe.augment, &mut draws);
    Drawn { points, first_weight, target }
}

fn one_hot(label: usize, n_classes: usize) -> Vec<f32> {
    (0..n_classes).map(|class| f32::from(u8::from(class == label))).collect()
}

/// As many points of `cloud` as the network sees.
fn chosen(cloud: &[[f32; 3]], recipe: &Recipe, draws: &mut Draws) -> Vec<[f32; 3]> {
    let n = recipe.points.min(cloud.len());
    match recipe.sampling {
        Sampling::First => cloud[..n].to_vec(),
        Sampling::Random => shuffled(cloud, n, draws),
        Sampling::Fps => {
            let some = draws.between(0.5 * cloud.len() as f64, cloud.len() as f64) as usize;
            let candidates = shuffled(cloud, some.max(n), draws);
            let kernels = infer_cpu::kernel::available().next();
            let kernels = kernels.expect("invariant: the scalar kernels run everywhere");
            let mut picked = Vec::with_capacity(n);
            FarthestPoints::default().select(&candidates, n, FpsStart::First, kernels, &mut picked);
            picked.iter().map(|&i| candidates[i as usize]).collect()
        }
    }
}

/// `n` different points of `cloud` in random order (Fisher and Yates).
fn shuffled(cloud: &[[f32; 3]], n: usize, draws: &mut Draws) -> Vec<[f32; 3]> {
    let mut points = cloud.to_vec();
    for i in 0..n {
        let j = i + draws.below(points.len() - i);
        points.swap(i, j);
    }
    points.truncate(n);
    points
}

/// Replaces a random part of `points` by points of `other`; returns its share.
fn mix(points: &mut [[f32; 3]], other: &[[f32; 3]], draws: &mut Draws) -> f32 {
    let n = (draws.unit() * points.len().min(other.len()) as f64) as usize;
    let all = points.len();
    for (i, from) in other.iter().enumerate().take(n) {
        let at = i + draws.below(all - i);
        points.swap(i, at);
        points[i] = *from;
    }
    n as f32 / all as f32
}

/// Drops each point with a chance that is uniform below `most`. The first
/// stays: the baseline moves what it drops onto it.
fn drop_points(points: &mut Vec<[f32; 3]>, most: f64, draws: &mut Draws) {
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
    let (a, b) = match augment.up {
        Axis::X => (1, 2),
        Axis::Y => (2, 0),
        Axis::Z => (0, 1),
    };
    let (sin, cos) = angle.sin_cos();
    for point in points {
        let mut p = point.map(f64::from);
        if augment.jitter > 0.0 {
            let clip = augment.jitter_clip;
            p = p.map(|x| x + (augment.jitter * draws.normal()).clamp(-clip, clip));
        }
        (p[a], p[b]) = (cos * p[a] - sin * p[b], sin * p[a] + cos * p[b]);
        *point = [0, 1, 2].map(|k| (p[k] * factors[k] + shifts[k]) as f32);
    }
}
