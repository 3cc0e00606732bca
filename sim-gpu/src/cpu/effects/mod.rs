//! The CPU twins of `shaders/effects/`, in f64.

pub mod dropout;
pub mod intensity;
pub mod noise_range;
pub mod noise_xyz;
pub mod stream;

use crate::effects::{Effects, NoiseModel};
use crate::job::CastJob;
use crate::ray::Ray;

/// The words of all `effects` for a return of `beam` from triangle `index`,
/// appended to `words`, in the order of [`crate::gpu::modules`].
pub fn append_words(
    words: &mut Vec<f32>,
    effects: &Effects,
    job: &CastJob,
    beam: u32,
    ray: &Ray,
    index: u32,
) {
    match &effects.noise {
        Some(noise) if noise.model == NoiseModel::Range => {
            words.push(noise_range::noise_range(noise, job.stream, beam) as f32);
        }
        Some(noise) => {
            let error = noise_xyz::noise_xyz(noise, job.stream, beam);
            words.extend(error.as_vec3().to_array());
        }
        None => {}
    }
    if let Some(dropout) = &effects.dropout {
        words.push(f32::from(u8::from(dropout::dropout(dropout, job.stream, beam))));
    }
    if effects.intensity.is_some() {
        let reflectivity = job.reflectivity.into();
        words.push(intensity::intensity(&job.target, ray, index, reflectivity) as f32);
    }
}
