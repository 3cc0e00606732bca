//! The effects' shaders against their f64 twins:
//! `shaders/effects/{noise_range,noise_xyz,dropout,intensity}.wgsl`,
//! `shaders/shared/{stream,normal_deviate}.wgsl` and `sim-gpu/src/cpu/effects.rs`.

use formats::rng::StreamKey;
use glam::DVec3;
use sim_gpu::effects::{Dropout, Effects, Intensity, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::effects::dropout;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::MISS;
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;
use test_support::need;
use tests::adapter::{adapter, casters};
use tests::casting::{at, beams, builtin, cast, hits, job, target};
use tests::effects::judge_effects;
use tests::meshes::{cube, icosphere, soup, torus};
use tests::random::Random;

fn noise(model: NoiseModel, mean_m: f64, sigma_m: f64) -> Noise {
    Noise { mean_m, sigma_m, model }
}

fn noisy(noise: Noise) -> Effects {
    Effects { noise: Some(noise), ..Effects::default() }
}

fn all_hit(stream: StreamKey, pattern: &BeamPattern) -> CastJob {
    CastJob { stream, ..job(&target(&cube()), &at(DVec3::new(0.1, 0.2, 0.3)), pattern) }
}

fn cast_all_hit(caster: &OpenCaster, pattern: &BeamPattern) -> Vec<(CastJob, Cast)> {
    let names = ["", "chair_0001", "chair_0002"];
    let answer = |(i, name)| {
        let job = all_hit(StreamKey::new(u64::from(i) * 0x1_0000_0001, name, i), pattern);
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
        let pattern = builtin("vlp32c");
        for (job, cast) in cast_all_hit(gpu, &pattern) {
            let verdicts = judge_effects(&job, &pattern, &cast, &effects);
            assert_eq!(verdicts.len(), 1);
            verdicts[0].assert_kept(&format!("{noise:?}"));
        }
    }
}

#[test]
fn outputs_beyond_their_tolerance_are_found_out() {
    let effects = Effects {
        dropout: Some(Dropout { probability: 0.25 }),
        intensity: Some(Intensity),
        ..noisy(noise(NoiseModel::Range, 0.0, 0.02))
    };
    let pattern = builtin("generic-static");
    let job = all_hit(StreamKey::new(0, "tampered", 0), &pattern);
    let original = cast(casters(&effects)[0], &job);
    for (output, wrong) in [(0, f32::NAN), (0, 1.0), (1, 0.5), (2, -1.0)] {
        let mut tampered = original.clone();
        tampered.effect_outputs[output] = wrong;
        let verdicts = judge_effects(&job, &pattern, &tampered, &effects);
        let broken: Vec<usize> = verdicts.iter().map(|verdict| verdict.broken.len()).collect();
        assert_eq!(broken, [0, 1, 2].map(|effect| usize::from(effect == output)), "{wrong}");
    }
}

#[test]
fn the_same_returns_drop_out_everywhere() {
    for probability in [0.0, 1e-4, 0.05, 1.0 / 3.0, 0.999, 1.0] {
        let model = Dropout { probability };
        let effects = Effects { dropout: Some(model), ..Effects::default() };
        for caster in casters(&effects) {
            for (job, cast) in cast_all_hit(caster, &builtin("vlp32c")) {
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
            let words = cast.codes.iter().zip(&cast.effect_outputs);
            for (_, word) in words.filter(|(code, _)| **code != MISS) {
                assert!((0.0..=0.75).contains(word), "{word}");
            }
            for verdict in judge_effects(&job, &pattern, &cast, &effects) {
                verdict.assert_kept(caster.name());
            }
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
        ..Effects::default()
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
