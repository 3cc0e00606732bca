//! The outputs of each effect for a ray, in f64. Each function is the counterpart of the shader
//! of its name in `shaders/effects/`.

use super::oracle;
use super::random::{Purpose, normal_deviate, random_bits};
use crate::effects::{Dropout, Effects, Noise, RayEffect};
use crate::job::CastJob;
use crate::ray::Ray;
use crate::target::Target;
use formats::rng::StreamKey;
use glam::DVec3;

/// Appends to `outputs` those of `effects` for one return, in the order of [`Effects::per_ray`].
pub fn append_outputs(
    outputs: &mut Vec<f32>,
    effects: &Effects,
    job: &CastJob,
    beam: u32,
    ray: &Ray,
    index: u32,
) {
    for effect in effects.per_ray() {
        match effect {
            RayEffect::NoiseRange(noise) => {
                outputs.push(noise_range(&noise, job.stream, beam) as f32);
            }
            RayEffect::NoiseXyz(noise) => {
                outputs.extend(noise_xyz(&noise, job.stream, beam).as_vec3().to_array());
            }
            RayEffect::Dropout(model) => {
                outputs.push(f32::from(u8::from(dropout(&model, job.stream, beam))));
            }
            RayEffect::Intensity => {
                let reflectivity = job.reflectivity.into();
                outputs.push(intensity(&job.target, ray, index, reflectivity) as f32);
            }
        }
    }
}

/// The error of the range of `beam` along the ray, metres.
#[must_use]
pub fn noise_range(noise: &Noise, stream: StreamKey, beam: u32) -> f64 {
    noise.mean_m + noise.sigma_m * normal_deviate(random_bits(stream, beam, Purpose::Noise)[0])
}

/// The error of each coordinate of the point of `beam`, metres, in the world frame.
#[must_use]
pub fn noise_xyz(noise: &Noise, stream: StreamKey, beam: u32) -> DVec3 {
    let [x, y, z, _] = random_bits(stream, beam, Purpose::Noise).map(normal_deviate);
    DVec3::splat(noise.mean_m) + noise.sigma_m * DVec3::new(x, y, z)
}

/// Whether the return of `beam` is lost. The probability is rounded to f32 and the random number
/// has 24 bits, so that every adapter drops the same returns.
#[must_use]
pub fn dropout(dropout: &Dropout, stream: StreamKey, beam: u32) -> bool {
    let unit = (random_bits(stream, beam, Purpose::Dropout)[0] >> 8) as f32 * (1.0 / 16_777_216.0);
    unit < dropout.probability as f32
}

/// The intensity of a return, 0 to 1: |cos(incidence)| x reflectivity, BLAINDER's model.
#[must_use]
pub fn intensity(target: &Target, ray: &Ray, index: u32, reflectivity: f64) -> f64 {
    // Rounded as casters get it, so that both sources of a direction give the same intensity.
    let direction = ray.direction.as_vec3().as_dvec3();
    // Both faces of a triangle reflect alike.
    let cosine = oracle::normal(target, index).dot(direction.normalize()).abs();
    cosine.min(1.0) * reflectivity
}
