//! Gaussian error of the range along the ray. Twin of
//! `shaders/effects/noise_range.wgsl`.

use super::stream::{normal_deviate, stream_words};
use crate::effects::Noise;
use formats::rng::StreamKey;

/// The error of `beam`'s range, metres.
#[must_use]
pub fn noise_range(noise: &Noise, stream: StreamKey, beam: u32) -> f64 {
    noise.mean_m + noise.sigma_m * normal_deviate(stream_words(stream, beam, 1)[0])
}
