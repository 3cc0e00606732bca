//! Figures with intervals.

use formats::interval::{Z, wilson};
use serde::Serialize;

use super::directions::Direction;
use super::median::median;

/// A value to five decimals: metres to a hundredth of a millimetre.
pub fn rounded(value: f64) -> f64 {
    (1e5 * value).round() / 1e5
}

/// A figure, its 95 % interval, and the number of values it is from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    pub low: f64,
    pub high: f64,
    pub n: usize,
}

/// Differences beyond this many standard deviations are of edges, leaves and false returns.
const FARTHEST: f64 = 4.0;

/// The variance of a normal distribution that is cut at [`FARTHEST`].
const CUT_VARIANCE: f64 = 0.998_93;

/// Below this share of a quantum, rounded ranges hardly tell the noise.
const LEAST_OF_QUANTUM: f64 = 0.3;

impl Estimate {
    /// A figure with the standard deviation `sigma` of its error.
    pub fn normal(value: f64, sigma: f64, n: usize) -> Self {
        Self { value, low: value - Z * sigma, high: value + Z * sigma, n }
    }

    /// The mean of `values`, by their own deviation, with at least the error `least`.
    pub fn mean(values: &[f64], least: f64) -> Option<Self> {
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let sum = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let sigma = (sum / (n - 1.0) / n).sqrt();
        (n > 1.0).then(|| Self::normal(mean, sigma.max(least), values.len()))
    }
}

/// The sums of two values over blocks of directions. Their ratio is a figure whose error the blocks
/// tell: the linearised variance of a ratio over clusters (Cochran 1977, section 2.11).
#[derive(Default)]
struct Blocks {
    sums: Vec<[f64; 2]>,
    last: Option<usize>,
}

impl Blocks {
    /// Adds to the block of `direction`; directions come block by block.
    fn add(&mut self, block: usize, values: [f64; 2]) {
        if self.last.replace(block) != Some(block) {
            self.sums.push([0.0; 2]);
        }
        let sum = self.sums.last_mut().expect("invariant: the block was begun");
        *sum = [sum[0] + values[0], sum[1] + values[1]];
    }

    /// The ratio, the standard deviation of its error, and the sum of the second value.
    fn ratio(&self) -> [f64; 3] {
        let [a, b] = self.sums.iter().fold([0.0; 2], |[a, b], [x, y]| [a + x, b + y]);
        let (ratio, n) = (a / b, self.sums.len() as f64);
        let errors = self.sums.iter().map(|[x, y]| (x - ratio * y).powi(2)).sum::<f64>();
        [ratio, (errors * n / (n - 1.0)).sqrt() / b, b]
    }
}

/// The standard deviation of ranges from turn to turn in these directions, less what rounding to
/// `quantum_m` adds, if they have 100 differences.
pub fn repeatability(directions: &[&Direction], quantum_m: f64) -> Option<Estimate> {
    let all = || directions.iter().flat_map(|direction| &direction.differences_m);
    let mut sizes: Vec<f64> = all().map(|difference| difference.abs()).collect();
    if sizes.len() < 100 {
        return None;
    }
    // The median of a normal deviate's size is 0.6745.
    let mut sigma_m = (median(&mut sizes)? / 0.6745).max(LEAST_OF_QUANTUM * quantum_m).max(1e-6);
    let mut blocks = Blocks::default();
    for _ in 0..4 {
        blocks = Blocks::default();
        let limit_m = FARTHEST * sigma_m;
        for direction in directions {
            let kept = direction.differences_m.iter().filter(|size| size.abs() <= limit_m);
            let sums = kept.fold([0.0; 2], |[a, b], d| [a + d * d / CUT_VARIANCE, b + 1.0]);
            blocks.add(direction.block, sums);
        }
        sigma_m = blocks.ratio()[0].sqrt().max(LEAST_OF_QUANTUM * quantum_m).max(1e-6);
    }
    let [variance, error, n] = blocks.ratio();
    let of_quantum = quantum_m.powi(2) / 12.0;
    let sigma = |variance: f64| (variance - of_quantum).max(0.0).sqrt();
    let [value, low, high] = [variance, variance - Z * error, variance + Z * error].map(sigma);
    let least = LEAST_OF_QUANTUM * quantum_m;
    let is_hidden = value < least;
    Some(Estimate {
        value,
        low: if is_hidden { 0.0 } else { low },
        high: if is_hidden { high.max(least) } else { high },
        n: n as usize,
    })
}

/// The share of firings in these directions without a return.
pub fn missing(directions: &[&Direction]) -> Option<Estimate> {
    let mut blocks = Blocks::default();
    let (mut n_missing, mut n) = (0, 0);
    for direction in directions {
        let [a, b] = [direction.n_missing, direction.n_fired];
        (n_missing, n) = (n_missing + a, n + b);
        blocks.add(direction.block, [a as f64, b as f64]);
    }
    if n < 100 {
        return None;
    }
    let [value, error, _] = blocks.ratio();
    let (low, high) = wilson(n_missing, n);
    let by_blocks = Estimate::normal(value, error, n);
    Some(Estimate {
        low: low.min(by_blocks.low).max(0.0),
        high: high.max(by_blocks.high),
        ..by_blocks
    })
}
