//! Gaussian error of each coordinate. Twin of
//! `shaders/effects/noise_xyz.wgsl`.

use super::stream::{normal_deviate, stream_words};
use crate::effects::Noise;
use formats::rng::StreamKey;
use glam::DVec3;

/// The error of `beam`'s point, metres, in the world frame.
#[must_use]
pub fn noise_xyz(noise: &Noise, stream: StreamKey, beam: u32) -> DVec3 {
    let [x, y, z, _] = stream_words(stream, beam, 1).map(normal_deviate);
    DVec3::splat(noise.mean_m) + noise.sigma_m * DVec3::new(x, y, z)
}
