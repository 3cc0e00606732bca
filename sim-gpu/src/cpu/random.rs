//! Random bits and normal deviates. Counterpart of `shaders/shared/{stream,normal_deviate}.wgsl`.

use formats::rng::StreamKey;

/// What a beam draws random bits for.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// Noise of the range or of the coordinates.
    Noise,
    /// Losses whatever the power.
    Dropout,
    /// The receiver's noise.
    Receiver,
    /// What glass returns.
    Glass,
    /// A drop, by its number on the beam.
    Rain(u32),
    /// A flake, by its number on the beam.
    Snow(u32),
    /// What a volume of dust returns, by the volume's number.
    Dust(u32),
}

impl Purpose {
    /// The most drops, and the most flakes, on a beam.
    pub const MOST_DROPS: u32 = 32;

    /// Its place in the counter. The shaders know those of noise and dropout.
    const fn number(self) -> u32 {
        match self {
            Self::Noise => 1,
            Self::Dropout => 2,
            Self::Receiver => 3,
            Self::Glass => 16,
            Self::Rain(drop) => 32 + drop,
            Self::Snow(flake) => 64 + flake,
            Self::Dust(volume) => 96 + volume,
        }
    }
}

/// Random bits of a beam for one purpose.
#[must_use]
pub fn random_bits(stream: StreamKey, beam: u32, purpose: Purpose) -> [u32; 4] {
    stream.words([beam, purpose.number(), 0, 0])
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
        let r = (-libm::log((f64::from(k) + 0.5) * PER_2_32)).sqrt() - 1.6;
        (((0.170_238_211_03 * r + 1.306_728_481_6) * r + 2.756_815_39) * r + 1.423_437_277_7)
            / ((0.120_211_329_75 * r + 0.737_001_642_5) * r + 1.0)
    };
    if bits >= 0x8000_0000 { -z } else { z }
}

#[cfg(test)]
mod tests {
    use super::*;
    use test_support::assert_uncorrelated;

    /// All that a beam can draw, with three volumes of dust.
    fn all() -> Vec<Purpose> {
        use Purpose::{Dropout, Dust, Glass, Noise, Rain, Receiver, Snow};
        let drops = |of: fn(u32) -> Purpose| (0..Purpose::MOST_DROPS).map(of);
        let mut all = vec![Noise, Dropout, Receiver, Glass];
        all.extend(drops(Rain).chain(drops(Snow)).chain((0..3).map(Dust)));
        all
    }

    #[test]
    fn purposes_and_words_have_no_bits_in_common() {
        let numbers: Vec<(String, Vec<f64>)> = all()
            .into_iter()
            .flat_map(|purpose| (0..4).map(move |word| (purpose, word)))
            .map(|(purpose, word)| {
                let bits = |beam| random_bits(StreamKey([7, 11]), beam, purpose)[word];
                let name = format!("{purpose:?}, word {word}");
                (name, (0..1000).map(|beam| f64::from(bits(beam)) - 2f64.powi(31)).collect())
            })
            .collect();
        for (i, (name, own)) in numbers.iter().enumerate() {
            for (other, others) in &numbers[i + 1..] {
                let pairs: Vec<[f64; 2]> = own.iter().zip(others).map(|(a, b)| [*a, *b]).collect();
                assert_uncorrelated(&format!("{name} and {other}"), &pairs);
            }
        }
    }
}
