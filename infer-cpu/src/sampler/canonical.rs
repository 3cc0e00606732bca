//! The distinct points of a cloud, in an order that depends on geometry alone.
//!
//! An algorithm that processes points in this order, and breaks ties by row in a fixed way, does
//! not depend on the order of the input.

use std::cmp::Ordering;

/// Sorts clouds, and reuses its memory for each.
#[derive(Default)]
pub struct CanonicalOrder {
    /// The distinct points, ascending by x, then y, then z. Zeros are positive.
    pub points: Vec<[f32; 3]>,
    /// The lowest input index of each point.
    pub index: Vec<u32>,
    /// A coordinate in the upper half, an index of the input in the lower.
    keys: Vec<u64>,
}

impl CanonicalOrder {
    /// Fills `points` and `index` from a cloud of at most `u32::MAX` points. Points are equal if
    /// their coordinates are; -0 equals 0. NaN is larger than all numbers in magnitude, and not
    /// equal to anything.
    pub fn sort(&mut self, cloud: &[[f32; 3]]) {
        self.keys.clear();
        // A key holds a coordinate and an index in one word, which sorts faster than a pair.
        self.keys.extend((0..cloud.len() as u32).map(u64::from));
        sort_by_geometry(&mut self.keys, cloud);

        self.points.clear();
        self.index.clear();
        for &key in &self.keys {
            let point = cloud[key as u32 as usize];
            // Equal points are adjacent, with the lowest index first. NaN is not equal to itself.
            if self.points.last() != Some(&point) {
                self.points.push(point.map(without_sign_of_zero));
                self.index.push(key as u32);
            }
        }
    }
}

/// Sorts the indices in the lower halves of `keys` by their points (x, then y, then z), then by
/// index. Overwrites the upper halves.
pub(super) fn sort_by_geometry(keys: &mut [u64], cloud: &[[f32; 3]]) {
    sort_from_axis(keys, cloud, 0);
}

/// Sorts the indices in the lower halves of `keys` by the coordinates of their points from `axis`
/// on, then by index.
fn sort_from_axis(keys: &mut [u64], cloud: &[[f32; 3]], axis: usize) {
    for key in keys.iter_mut() {
        let index = *key as u32;
        *key = u64::from(rank(cloud[index as usize][axis])) << 32 | u64::from(index);
    }
    // Keys contain the index, so they are distinct, and an unstable sort is deterministic.
    keys.sort_unstable();
    if axis == 2 {
        return;
    }
    for ties in keys.chunk_by_mut(|a, b| a >> 32 == b >> 32) {
        // Few points share a coordinate, so that the other axes are rarely compared.
        if ties.len() > 1 {
            sort_from_axis(ties, cloud, axis + 1);
        }
    }
}

/// The order of points by x, then y, then z, with -0 equal to 0.
pub(super) fn compare(a: &[f32; 3], b: &[f32; 3]) -> Ordering {
    a.map(rank).cmp(&b.map(rank))
}

/// An integer with the same order as the number.
fn rank(value: f32) -> u32 {
    const SIGN: u32 = 1 << 31;
    let bits = without_sign_of_zero(value).to_bits();
    // Setting the sign of positive numbers and inverting negative ones gives the order of integers.
    if bits & SIGN == 0 { bits | SIGN } else { !bits }
}

fn without_sign_of_zero(value: f32) -> f32 {
    value + 0.0
}

#[cfg(test)]
mod tests {
    use super::super::testing::{any_cloud, shuffled};
    use super::*;
    use proptest::prelude::*;

    fn canonical(cloud: &[[f32; 3]]) -> CanonicalOrder {
        let mut order = CanonicalOrder::default();
        order.sort(cloud);
        order
    }

    #[test]
    fn points_ascend_and_duplicates_keep_the_lowest_index() {
        let cloud = [[2.0, 0.0, 0.0], [1.0, 5.0, -1.0], [2.0, -0.0, 0.0], [1.0, 5.0, -2.0]];
        let order = canonical(&cloud);
        assert_eq!(order.points, [[1.0, 5.0, -2.0], [1.0, 5.0, -1.0], [2.0, 0.0, 0.0]]);
        assert_eq!(order.index, [3, 1, 0]);
    }

    #[test]
    fn a_zero_has_no_sign_whichever_comes_first() {
        for cloud in [[[-0.0; 3], [0.0; 3]], [[0.0; 3], [-0.0; 3]]] {
            let order = canonical(&cloud);
            assert_eq!(order.points[0].map(f32::to_bits), [0, 0, 0]);
            assert_eq!(order.index, [0]);
        }
    }

    #[test]
    fn extremes_are_sorted_like_other_numbers() {
        assert!(canonical(&[]).points.is_empty());
        assert_eq!(canonical(&[[7.0; 3]]).index, [0]);
        assert_eq!(canonical(&[[7.0; 3]; 1000]).index, [0]);
        let cloud = [[1e30; 3], [-1e-30; 3], [f32::MIN_POSITIVE / 4.0; 3], [1e-30; 3], [-1e30; 3]];
        assert_eq!(canonical(&cloud).index, [4, 1, 2, 3, 0]);
    }

    #[test]
    fn memory_is_kept_from_cloud_to_cloud() {
        let mut order = canonical(&[[1.0; 3], [0.0; 3], [1.0; 3]]);
        order.sort(&[[4.0; 3]]);
        assert_eq!((order.points, order.index), (vec![[4.0; 3]], vec![0]));
    }

    proptest! {
        #[test]
        fn the_order_of_the_input_does_not_matter(cloud in any_cloud(), seed in any::<u32>()) {
            let straight = canonical(&cloud);
            let shuffled = shuffled(&cloud, seed);
            let permuted = canonical(&shuffled);
            prop_assert_eq!(&straight.points, &permuted.points);
            for (point, &index) in permuted.points.iter().zip(&permuted.index) {
                let first = shuffled.iter().position(|other| other == point);
                prop_assert_eq!(first, Some(index as usize));
            }
        }

        #[test]
        fn it_is_the_order_of_a_plain_sort(cloud in any_cloud()) {
            let mut plain = cloud.clone();
            plain.sort_by(|a, b| a.partial_cmp(b).unwrap());
            plain.dedup();
            prop_assert_eq!(canonical(&cloud).points, plain);
        }
    }
}
