//! Rain and snow: the drops in a beam that a sensor detects.

use crate::cpu::random::Purpose;
use crate::sensor::RangeLimits;

pub(super) struct Beam {
    /// The geometric mean of the tangents of its angles of divergence.
    pub width: f64,
    /// The extinction of the air, per metre.
    pub extinction: f64,
    pub least_power: f64,
    pub range: RangeLimits,
}

/// The detectable drops of one kind in a beam.
#[derive(Clone, Debug)]
pub(super) struct Drops {
    /// The exponent of the distribution of diameters, 1/mm.
    slope: f64,
    /// The reflectance of a large drop.
    reflectance: f64,
    width: f64,
    extinction: f64,
    least_power: f64,
    /// The start and the step of the ranges of `counts`, metres.
    from_m: f64,
    step_m: f64,
    /// The mean number of drops that are detected up to each range.
    counts: Vec<f64>,
    /// The probability that a beam of full length has no such drop.
    none: f64,
}

/// The smallest diameter, millimetres: LISA.
const SMALLEST_MM: f64 = 0.05;

/// Indices of refraction at 905 nm: LISA.
const WATER: f64 = 1.328;
const ICE: f64 = 1.3031;

/// Steps of the integral along a beam, which is smooth: the relative error of Simpson's rule is
/// 1e-6.
const STEPS: usize = 256;

/// The extinction of rain at this rate, per metre.
pub(super) fn rain_extinction(mm_h: f64) -> f64 {
    3.67e-4 * libm::pow(mm_h, 0.63)
}

/// The extinction of snow at this rate, per metre.
pub(super) fn snow_extinction(mm_h: f64) -> f64 {
    1.447e-3 * libm::pow(mm_h, 0.565)
}

impl Drops {
    /// Marshall and Palmer's rain.
    pub fn rain(mm_h: f64, beam: &Beam) -> Self {
        Self::new(8000.0, 4.1 * libm::pow(mm_h, -0.21), WATER, beam)
    }

    /// Gunn and Marshall's snow, twice as dense: LISA.
    pub fn snow(mm_h: f64, beam: &Beam) -> Self {
        Self::new(7600.0 * libm::pow(mm_h, -0.87), 2.55 * libm::pow(mm_h, -0.48), ICE, beam)
    }

    /// Drops with a density of `per_m3_mm * exp(-slope D)` per cubic metre and millimetre of
    /// diameter.
    fn new(per_m3_mm: f64, slope: f64, refraction: f64, beam: &Beam) -> Self {
        let from_m = beam.range.min_m.min(beam.range.max_m);
        let Beam { width, extinction, least_power, .. } = *beam;
        let mut drops = Self {
            slope,
            reflectance: ((refraction - 1.0) / (refraction + 1.0)).powi(2),
            width,
            extinction,
            least_power,
            from_m,
            step_m: 0.0,
            counts: vec![0.0],
            none: 1.0,
        };
        let to_m = drops.last_m(beam.range.max_m);
        let per_m3 = per_m3_mm / slope * libm::exp(-slope * SMALLEST_MM);
        let density = |range_m: f64| {
            // The cross-section of the beam.
            let area = std::f64::consts::PI / 4.0 * (width * range_m).powi(2);
            per_m3 * area * drops.part_detected(range_m)
        };
        let step_m = (to_m - from_m) / STEPS as f64;
        let mut count = 0.0;
        let mut counts = vec![count];
        for i in 0..STEPS {
            let at = |part: f64| density(from_m + (i as f64 + part) * step_m);
            count += step_m / 6.0 * (at(0.0) + 4.0 * at(0.5) + at(1.0));
            counts.push(count);
        }
        (drops.step_m, drops.counts, drops.none) = (step_m, counts, libm::exp(-count));
        drops
    }

    /// The smallest diameter that is detected at this range, millimetres; infinite if none is.
    fn least_mm(&self, range_m: f64) -> f64 {
        let through = libm::exp(-2.0 * self.extinction * range_m);
        let whole = self.reflectance * through / range_m.powi(2);
        if whole < self.least_power {
            return f64::INFINITY;
        }
        let part = (self.least_power / whole).sqrt();
        (1000.0 * self.width * range_m * part).max(SMALLEST_MM)
    }

    fn part_detected(&self, range_m: f64) -> f64 {
        libm::exp(-self.slope * (self.least_mm(range_m) - SMALLEST_MM))
    }

    /// The range up to which drops are detected, at most `end_m`, metres: beyond it, less than one
    /// in 10^17 is.
    fn last_m(&self, end_m: f64) -> f64 {
        let is_seen = |range_m: f64| self.part_detected(range_m) > 1e-17;
        if is_seen(end_m) {
            return end_m;
        }
        let (mut seen_m, mut unseen_m) = (self.from_m, end_m);
        for _ in 0..64 {
            let middle_m = 0.5 * (seen_m + unseen_m);
            let half = if is_seen(middle_m) { &mut seen_m } else { &mut unseen_m };
            *half = middle_m;
        }
        unseen_m
    }

    pub fn mean(&self, range_m: f64) -> f64 {
        let place = (range_m - self.from_m) / self.step_m;
        let last = self.counts.len() - 1;
        match place {
            place if place > 0.0 && place < last as f64 => {
                let below = place as usize;
                let [low, high] = [below, below + 1].map(|i| self.counts[i]);
                low + (high - low) * (place - below as f64)
            }
            place if place >= last as f64 => self.counts[last],
            _ => 0.0,
        }
    }

    /// Passes the range and the power of each detected drop up to `end_m` to `take`.
    pub fn draw(&self, end_m: f64, bits: impl Fn(u32) -> [u32; 4], mut take: impl FnMut(f64, f64)) {
        let first = bits(0);
        let uniform = super::unit(first[0]);
        // Most beams have no drop, and a surface only shortens a beam.
        if uniform < self.none {
            return;
        }
        let mean = self.mean(end_m);
        if mean.is_nan() || mean <= 0.0 {
            return;
        }
        let count = poisson(mean, uniform);
        for number in 0..count {
            let [_, place, size, _] = if number == 0 { first } else { bits(number) };
            let range_m = self.place(super::unit(place) * mean).min(end_m);
            let excess_mm = -libm::log1p(-super::unit(size)) / self.slope;
            let diameter_m = (self.least_mm(range_m) + excess_mm) / 1000.0;
            let part = (diameter_m / (self.width * range_m)).powi(2).min(1.0);
            let through = libm::exp(-2.0 * self.extinction * range_m);
            let power = self.reflectance * through * part / range_m.powi(2);
            if power >= self.least_power {
                take(range_m, power);
            }
        }
    }

    /// The range up to which the mean number of drops is `count`.
    fn place(&self, count: f64) -> f64 {
        let above =
            self.counts.partition_point(|&sum| sum <= count).clamp(1, self.counts.len() - 1);
        let [low, high] = [above - 1, above].map(|i| self.counts[i]);
        let part = if high > low { ((count - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 };
        self.from_m + (above as f64 - 1.0 + part) * self.step_m
    }
}

/// A Poisson number of this `mean` from a uniform number in [0, 1), by inversion; at most
/// [`Purpose::MOST_DROPS`].
fn poisson(mean: f64, uniform: f64) -> u32 {
    let mut term = libm::exp(-mean);
    let (mut sum, mut count) = (term, 0);
    while uniform >= sum && count < Purpose::MOST_DROPS {
        count += 1;
        term *= mean / f64::from(count);
        sum += term;
    }
    count
}
