//! A random subset of a cloud.

use std::mem;

use formats::rng::StreamKey;

use super::hash::{Map, reset};

/// Draws subsets without replacement.
#[derive(Default)]
pub struct RandomSubset {
    moved: Map<u32>,
}

impl RandomSubset {
    /// Writes `m` random indices below `n` to `out`, drawn by `key`; all subsets are equally
    /// likely. They are in the order of drawing, so that any first part of the result is a fair
    /// sample, too. If `n` is at most `m`, all indices are kept, ascending.
    ///
    /// [`formats::cloud::resample`] chooses the same points under the same key. Time and memory
    /// grow with `m` alone.
    pub fn draw(&mut self, n: usize, m: usize, key: StreamKey, out: &mut Vec<u32>) {
        out.clear();
        if n <= m {
            out.extend(0..n as u32);
            return;
        }
        // The first m steps of a Fisher-Yates shuffle, which stores only the swapped positions.
        reset(&mut self.moved, m);
        for i in 0..m as u32 {
            let j = i + key.below((n - i as usize) as u64, u64::from(i)) as u32;
            let at_i = self.moved.get(&i).copied().unwrap_or(i);
            out.push(mem::replace(self.moved.entry(j).or_insert(j), at_i));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::cloud::resample;
    use proptest::prelude::*;

    fn draw(n: usize, m: usize, key: StreamKey) -> Vec<u32> {
        let mut out = vec![];
        RandomSubset::default().draw(n, m, key, &mut out);
        out
    }

    fn key(index: u32) -> StreamKey {
        StreamKey::new(5, "chair_0001", index)
    }

    /// Each of 20 points is in 5 of 20 places with probability 1/4: over 40,000 draws the count has
    /// mean 10,000 and sigma sqrt(40000 * 1/4 * 3/4) = 87. Six sigma are 520; a fair draw fails
    /// once in 10 million runs, and this one is seeded.
    #[test]
    fn each_point_is_drawn_equally_often() {
        let mut subset = RandomSubset::default();
        let mut drawn = vec![];
        let mut count = [0i32; 20];
        let mut first = [0i32; 20];
        for i in 0..40_000 {
            subset.draw(20, 5, key(i), &mut drawn);
            first[drawn[0] as usize] += 1;
            drawn.iter().for_each(|&point| count[point as usize] += 1);
        }
        assert!(count.iter().all(|c| (c - 10_000).abs() < 520), "{count:?}");
        // Mean 2,000, sigma sqrt(40000 * 1/20 * 19/20) = 44.
        assert!(first.iter().all(|c| (c - 2_000).abs() < 264), "{first:?}");
    }

    #[test]
    fn few_of_very_many_points_are_drawn_at_once() {
        let n = u32::MAX as usize;
        let mut drawn = draw(n, 1000, key(0));
        drawn.sort_unstable();
        drawn.dedup();
        assert_eq!(drawn.len(), 1000);
        // The mean of 1000 uniform draws has sigma n / sqrt(12 * 1000); six sigma are 0.055 n.
        let mean = drawn.iter().map(|&i| f64::from(i)).sum::<f64>() / 1000.0;
        assert!((mean / n as f64 - 0.5).abs() < 0.055, "{mean}");
    }

    #[test]
    fn a_small_cloud_is_kept_whole() {
        assert!(draw(0, 3, key(0)).is_empty());
        assert_eq!(draw(1, 3, key(0)), [0]);
        assert_eq!(draw(3, 3, key(0)), [0, 1, 2]);
    }

    proptest! {
        #[test]
        fn it_is_the_choice_of_datasets(n in 1usize..300, seed in any::<u32>()) {
            let points: Vec<_> = (0..n).map(|i| [i as f32, 0.0, 0.0]).collect();
            for m in [0, 1, n / 2, n - 1] {
                let twin = resample(&points, m, key(seed)).unwrap();
                let twin: Vec<_> = twin.iter().map(|point| point[0] as u32).collect();
                prop_assert_eq!(draw(n, m, key(seed)), twin);
            }
        }
    }
}
