//! The power of a return, and what follows from it, in f64.
//!
//! Power is relative to what is received from a white surface that faces the sensor 1 m
//! away, in clear air:
//!
//! ```text
//! P = rho cos(theta) / R^2
//! ```
//!
//! for a surface that scatters by Lambert's law, wider than the beam: rho its
//! reflectivity, theta the incidence, R the range. It stands here and in no shader: the
//! range is known in f64 only once it is resolved, and a threshold must fall alike on
//! every adapter.

use crate::cpu::random::{normal_deviate, random_bits};
use crate::effects::Detection;
use crate::material::Material;
use crate::sensor::DetectionLimit;
use formats::rng::StreamKey;

/// Which random bits of a beam are the receiver's noise and the error of its timing.
const RECEIVER_PURPOSE: u32 = 3;

/// Diffuse reflectivities in percent; retro-reflectors take the rest of a byte: VLP-32C
/// User Manual 63-9325, 6.1.
const WHITE: f64 = 100.0;
const LEAST_RETRO: f64 = 101.0;
const IDEAL_RETRO: f64 = 255.0;

/// How bright a surface is whose normal has this `cosine` to the beam, 0 to 1: a white one that
/// faces the sensor is 1.
///
/// So is a retro-reflector at any incidence. It returns far more than that; how much no
/// maker states, so that this is a lower bound.
pub(super) fn brightness(material: Material, cosine: impl FnOnce() -> f64) -> f64 {
    if material.retroreflection > 0.0 {
        return 1.0;
    }
    material.reflectivity * cosine().min(1.0)
}

/// The power received from a surface of this brightness at this range.
pub(super) fn received(brightness: f64, range_m: f64) -> f64 {
    // Nothing is received of black, even where the sensor touches it.
    if brightness == 0.0 { 0.0 } else { brightness / (range_m * range_m) }
}

/// The byte that a sensor with calibrated reflectivity reports.
pub(super) fn calibrated(brightness: f64, retroreflection: f64) -> u8 {
    let byte = match retroreflection {
        retro if retro > 0.0 => LEAST_RETRO + (IDEAL_RETRO - LEAST_RETRO) * retro,
        // Drops may be brighter than white.
        _ => (WHITE * brightness).min(WHITE),
    };
    byte.round() as u8
}

/// Whether a return of this power is detected.
pub(super) fn is_detected(
    detection: &Detection,
    limit: &DetectionLimit,
    power: f64,
    stream: StreamKey,
    beam: u32,
) -> bool {
    let noise = detection.threshold_to_noise.map_or(0.0, |ratio| {
        normal_deviate(random_bits(stream, beam, RECEIVER_PURPOSE)[0]) / ratio
    });
    power + noise * limit.power() >= limit.power()
}

/// The error that the receiver's noise gives the range of a return that is detected with
/// this power, metres. A pulse's time is known to 1/sqrt(2 SNR) of its length: the standard
/// deviation falls as the square root of the power. The limit is the least power that counts.
pub(super) fn range_error(
    sigma_at_limit_m: f64,
    limit: &DetectionLimit,
    power: f64,
    stream: StreamKey,
    beam: u32,
) -> f64 {
    let weakest = limit.power();
    let deviate = normal_deviate(random_bits(stream, beam, RECEIVER_PURPOSE)[1]);
    sigma_at_limit_m * (weakest / power.max(weakest)).sqrt() * deviate
}
