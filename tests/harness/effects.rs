//! Holds the outputs of the effects' shaders to their f64 counterparts.

use sim_gpu::effects::{Effects, Noise, RayEffect};
use sim_gpu::internals::cpu::effects::append_outputs;
use sim_gpu::internals::job::{Cast, CastJob};
use sim_gpu::internals::ray::{AMBIGUOUS, MISS};
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::Target;

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

/// How the outputs of one effect compare with those of its counterpart.
#[derive(Clone, Debug)]
pub struct EffectVerdict {
    /// The name of its shader.
    pub name: &'static str,
    /// Outputs that were compared.
    pub outputs: usize,
    /// The largest error, as a share of what is tolerated.
    pub worst_of_tolerance: f64,
    /// What is beyond its tolerance, in words.
    pub broken: Vec<String>,
}

/// One verdict for each of `effects`, on the rays of `job` that hit.
pub fn judge_effects(
    job: &CastJob,
    pattern: &BeamPattern,
    cast: &Cast,
    effects: &Effects,
) -> Vec<EffectVerdict> {
    let all: Vec<RayEffect> = effects.per_ray().collect();
    let verdict = |effect: &RayEffect| EffectVerdict {
        name: effect.name(),
        outputs: 0,
        worst_of_tolerance: 0.0,
        broken: Vec::new(),
    };
    let mut verdicts: Vec<EffectVerdict> = all.iter().map(verdict).collect();
    let mut expected = Vec::new();
    let outputs = cast.effect_outputs.chunks_exact(effects.outputs_per_ray());
    let answers = cast.codes.iter().zip(&job.beams).zip(outputs);
    for ((&code, &beam), outputs) in answers.filter(|((code, _), _)| **code != MISS) {
        let triangle = code & !AMBIGUOUS;
        expected.clear();
        let ray = job.frame.beam(pattern, beam);
        append_outputs(&mut expected, effects, job, beam, &ray, triangle);
        let mut pairs = outputs.iter().zip(&expected);
        for (effect, verdict) in all.iter().zip(&mut verdicts) {
            let tolerance = tolerance(effect, &job.target, triangle);
            for (&output, &expected) in pairs.by_ref().take(effect.width()) {
                verdict.add(beam, [output, expected].map(f64::from), tolerance);
            }
        }
    }
    verdicts
}

/// What an effect's output may differ by from its counterpart's, rounded to f32.
fn tolerance(effect: &RayEffect, target: &Target, triangle: u32) -> f64 {
    match effect {
        RayEffect::NoiseRange(noise) | RayEffect::NoiseXyz(noise) => noise_tolerance(noise),
        RayEffect::Intensity => intensity_tolerance(target, triangle),
        _ => 0.0,
    }
}

/// Mean and sigma in f32, their product, their sum and the counterpart's rounding: 2^-24 each.
fn noise_tolerance(noise: &Noise) -> f64 {
    let largest = noise.mean_m.abs() + 7.0 * noise.sigma_m;
    noise.sigma_m * DEVIATE_TOLERANCE + 5.0 * 2f64.powi(-24) * largest
}

/// f32 corners move the normal by at most twice sqrt(3) 2^-24 over the
/// triangle's height; a cross product of edges rounds by the sine between
/// them, at least height over longest edge; the rest is a dot product and the
/// counterpart's rounding.
fn intensity_tolerance(target: &Target, triangle: u32) -> f64 {
    let [a, b, c] = target.surface.corners(triangle);
    let longest = (b - a).length().max((c - b).length()).max((a - c).length());
    let height = (b - a).cross(c - a).length() / longest;
    2f64.powi(-24) * (4.0 / height + 8.0 * longest / height + 9.0)
}

impl EffectVerdict {
    fn add(&mut self, beam: u32, [output, expected]: [f64; 2], tolerance: f64) {
        let error = (output - expected).abs();
        self.outputs += 1;
        self.worst_of_tolerance = self.worst_of_tolerance.max(error / tolerance);
        if error.is_nan() || error > tolerance {
            let name = self.name;
            self.broken.push(format!("{name}, beam {beam}: expected {expected}, found {output}"));
        }
    }

    /// Asserts that outputs were compared and are within their tolerances.
    pub fn assert_kept(&self, what: &str) {
        let first: Vec<_> = self.broken.iter().take(5).map(String::as_str).collect();
        assert!(first.is_empty(), "{what}: {}:\n{}", self.broken.len(), first.join("\n"));
        assert!(self.outputs > 500, "{what}: {self:?}");
    }
}
