//! A hash map with a fixed hash function, which is fast relative to memory accesses.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Maps keys to numbers.
pub type Map<K> = HashMap<K, u32, BuildHasherDefault<Fold>>;

/// Clears `map` and allocates memory for `n` keys.
pub fn reset<K: Eq + std::hash::Hash>(map: &mut Map<K>, n: usize) {
    map.clear();
    map.reserve(n);
}

/// Multiplies words and folds the halves of each product, so that every bit of a key affects every
/// bit of the hash.
#[derive(Default)]
pub struct Fold(u64);

impl Hasher for Fold {
    #[inline]
    fn write(&mut self, bytes: &[u8]) {
        for part in bytes.chunks(size_of::<u64>()) {
            let mut word = [0; size_of::<u64>()];
            word[..part.len()].copy_from_slice(part);
            // 2^64 over the golden ratio (Knuth, TAOCP 3, §6.4).
            let product = u128::from(self.0 ^ u64::from_le_bytes(word)) * 0x9E37_79B9_7F4A_7C15;
            self.0 = (product >> 64) as u64 ^ product as u64;
        }
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
