//! Counter-based random numbers: Philox4x32-10 of Salmon et al., "Parallel
//! random numbers: as easy as 1, 2, 3", SC 2011.
//!
//! A number is a pure function of (key, counter) and therefore independent of batches, threads,
//! shards and the order of evaluation. The key names the stream, and the counter the number in it.

use sha2::{Digest, Sha256};
use std::fmt::{Arguments, Write};

const MULTIPLIER: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: usize = 10;

/// The key of a stream of random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct StreamKey(pub [u32; 2]);

impl StreamKey {
    /// The key of number `index` of the streams called `name` under `seed`. What the product draws
    /// is in the list of all [streams](crate::streams); tests and experiments name their own.
    ///
    /// It is the first eight bytes of SHA-256 over (seed, index, name), so that similar seeds and
    /// names have unrelated keys.
    #[must_use]
    pub fn new(seed: u64, name: &str, index: u32) -> Self {
        Self::named(seed, format_args!("{name}"), index)
    }

    /// As [`StreamKey::new`]. It allocates no memory, since samplers draw for each cloud.
    pub(crate) fn named(seed: u64, name: Arguments<'_>, index: u32) -> Self {
        let mut hash = Hashed(Sha256::new());
        hash.0.update(seed.to_le_bytes());
        hash.0.update(index.to_le_bytes());
        hash.write_fmt(name).expect("invariant: to write to a hash never fails");
        let digest = hash.0.finalize();
        let word =
            |i: usize| u32::from_le_bytes([digest[i], digest[i + 1], digest[i + 2], digest[i + 3]]);
        Self([word(0), word(4)])
    }

    /// The four words of this stream at `counter`.
    #[must_use]
    pub fn words(self, counter: [u32; 4]) -> [u32; 4] {
        philox4x32_10(counter, self.0)
    }

    /// The first 64 bits of the stream, as the seed of others.
    #[must_use]
    pub fn seed(self) -> u64 {
        let [low, high, ..] = self.words([0; 4]);
        u64::from(high) << 32 | u64::from(low)
    }

    /// An unbiased integer in `0..bound`, number `n` of the stream (Lemire
    /// 2019, rejection on the fourth counter word). `bound` must not be 0.
    #[must_use]
    pub fn below(self, bound: u64, n: u64) -> u64 {
        debug_assert!(bound > 0, "an empty range holds no number");
        for attempt in 0.. {
            let [low, high, ..] = self.words([n as u32, (n >> 32) as u32, attempt, 0]);
            let product = u128::from(u64::from(high) << 32 | u64::from(low)) * u128::from(bound);
            let threshold = bound.wrapping_neg() % bound;
            if product as u64 >= threshold {
                return (product >> 64) as u64;
            }
        }
        unreachable!("the attempts are not bounded")
    }

    /// A number in [0, 1) with 53 bits, number `n` of the stream.
    #[must_use]
    pub fn unit(self, n: u64) -> f64 {
        let [low, high, ..] = self.words([n as u32, (n >> 32) as u32, 0, 1]);
        let bits = (u64::from(high) << 32 | u64::from(low)) >> 11;
        bits as f64 * (1.0 / (1u64 << 53) as f64)
    }
}

/// A hash of what is written.
struct Hashed(Sha256);

impl Write for Hashed {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

/// Philox4x32 with ten rounds.
#[must_use]
pub fn philox4x32_10(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    for _ in 0..ROUNDS {
        let p0 = u64::from(MULTIPLIER[0]) * u64::from(counter[0]);
        let p1 = u64::from(MULTIPLIER[1]) * u64::from(counter[2]);
        counter = [
            (p1 >> 32) as u32 ^ counter[1] ^ key[0],
            p1 as u32,
            (p0 >> 32) as u32 ^ counter[3] ^ key[1],
            p0 as u32,
        ];
        key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known answers of Random123 1.09, `tests/kat_vectors`, philox4x32 10.
    #[test]
    fn philox_gives_the_known_answers() {
        assert_eq!(
            philox4x32_10([0; 4], [0; 2]),
            [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]
        );
        assert_eq!(
            philox4x32_10([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32_10(
                [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344],
                [0xa409_3822, 0x299f_31d0]
            ),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn a_bounded_number_stays_below_its_bound_and_covers_it() {
        let key = StreamKey::new(7, "cup_0001", 3);
        let mut seen = [0u32; 5];
        for n in 0..5000 {
            seen[key.below(5, n) as usize] += 1;
        }
        assert!(seen.iter().all(|&count| count > 800), "{seen:?}");
    }
}
