//! The Gaussian noise is Gaussian: moments, Kolmogorov-Smirnov, tails and
//! independence at n = 1e7 of the CPU twin, 1e6 of the adapter.
//!
//! The numbers are fixed by their keys, so a test that passes always passes.

use std::f64::consts::SQRT_2;

use formats::rng::StreamKey;
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::effects::{Effects, Noise, NoiseModel};
use sim_gpu::internals::cpu::random::{Purpose, normal_deviate, random_bits};
use test_support::need;
use tests::adapter::adapter;
use tests::casting::{at, beams, cast, job, target};
use tests::meshes::cube;
use tests::random::Random;

const N: u32 = 10_000_000;

/// Standard errors that a statistic may be off: 6e-7 of all seeds are.
const STANDARD_ERRORS: f64 = 5.0;

fn normal_cdf(z: f64) -> f64 {
    0.5 * libm::erfc(-z / SQRT_2)
}

fn deviates(key: StreamKey, n: u32) -> Vec<f64> {
    (0..n)
        .into_par_iter()
        .map(|beam| normal_deviate(random_bits(key, beam, Purpose::Noise)[0]))
        .collect()
}

fn assert_normal(deviates: &mut [f64]) {
    let n = deviates.len() as f64;
    let mean = deviates.iter().sum::<f64>() / n;
    let central = |power: i32| deviates.iter().map(|z| (z - mean).powi(power)).sum::<f64>() / n;
    let variance = central(2);
    let skew = central(3) / variance.powf(1.5);
    let kurtosis = central(4) / variance.powi(2);
    println!("mean {mean:.2e}, variance {variance:.6}, skew {skew:.2e}, kurtosis {kurtosis:.5}");
    // Standard errors of a normal sample.
    for (name, value, truth, error) in [
        ("mean", mean, 0.0, (1.0 / n).sqrt()),
        ("variance", variance, 1.0, (2.0 / n).sqrt()),
        ("skew", skew, 0.0, (6.0 / n).sqrt()),
        ("kurtosis", kurtosis, 3.0, (24.0 / n).sqrt()),
    ] {
        assert!((value - truth).abs() < STANDARD_ERRORS * error, "{name} {value}");
    }

    deviates.par_sort_unstable_by(f64::total_cmp);
    let distance = deviates
        .par_iter()
        .enumerate()
        .map(|(i, &z)| {
            let p = normal_cdf(z);
            (p - i as f64 / n).abs().max(((i + 1) as f64 / n - p).abs())
        })
        .reduce(|| 0.0, f64::max);
    // Kolmogorov: P(D sqrt(n) > x) = 2 exp(-2 x^2) to first order, 1e-4 at 2.225.
    println!("Kolmogorov-Smirnov {:.3} of at most 2.225", distance * n.sqrt());
    assert!(distance * n.sqrt() < 2.225);
}

#[test]
fn ten_million_deviates_are_normal() {
    assert_normal(&mut deviates(StreamKey::new(1, "chair_0001", 2), N));
}

/// Beyond 5 sigma lie 5.7 of 1e7, so their share is counted over the bits, not
/// over a sample: exactly those that the distribution function gives.
#[test]
fn tails_hold_their_exact_share_of_the_bits() {
    for beyond in [3.0, 4.0, 5.0, 5.5, 6.0] {
        // Deviates fall as the bits rise, so a search finds the last beyond.
        let (mut beyond_until, mut within_from) = (0u32, 1 << 31);
        while within_from - beyond_until > 1 {
            let middle = beyond_until + (within_from - beyond_until) / 2;
            if normal_deviate(middle) > beyond {
                beyond_until = middle
            } else {
                within_from = middle
            }
        }
        let share = f64::from(within_from) / 4_294_967_296.0;
        let truth = normal_cdf(-beyond);
        // PPND7 is good to 1e-7 of z, which moves the tail by z^2 of that; one
        // value of the bits more or less weighs 2^-32.
        let tolerance = truth * beyond * beyond * 2e-7 + 1.0 / 4_294_967_296.0;
        assert!((share - truth).abs() <= tolerance, "{beyond}: {share:e} is not {truth:e}");
    }
}

