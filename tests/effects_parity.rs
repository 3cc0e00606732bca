//! The effects' shaders against their f64 twins:
//! `shaders/effects/{noise_range,noise_xyz,dropout,intensity}.wgsl`,
//! `shaders/shared/{stream,normal_deviate}.wgsl` and `sim-gpu/src/cpu/effects.rs`.

use formats::rng::StreamKey;
use glam::DVec3;
use sim_gpu::caster::Caster;
use sim_gpu::cpu::effects::{dropout, intensity, noise_range, noise_xyz};
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::job::{Cast, CastJob};
use sim_gpu::pose::Pose;
use sim_gpu::ray::{AMBIGUOUS, MISS};
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::Target;
use test_support::need;
use tests::adapter::{adapter, casters};
use tests::casting::{at, beams, builtin, cast, hits, job, target};
use tests::meshes::{cube, icosphere, soup, torus};
use tests::random::Random;

/// How far the shader's standard normal deviate may lie from the f64 twin's,
/// by the accuracy that WGSL promises, with u = 2^-24.
///
/// Within 1.44 sigma: q (2u), r (3u), six roundings in either polynomial, of
/// positive terms alone, and 5u of the division: 22u of 1.44, so 1.9e-6.
/// Beyond: the tail probability (2u) and 3 units in the last place of its
/// logarithm, 5.7e-6 at 22.9, halve in the root; the root's own 4.5 units,
/// 2.1e-6; together 5e-6 of r. Times the slope of at most 1.6, and 17u of 6.3
/// for the polynomials: 1.5e-5.
const DEVIATE_TOLERANCE: f64 = 1.5e-5;

fn noise(model: NoiseModel, mean_m: f64, sigma_m: f64) -> Noise {
    Noise { mean_m, sigma_m, model }
}

fn noisy(noise: Noise) -> Effects {
    Effects { noise: Some(noise), ..Effects::default() }
}

/// Mean and sigma in f32, their product and their sum: 2^-24 each.
fn noise_tolerance(noise: &Noise) -> f64 {
    let largest = noise.mean_m.abs() + 7.0 * noise.sigma_m;
    noise.sigma_m * DEVIATE_TOLERANCE + 4.0 * 2f64.powi(-24) * largest
}

/// A job of which every ray hits: a sensor in a cube.
fn all_hit(stream: StreamKey, pattern: &BeamPattern) -> CastJob {
    CastJob { stream, ..job(&target(&cube()), &at(DVec3::new(0.1, 0.2, 0.3)), pattern) }
}

/// What `caster` answers for jobs of several streams, in all of which every ray hits.
fn cast_all_hit(caster: &Caster) -> Vec<(CastJob, Cast)> {
    let pattern = builtin("vlp32c");
    let names = ["", "chair_0001", "chair_0002"];
    let answer = |(i, name)| {
        let job = all_hit(StreamKey::new(u64::from(i) * 0x1_0000_0001, name, i), &pattern);
        let cast = cast(caster, &job);
        assert!(cast.codes.iter().all(|&code| code != MISS));
        (job, cast)
    };
    (0..).zip(names).map(answer).collect()
}

#[test]
fn noise_is_its_counterparts() {
    for noise in [
        noise(NoiseModel::Range, 0.0, 1.0),
        noise(NoiseModel::Range, 0.0, 0.0),
        noise(NoiseModel::Range, 0.0, 1e-6),
        noise(NoiseModel::Range, -0.3, 0.01),
        noise(NoiseModel::Range, 5.0, 1e3),
        noise(NoiseModel::Xyz, 0.0, 1.0),
        noise(NoiseModel::Xyz, 0.25, 0.02),
    ] {
        let effects = noisy(noise);
        let gpu = need!(adapter(&effects));
        for (job, cast) in cast_all_hit(gpu) {
            let outputs = cast.effect_outputs.chunks_exact(effects.outputs_per_ray());
            for (&beam, outputs) in job.beams.iter().zip(outputs) {
                let expected = match noise.model {
                    NoiseModel::Range => vec![noise_range(&noise, job.stream, beam)],
                    NoiseModel::Xyz => noise_xyz(&noise, job.stream, beam).to_array().to_vec(),
                };
                for (&output, expected) in outputs.iter().zip(expected) {
                    let error = (f64::from(output) - expected).abs();
                    let is_near = error <= noise_tolerance(&noise);
                    assert!(is_near, "beam {beam}: {error:.2e} of {noise:?}");
                }
            }
        }
    }
}

