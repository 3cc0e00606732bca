//! Whether z is the axis that points up.

use formats::plausible::Warning;

use crate::label::Label;
use crate::segmenter::Segmenter;
use crate::settings::Settings;
use crate::sweep::Sweep;

/// The least share of ground under another axis that speaks against z.
const LEAST_GROUND: f64 = 0.2;
/// How many times as wide the elevations above another axis must be, or as large the ground below
/// z, to speak for it: rooms and roofs have a ceiling, too.
const CLEARLY: [f64; 2] = [3.0, 0.5];

/// Where all but a hundredth of the points are nearer than this, metres, a plane above the sensor is
/// the ceiling of a room, which a sensor that looks upwards sees more of than of the floor.
const INDOORS_M: f32 = 30.0;

/// The fewest sectors of 10 degrees in which ground lies: a post or a wall from its edge is less wide
/// than the view of a sensor.
const FEWEST_SECTORS: u32 = 7;

/// Why z probably does not point up in a sweep, metres from the sensor: most of its beams leave the
/// sensor across another axis, below which more ground is found.
#[must_use]
pub fn other_axis_up(points: &[[f32; 3]]) -> Option<Warning> {
    let square = |point: &[f32; 3]| -> f64 { point.iter().map(|x| f64::from(*x).powi(2)).sum() };
    let returns = || points.iter().filter(|point| square(point) > 0.0 && square(point).is_finite());
    let (mut squares, mut below) = ([0.0; 3], [0i64; 3]);
    for point in returns() {
        for axis in 0..3 {
            squares[axis] += f64::from(point[axis]).powi(2) / square(point);
            below[axis] += if point[axis] > 0.0 { -1 } else { 1 };
        }
    }
    let up = (0..3).rev().min_by(|&a, &b| squares[a].total_cmp(&squares[b]))?;
    let sign = if below[up] < 0 { -1.0 } else { 1.0 };
    let is_far = |point: &&[f32; 3]| libm::hypotf(point[0], point[1]) > INDOORS_M;
    if up == 2 && (sign > 0.0 || 100 * returns().filter(is_far).count() < returns().count()) {
        return None;
    }
    let points: Vec<[f32; 3]> = returns().copied().collect();
    let turned = |&point: &[f32; 3]| {
        let [ahead, aside] = [(up + 1) % 3, (up + 2) % 3].map(|axis| point[axis]);
        [ahead, sign * aside, sign * point[up]]
    };
    let turned: Vec<_> = points.iter().map(turned).collect();
    let sector = |[x, y, _]: &[f32; 3]| (libm::atan2f(*y, *x).to_degrees() + 180.0) / 10.0;
    let sectors = turned.iter().fold(0u64, |seen, point| seen | 1 << sector(point) as u32);
    if sectors.count_ones() < FEWEST_SECTORS {
        return None;
    }
    let [found, other] = [ground(&points), ground(&turned)];
    let is_across = squares[2] > CLEARLY[0] * squares[up];
    let is_less = found < other * if is_across { 1.0 } else { CLEARLY[1] };
    let axis = match (up, sign < 0.0) {
        (0, false) => "x",
        (0, true) => "-x",
        (1, false) => "y",
        (1, true) => "-y",
        (_, false) => "z",
        (_, true) => "-z",
    };
    let warning = Warning::OtherAxisUp { ground_of_z: found, ground: other, axis };
    (other >= LEAST_GROUND && is_less).then_some(warning)
}

/// The share of ground among `points`, which are returns, 0 to 1.
fn ground(points: &[[f32; 3]]) -> f64 {
    let mut segmenter =
        Segmenter::new(Settings::default()).expect("invariant: the defaults are valid");
    let found = segmenter.segment(&Sweep { points, rings: None });
    let n = found.map_or(0, |found| found.labels().iter().filter(|l| **l == Label::Ground).count());
    n as f64 / points.len().max(1) as f64
}
