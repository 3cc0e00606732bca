//! Training clouds for the class `unknown` that show no object (outlier exposure: Hendrycks et al.
//! 2019). No score of a network that was trained only on objects separates them from objects: such
//! a network takes flat ground for a keyboard with high confidence.

use formats::labelled::LabelledSet;
use formats::rng::StreamKey;
use formats::streams::Stream;

use crate::clouds::Clouds;
use crate::draws::Draws;
use crate::recipe::Recipe;

/// Number of points of a negative that contains no object.
const POINTS: usize = 1024;

formats::named! {
    /// Kinds of negatives.
    pub enum Negative: "kind of negative" {
        /// A patch of ground, perhaps in scan lines.
        Ground = "ground",
        /// Such a patch, upright, at a random azimuth.
        Wall = "wall",
        /// One to three normal or uniform clouds.
        Blob = "blob",
        /// Two objects in one cloud.
        Pair = "pair",
        /// A slice of an object.
        Sliver = "sliver",
    }
}

/// `clouds`, followed by the number of negatives that `recipe` wants. The negatives depend only on
/// the clouds, the seed, `purpose` and `index`.
#[must_use]
pub fn added(clouds: Clouds, recipe: &Recipe, purpose: &str, index: u32) -> Clouds {
    let n = (recipe.negatives * clouds.len() as f64) as usize;
    let classes = recipe.classes(&clouds.classes);
    if n == 0 {
        return Clouds { classes, ..clouds };
    }
    // Negatives have no remarks.
    let LabelledSet { points, offsets, labels, .. } = clouds.set.clone();
    let mut set = LabelledSet { points, offsets, labels, ..LabelledSet::default() };
    for (number, kind) in Negative::ALL.into_iter().cycle().enumerate().take(n) {
        let stream = Stream::Negative { purpose, number, epoch: index };
        set.push(&negative(kind, &clouds, stream.key(recipe.seed)), classes.len() - 1);
    }
    Clouds { set, classes }
}

/// Draws a negative in the unit sphere, z up, from `stream`. Pairs and slivers are made of
/// `clouds`, which are objects in the unit sphere.
#[must_use]
pub fn negative(kind: Negative, clouds: &Clouds, stream: StreamKey) -> Vec<[f32; 3]> {
    let draws = &mut Draws::new(stream);
    let points = match kind {
        Negative::Ground => patch(draws),
        Negative::Wall => turned(patch(draws).into_iter().map(|[x, y, z]| [x, z, y]), draws),
        Negative::Blob => blob(draws),
        Negative::Pair => pair(clouds, draws),
        Negative::Sliver => sliver(clouds, draws),
    };
    let mut normalized = Vec::new();
    infer_cpu::to_unit_sphere(&points, &mut normalized);
    normalized
}

/// A rough, perhaps sloping rectangle or ellipse at a random azimuth. The points of every second
/// patch lie in lines, like a scan of the ground.
fn patch(draws: &mut Draws) -> Vec<[f64; 3]> {
    let width = draws.between(0.3, 1.0);
    let is_round = draws.unit() < 0.5;
    let lines = (draws.unit() < 0.5).then(|| draws.between(4.0, 16.0).floor());
    let (slope, roughness) = (draws.between(-0.2, 0.2), draws.between(0.0, 0.03));
    let (height, wave) = (draws.between(0.0, 0.06), [(); 2].map(|()| draws.between(0.0, 6.0)));
    let mut points = Vec::with_capacity(POINTS);
    while points.len() < POINTS {
        let [x, mut y] = [(); 2].map(|()| draws.between(-1.0, 1.0));
        if is_round && x * x + y * y > 1.0 {
            continue;
        }
        if let Some(lines) = lines {
            y = (y * lines).round() / lines;
        }
        let relief = height * libm::sin(wave[0] * x + wave[1]) * libm::cos(wave[1] * y);
        points.push([x, width * y, slope * x + relief + roughness * draws.normal()]);
    }
    turned(points.into_iter(), draws)
}

/// One to three normal or uniform clouds, each with three widths of its own.
fn blob(draws: &mut Draws) -> Vec<[f64; 3]> {
    let is_normal = draws.unit() < 0.7;
    let parts: Vec<[[f64; 3]; 2]> = (0..=draws.below(3))
        .map(|_| {
            let centre = [(); 3].map(|()| draws.between(-1.0, 1.0));
            [centre, [(); 3].map(|()| draws.between(0.3, 1.0))]
        })
        .collect();
    let point = |_| {
        let [centre, widths] = parts[draws.below(parts.len())];
        let offset = [(); 3].map(|()| match is_normal {
            true => draws.normal(),
            false => draws.between(-1.7, 1.7),
        });
        [0, 1, 2].map(|axis| centre[axis] + widths[axis] * offset[axis])
    };
    (0..POINTS).map(point).collect()
}

/// Two objects side by side on one floor. The second is scaled by 0.5 to 1.
fn pair(clouds: &Clouds, draws: &mut Draws) -> Vec<[f64; 3]> {
    let (apart, angle) = (draws.between(1.0, 2.2), draws.between(0.0, std::f64::consts::TAU));
    let scale = draws.between(0.5, 1.0);
    let mut all = Vec::new();
    for (scale, shift) in
        [(1.0, [0.0; 2]), (scale, [apart * libm::cos(angle), apart * libm::sin(angle)])]
    {
        let one = object(clouds, draws);
        let one = turned(one.into_iter().map(|point| point.map(|x| scale * x)), draws);
        let floor = one.iter().fold(f64::INFINITY, |floor, point| floor.min(point[2]));
        all.extend(one.iter().map(|[x, y, z]| [x + shift[0], y + shift[1], z - floor]));
    }
    all
}

/// A twentieth to a fifth of an object's points, between two parallel planes.
fn sliver(clouds: &Clouds, draws: &mut Draws) -> Vec<[f64; 3]> {
    let across = [(); 3].map(|()| draws.normal());
    let mut points = object(clouds, draws);
    let along = |p: &[f64; 3]| p.iter().zip(across).map(|(x, n)| x * n).sum::<f64>();
    points.sort_by(|a, b| along(a).total_cmp(&along(b)));
    let n = (draws.between(0.05, 0.2) * points.len() as f64).ceil() as usize;
    let first = draws.below(points.len() - n + 1);
    points[first..first + n].to_vec()
}

fn object(clouds: &Clouds, draws: &mut Draws) -> Vec<[f64; 3]> {
    let cloud = clouds.set.cloud(draws.below(clouds.len()));
    cloud.iter().map(|point| point.map(f64::from)).collect()
}

fn turned(points: impl Iterator<Item = [f64; 3]>, draws: &mut Draws) -> Vec<[f64; 3]> {
    let (sin, cos) = libm::sincos(draws.between(0.0, std::f64::consts::TAU));
    points.map(|[x, y, z]| [cos * x - sin * y, sin * x + cos * y, z]).collect()
}