#[test]
fn the_same_returns_drop_out_everywhere() {
    for probability in [0.0, 1e-4, 0.05, 1.0 / 3.0, 0.999, 1.0] {
        let model = Dropout { probability };
        let effects = Effects { dropout: Some(model), ..Effects::default() };
        for caster in casters(&effects) {
            for (job, cast) in cast_all_hit(caster) {
                let mut dropped = 0;
                for (&beam, &word) in job.beams.iter().zip(&cast.effect_outputs) {
                    assert_eq!(word == 1.0, dropout(&model, job.stream, beam), "beam {beam}");
                    assert!(word == 0.0 || word == 1.0);
                    dropped += usize::from(word == 1.0);
                }
                let n = job.beams.len() as f64;
                let deviation = (n * probability * (1.0 - probability)).sqrt();
                let error = (dropped as f64 - n * probability).abs();
                assert!(error <= 5.0 * deviation, "{dropped} of {n} at {probability}");
            }
        }
    }
}

/// f32 corners move the normal by at most twice sqrt(3) 2^-24 over the
/// triangle's height; a cross product of edges rounds by the sine between
/// them, at least height over longest edge; the rest is a dot product.
fn intensity_tolerance(target: &Target, triangle: u32) -> f64 {
    let [a, b, c] = target.surface.corners(triangle);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let height = (b - a).cross(c - a).length() / longest;
    2f64.powi(-24) * (4.0 / height + 8.0 * longest / height + 8.0)
}

#[test]
fn intensity_is_the_twins() {
    let effects = Effects { intensity: Some(Intensity), ..Effects::default() };
    let pattern = builtin("vlp32c");
    for caster in casters(&effects) {
        for mesh in [icosphere(4), torus(40), soup(500, 0.3), cube()] {
            let target: Target = target(&mesh);
            let pose = Pose::look_at(DVec3::new(2.5, 1.0, 0.7), DVec3::ZERO).unwrap();
            let job = job(&target, &pose, &pattern);
            let cast = cast(caster, &job);
            let mut n = 0;
            let answers = cast.codes.iter().zip(&job.beams).zip(&cast.effect_outputs);
            for ((&code, &beam), &word) in answers.filter(|((code, _), _)| **code != MISS) {
                let triangle = code & !AMBIGUOUS;
                let ray = job.frame.ray(pattern.directions[beam as usize]);
                let truth = intensity(&target, &ray, triangle, 0.75);
                let error = (f64::from(word) - truth).abs();
                assert!((0.0..=0.75).contains(&word), "{word}");
                let tolerance = intensity_tolerance(&target, triangle);
                assert!(error <= tolerance, "{}: {error:.2e} > {tolerance:.2e}", caster.name());
                n += 1;
            }
            assert!(n > 500, "{n} hits");
        }
    }
}

#[test]
fn the_outputs_of_all_effects_stand_side_by_side() {
    let noise = noise(NoiseModel::Xyz, 0.0, 0.5);
    let dropout = Dropout { probability: 0.25 };
    let all = Effects {
        noise: Some(noise),
        dropout: Some(dropout),
        intensity: Some(Intensity),
        quantum: None,
    };
    let singles = [
        noisy(noise),
        Effects { dropout: Some(dropout), ..Effects::default() },
        Effects { intensity: Some(Intensity), ..Effects::default() },
    ];
    let mut random = Random::new("directions");
    let pattern = beams((0..5000).map(|_| random.direction()));
    let on = |effects: &Effects| -> Vec<Vec<f32>> {
        let job = all_hit(StreamKey::new(3, "x", 1), &pattern);
        casters(effects).iter().map(|caster| hits(caster, &job, &pattern).effect_outputs).collect()
    };
    let together = on(&all);
    let [noises, dropouts, intensities] = singles.map(|effects| on(&effects));
    for (i, words) in together.iter().enumerate() {
        assert_eq!(words.len(), 5 * pattern.len());
        for (beam, word) in words.chunks_exact(5).enumerate() {
            assert_eq!(word[..3], noises[i][3 * beam..3 * beam + 3]);
            assert_eq!(word[3], dropouts[i][beam]);
            assert_eq!(word[4], intensities[i][beam]);
        }
    }
}
