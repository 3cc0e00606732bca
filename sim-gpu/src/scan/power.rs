//! The power of a return, its detection and its calibrated reflectivity, in f64.
//!
//! Power is relative to that of a white surface that faces the sensor at 1 m in clear air:
//!
//! ```text
//! P = rho cos(theta) / R^2
//! ```
//!
//! for a surface that scatters by Lambert's law and fills the beam, with reflectivity rho,
//! incidence theta and range R. Shaders do not compute it: the range is known in f64 only after
//! casting, and every adapter must detect the same returns.

use crate::cpu::random::{Purpose, normal_deviate, random_bits};
use crate::effects::Detection;
use crate::sensor::DetectionLimit;
use edgepuck_mesh::material::Material;
use formats::rng::StreamKey;

/// Calibrated reflectivities: percent for diffuse surfaces, the rest of a byte for
/// retro-reflectors. VLP-32C User Manual 63-9325, 6.1.
const WHITE: f64 = 100.0;
const LEAST_RETRO: f64 = 101.0;
const IDEAL_RETRO: f64 = 255.0;

/// The brightness, 0 to 1, of a surface whose normal has this `cosine` to the beam. A white surface
/// that faces the sensor has 1.
///
/// A retro-reflector has 1 at any incidence. That is a lower bound: it returns far more, but makers
/// do not state how much.
pub(super) fn brightness(material: Material, cosine: impl FnOnce() -> f64) -> f64 {
    if material.retroreflection > 0.0 {
        return 1.0;
    }
    material.reflectivity * cosine().min(1.0)
}

pub(super) fn received(brightness: f64, range_m: f64) -> f64 {
    // A black surface returns nothing, even at range 0.
    if brightness == 0.0 { 0.0 } else { brightness / (range_m * range_m) }
}

pub(super) fn calibrated(brightness: f64, retroreflection: f64) -> u8 {
    let byte = match retroreflection {
        retro if retro > 0.0 => LEAST_RETRO + (IDEAL_RETRO - LEAST_RETRO) * retro,
        // Drops may be brighter than white.
        _ => (WHITE * brightness).min(WHITE),
    };
    byte.round() as u8
}

pub(super) fn is_detected(
    detection: &Detection,
    limit: &DetectionLimit,
    power: f64,
    stream: StreamKey,
    beam: u32,
) -> bool {
    let noise = detection.threshold_to_noise.map_or(0.0, |ratio| {
        normal_deviate(random_bits(stream, beam, Purpose::Receiver)[0]) / ratio
    });
    power + noise * limit.power() >= limit.power()
}

/// The error of the range of a detected return of this power due to the receiver's noise, metres.
/// The time of a pulse is measured to 1/sqrt(2 SNR) of its length, so that the standard deviation
/// falls as the square root of the power. Powers below the limit count as the limit.
pub(super) fn range_error(
    sigma_at_limit_m: f64,
    limit: &DetectionLimit,
    power: f64,
    stream: StreamKey,
    beam: u32,
) -> f64 {
    let weakest = limit.power();
    let deviate = normal_deviate(random_bits(stream, beam, Purpose::Receiver)[1]);
    sigma_at_limit_m * (weakest / power.max(weakest)).sqrt() * deviate
}
