//! A map from indices to numbers that is emptied in the time of its use and
//! keeps its memory.

/// No key: clouds have at most `u32::MAX` points, so their indices are below.
const EMPTY: u32 = u32::MAX;

/// Open addressing with linear probing, at most half full.
#[derive(Default)]
pub(super) struct IndexMap {
    /// (key, value); only the first `1 << bits` are in use.
    slots: Vec<(u32, u32)>,
    bits: u32,
}

impl IndexMap {
    /// Empties the map and makes room for `n_keys` keys.
    pub fn reset(&mut self, n_keys: usize) {
        self.bits = (2 * n_keys).max(2).next_power_of_two().ilog2();
        let n_slots = 1 << self.bits;
        if self.slots.len() < n_slots {
            self.slots.resize(n_slots, (EMPTY, 0));
        }
        self.slots[..n_slots].fill((EMPTY, 0));
    }

    /// The value of `key`, if it has one.
    pub fn get(&self, key: u32) -> Option<u32> {
        let (found, value) = self.slots[self.place(key)];
        (found == key).then_some(value)
    }

    /// The value of `key`, which becomes `default` if it has none. Keys beyond
    /// those that there is room for are a caller's error.
    pub fn value(&mut self, key: u32, default: u32) -> &mut u32 {
        let place = self.place(key);
        let slot = &mut self.slots[place];
        if slot.0 == EMPTY {
            *slot = (key, default);
        }
        &mut slot.1
    }

    /// Where `key` is or would be.
    fn place(&self, key: u32) -> usize {
        let last = (1 << self.bits) - 1;
        // 2^64 over the golden ratio (Knuth, TAOCP 3, §6.4); the top bits.
        let hash = u64::from(key).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut place = (hash >> (u64::BITS - self.bits)) as usize;
        while self.slots[place].0 != key && self.slots[place].0 != EMPTY {
            place = (place + 1) & last;
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    proptest! {
        #[test]
        fn it_holds_what_a_hash_map_holds(
            rounds in prop::collection::vec(prop::collection::vec((0u32..50, any::<u32>()), 0..80), 1..4)
        ) {
            let mut map = IndexMap::default();
            for entries in rounds {
                map.reset(entries.len());
                let mut twin = HashMap::new();
                for (key, value) in entries {
                    prop_assert_eq!(
                        *map.value(key, value),
                        *twin.entry(key).or_insert(value)
                    );
                    *map.value(key, 0) = value;
                    twin.insert(key, value);
                }
                for key in 0..50 {
                    prop_assert_eq!(map.get(key), twin.get(&key).copied());
                }
            }
        }
    }

    #[test]
    fn an_empty_map_has_no_value() {
        let mut map = IndexMap::default();
        map.reset(0);
        assert_eq!(map.get(0), None);
        assert_eq!(*map.value(u32::MAX - 1, 3), 3);
        assert_eq!(map.get(u32::MAX - 1), Some(3));
    }
}