#[test]
fn the_deviate_is_odd_monotonous_and_finite_to_its_ends() {
    // The largest: a tail of 2^-33.
    let largest = normal_deviate(0);
    assert!((normal_cdf(-largest) * 2f64.powi(33) - 1.0).abs() < 1e-4, "{largest}");
    assert!(largest > 6.2 && largest < 6.4);
    // The smallest: half a step from the median, whose density is 0.3989.
    let smallest = normal_deviate(0x7FFF_FFFF);
    let step = 2f64.powi(-33) / 0.398_942_28;
    assert!((smallest / step - 1.0).abs() < 1e-6, "{smallest}");
    assert_eq!(normal_deviate(0x8000_0000), -largest);
    assert_eq!(normal_deviate(0xFFFF_FFFF), -smallest);
    assert!(normal_deviate(1) < largest);

    // Every 64th value of the bits, and all at both ends and at the joint of
    // both branches (a tail of 0.075).
    let joint = (0.075 * 4_294_967_296.0) as u32;
    let dense = (0..1u32 << 16)
        .chain(joint - (1 << 16)..joint + (1 << 16))
        .chain((1 << 31) - (1 << 16)..1 << 31);
    let bits: Vec<u32> = (0..1u32 << 25).map(|i| i * 64).chain(dense).collect();
    bits.par_iter().for_each(|&k| {
        let z = normal_deviate(k);
        assert!(z.is_finite() && z > 0.0);
        assert_eq!(normal_deviate(k | 1 << 31), -z);
        // PPND7's error of 1e-7 exceeds a step of the bits near the median, and
        // the branches meet within it.
        if k > 0 {
            assert!(z <= normal_deviate(k - 1) + 1e-7, "{k:#x}");
        }
    });
}

#[test]
fn the_deviate_is_the_inverse_of_the_distribution_function() {
    (0..1u32 << 20).into_par_iter().for_each(|i| {
        let k = i << 11 | i & 0x7FF;
        let tail = (f64::from(k) + 0.5) / 4_294_967_296.0;
        let z = normal_deviate(k);
        let density = (-0.5 * z * z).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let error = (normal_cdf(-z) - tail).abs() / density;
        // AS 241: about one part in 10^7.
        assert!(error <= 3e-7 * z.max(1.0), "{k:#x}: {error:e}");
    });
}

/// Neighbouring beams, views, names, seeds and words of one counter.
#[test]
fn deviates_of_different_things_do_not_correlate() {
    let n = 1_000_000u32;
    let base = deviates(StreamKey::new(1, "chair_0001", 2), n + 64);
    let own = &base[..n as usize];
    let word = |i: usize| -> Vec<f64> {
        let key = StreamKey::new(1, "chair_0001", 2);
        (0..n)
            .into_par_iter()
            .map(|beam| normal_deviate(random_bits(key, beam, Purpose::Noise)[i]))
            .collect()
    };
    let lost = |beam| {
        normal_deviate(random_bits(StreamKey::new(1, "chair_0001", 2), beam, Purpose::Dropout)[0])
    };
    let losses: Vec<f64> = (0..n).into_par_iter().map(lost).collect();
    let others = [
        ("next beam", base[1..=n as usize].to_vec()),
        ("beam 16 further", base[16..n as usize + 16].to_vec()),
        ("beam 64 further", base[64..].to_vec()),
        ("next view", deviates(StreamKey::new(1, "chair_0001", 3), n)),
        ("other name", deviates(StreamKey::new(1, "chair_0002", 2), n)),
        ("next seed", deviates(StreamKey::new(2, "chair_0001", 2), n)),
        ("second coordinate", word(1)),
        ("third coordinate", word(2)),
        ("losses", losses),
    ];
    for (name, other) in &others {
        let correlate = |f: fn(f64) -> f64| {
            own.iter().zip(other).map(|(a, b)| f(*a) * f(*b)).sum::<f64>() / f64::from(n)
        };
        // Of products of independent deviates: variance 1; of squares less 1: 4.
        let (plain, squares) = (correlate(|z| z), correlate(|z| z * z - 1.0));
        let error = 1.0 / f64::from(n).sqrt();
        assert!(plain.abs() < STANDARD_ERRORS * error, "{name}: {plain}");
        assert!(squares.abs() < STANDARD_ERRORS * 2.0 * error, "{name}, squares: {squares}");
    }
}

#[test]
fn a_million_deviates_of_the_adapter_are_normal() {
    let noise = Noise { mean_m: 0.0, sigma_m: 1.0, model: NoiseModel::Range };
    let effects = Effects { noise: Some(noise), ..Effects::default() };
    let gpu = need!(adapter(&effects));
    let mut random = Random::new("directions");
    let pattern = beams((0..1_000_000).map(|_| random.direction()));
    let mut job = job(&target(&cube()), &at(DVec3::new(0.1, 0.2, 0.3)), &pattern);
    job.stream = StreamKey::new(1, "chair_0001", 2);
    let outputs = cast(gpu, &job).effect_outputs;
    let mut deviates: Vec<f64> = outputs.into_iter().map(f64::from).collect();
    assert_eq!(deviates.len(), 1_000_000);
    assert_normal(&mut deviates);
}
