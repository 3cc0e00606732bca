//! Clouds of one size and one scale, as networks take them.
//!
//! Resample a scan before normalising it, so that the resulting cloud fills the unit sphere
//! exactly.

use std::collections::HashMap;

use crate::rng::StreamKey;

/// Moves the mean of `points` to 0 and scales the largest radius to 1.
///
/// It computes in f64 and sums in the order of the points, so that the same points give the same
/// bits. Points that all coincide are moved to 0. If one point is not finite, none of the results
/// is.
pub fn normalize_unit_sphere(points: &mut [[f32; 3]]) {
    if points.is_empty() {
        return;
    }
    let n = points.len() as f64;
    let mut mean = [0.0f64; 3];
    for point in points.iter() {
        for axis in 0..3 {
            mean[axis] += f64::from(point[axis]);
        }
    }
    let mean = mean.map(|sum| sum / n);
    let from_mean = |point: &[f32; 3]| [0, 1, 2].map(|axis| f64::from(point[axis]) - mean[axis]);
    let radius_squared = points
        .iter()
        .map(|point| from_mean(point).iter().map(|x| x * x).sum::<f64>())
        .fold(0.0, f64::max);
    let all_equal = points.iter().all(|point| point == &points[0]);
    let scale = if all_equal { 0.0 } else { 1.0 / radius_squared.sqrt() };
    for point in points {
        *point = from_mean(point).map(|x| (x * scale) as f32);
    }
}

/// Draws `n` of `points`.
///
/// From more than `n` points it draws a uniformly distributed subset in random order, so that
/// every prefix of the result is a fair sample as well. It keeps up to `n` points in their order
/// and appends uniformly drawn repetitions. It returns `None` if there are no points and `n` is not
/// 0.
#[must_use]
pub fn resample<T: Copy>(points: &[T], n: usize, key: StreamKey) -> Option<Vec<T>> {
    if points.len() > n {
        let drawn = draw_without_replacement(points.len(), n, key);
        return Some(drawn.into_iter().map(|i| points[i]).collect());
    }
    if points.is_empty() && n > 0 {
        return None;
    }
    let mut cloud = points.to_vec();
    cloud.extend(
        (points.len()..n).map(|i| points[key.below(points.len() as u64, i as u64) as usize]),
    );
    Some(cloud)
}

/// The first `n` of `len` indices in a Fisher-Yates shuffle. It stores only the indices that were
/// swapped, at most `n`. It is no generic function, so that this crate compiles it, optimized.
fn draw_without_replacement(len: usize, n: usize, key: StreamKey) -> Vec<usize> {
    let mut moved = HashMap::with_capacity(n);
    (0..n)
        .map(|i| {
            let j = i + key.below((len - i) as u64, i as u64) as usize;
            let at_i = moved.get(&i).copied().unwrap_or(i);
            moved.insert(j, at_i).unwrap_or(j)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn numbered(n: usize) -> Vec<[f32; 3]> {
        (0..n).map(|i| [i as f32, 0.0, 0.0]).collect()
    }

    fn key(index: u32) -> StreamKey {
        StreamKey::new(5, "chair_0001", index)
    }

    /// Each of 20 points is in 5 of 20 places with probability 1/4: over
    /// 40,000 draws the count has mean 10,000 and sigma sqrt(40000 * 1/4 *
    /// 3/4) = 87. Six sigma are 520; a fair draw fails once in 10 million runs,
    /// and this one is seeded.
    #[test]
    fn a_smaller_cloud_holds_each_point_equally_often() {
        let points = numbered(20);
        let mut count = [0i32; 20];
        let mut first = [0i32; 20];
        for draw in 0..40_000 {
            let cloud = resample(&points, 5, key(draw)).unwrap();
            first[cloud[0][0] as usize] += 1;
            for point in cloud {
                count[point[0] as usize] += 1;
            }
        }
        assert!(count.iter().all(|c| (c - 10_000).abs() < 520), "{count:?}");
        // Mean 2,000, sigma sqrt(40000 * 1/20 * 19/20) = 44.
        assert!(first.iter().all(|c| (c - 2_000).abs() < 264), "{first:?}");
    }

    #[test]
    fn a_larger_cloud_keeps_every_point_and_repeats_some() {
        let points = numbered(3);
        let cloud = resample(&points, 3000, key(0)).unwrap();
        assert_eq!(cloud[..3], points);
        // Mean 999, sigma sqrt(2997 * 1/3 * 2/3) = 26; six sigma are 155.
        for point in &points {
            let repeated = cloud[3..].iter().filter(|p| *p == point).count() as i32;
            assert!((repeated - 999).abs() < 155, "{repeated}");
        }
    }

    #[test]
    fn nothing_cannot_be_repeated() {
        assert_eq!(resample::<[f32; 3]>(&[], 4, key(0)), None);
        assert_eq!(resample::<[f32; 3]>(&[], 0, key(0)), Some(vec![]));
        assert_eq!(resample(&numbered(3), 0, key(0)), Some(vec![]));
    }

    #[test]
    fn coinciding_points_go_to_the_middle() {
        let mut points = vec![[0.1, 0.2, 0.3]; 7];
        normalize_unit_sphere(&mut points);
        assert_eq!(points, vec![[0.0; 3]; 7]);
        normalize_unit_sphere(&mut []);
    }

    proptest! {
        #[test]
        fn a_draw_never_takes_a_point_twice(len in 1usize..200, seed in any::<u32>()) {
            let n = len / 2;
            let mut drawn: Vec<_> = resample(&numbered(len), n, key(seed))
                .unwrap()
                .iter()
                .map(|p| p[0] as usize)
                .collect();
            drawn.sort_unstable();
            drawn.dedup();
            prop_assert_eq!(drawn.len(), n);
        }

        /// f64 holds the sums of these f32 to 1e-14 relative; what remains is
        /// the rounding of each coordinate to f32, 6e-8, so that radius and
        /// mean are off by at most sqrt(3) * 6e-8.
        #[test]
        fn a_normalised_cloud_fills_the_unit_sphere(
            mut points in prop::collection::vec(prop::array::uniform3(-1e9f32..1e9), 2..50),
        ) {
            points.push([0.0, 0.0, 2e9]);
            normalize_unit_sphere(&mut points);
            let wide = points.iter().map(|p| p.map(f64::from));
            let radius = wide.clone().map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt());
            prop_assert!((radius.fold(0.0, f64::max) - 1.0).abs() < 1.1e-7);
            for axis in 0..3 {
                let mean = wide.clone().map(|p| p[axis]).sum::<f64>() / points.len() as f64;
                prop_assert!(mean.abs() < 6e-8);
            }
        }
    }
}
