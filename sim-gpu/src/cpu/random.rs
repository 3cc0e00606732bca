//! Random bits and normal deviates. Counterpart of `shaders/shared/{stream,normal_deviate}.wgsl`.

use formats::rng::StreamKey;

/// Random bits of a beam for one purpose: 1 noise, 2 dropout, 3 the receiver, 16 glass.
#[must_use]
pub fn random_bits(stream: StreamKey, beam: u32, purpose: u32) -> [u32; 4] {
    stream.words([beam, purpose, 0, 0])
}

/// A standard normal deviate from 32 random bits, by inversion: PPND7 of
/// Wichura, "Algorithm AS 241", Applied Statistics 37(3), 1988, seven digits.
///
/// The top bit is the sign, the others a tail probability in (0, 1/2), at least 2^-33: deviates
/// reach 6.3 standard deviations, and the algorithm's third branch (beyond 7) is never needed.
#[must_use]
pub fn normal_deviate(bits: u32) -> f64 {
    const PER_2_32: f64 = 1.0 / 4_294_967_296.0;
    let k = bits & 0x7FFF_FFFF;
    let q = (f64::from(0x8000_0000 - k) - 0.5) * PER_2_32;
    let z = if q <= 0.425 {
        let r = 0.180_625 - q * q;
        q * (((59.109_374_72 * r + 159.291_132_02) * r + 50.434_271_938) * r + 3.387_132_717_9)
            / (((67.187_563_6 * r + 78.757_757_664) * r + 17.895_169_469) * r + 1.0)
    } else {
        let r = (-((f64::from(k) + 0.5) * PER_2_32).ln()).sqrt() - 1.6;
        (((0.170_238_211_03 * r + 1.306_728_481_6) * r + 2.756_815_39) * r + 1.423_437_277_7)
            / ((0.120_211_329_75 * r + 0.737_001_642_5) * r + 1.0)
    };
    if bits >= 0x8000_0000 { -z } else { z }
}
