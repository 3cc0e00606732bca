//! Farthest point sampling: each chosen point is the one farthest from all points chosen before.

use edgepuck_kernels::{Kernels, Soa};

use super::FpsStart;
use super::canonical::compare;

/// Samples clouds, and reuses its memory for each.
#[derive(Default)]
pub struct FarthestPoints {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
    /// The squared distance of each point to the nearest chosen one.
    distance: Vec<f32>,
}

impl FarthestPoints {
    /// Writes the indices of up to `m` points to `out`, in the order of choice.
    ///
    /// The sampling is exact: every comparison includes all points. Distances are squared, in f32.
    /// Coordinates are scaled by a power of two so that the largest is between 1/2 and 1: this
    /// keeps the order and prevents overflow. A point at distance 0 from the chosen ones is a
    /// duplicate and never chosen, so that a cloud of fewer than `m` distinct points yields each of
    /// them once. (Points closer than 2⁻⁷⁵ of the largest coordinate are at distance 0 as well,
    /// because f32 cannot hold the square.)
    ///
    /// With [`FpsStart::First`], the lowest index wins a tie, as in NumPy. With
    /// [`FpsStart::Farthest`], the least point by x, y, z wins, and the chosen points are the same
    /// for any order of the input. The first of equal points is chosen.
    pub fn select(
        &mut self,
        points: &[[f32; 3]],
        m: usize,
        start: FpsStart,
        kernels: &Kernels,
        out: &mut Vec<u32>,
    ) {
        out.clear();
        if points.is_empty() || m == 0 {
            return;
        }
        self.load(points);
        let mut pick = match start {
            FpsStart::First => 0,
            FpsStart::Farthest => {
                let farthest = self.step(self.centroid(), kernels);
                let pick = self.least_as_far(farthest, points);
                // The centroid is not a chosen point: its distances must not count.
                self.distance.fill(f32::INFINITY);
                pick
            }
        };
        out.push(pick as u32);
        while out.len() < m {
            pick = self.step([self.x[pick], self.y[pick], self.z[pick]], kernels);
            // All remaining points are duplicates of chosen ones.
            if self.distance[pick] == 0.0 {
                break;
            }
            // Kernels return the first of equal maxima, which depends on the order of the input.
            if start == FpsStart::Farthest {
                pick = self.least_as_far(pick, points);
            }
            out.push(pick as u32);
        }
    }

    /// Scales the coordinates and resets all distances.
    fn load(&mut self, points: &[[f32; 3]]) {
        let largest = points.as_flattened().iter().fold(0.0f32, |max, x| max.max(x.abs()));
        // A power of two scales exactly, so that ties stay ties.
        let scale = power_that_halves(largest);
        for (axis, column) in [&mut self.x, &mut self.y, &mut self.z].into_iter().enumerate() {
            column.clear();
            column.extend(points.iter().map(|point| point[axis] * scale));
        }
        self.distance.clear();
        self.distance.resize(points.len(), f32::INFINITY);
    }

    /// Lowers the distances to those from `pick`, and returns the first of the farthest points.
    fn step(&mut self, pick: [f32; 3], kernels: &Kernels) -> usize {
        let cloud = Soa { x: &self.x, y: &self.y, z: &self.z };
        (kernels.fps_step)(cloud, pick, &mut self.distance)
    }

    /// The least of the points that are as far as `farthest`, which is the first of them.
    fn least_as_far(&self, farthest: usize, points: &[[f32; 3]]) -> usize {
        /// Few enough points to search one by one after a tie, which is rare.
        const CHUNK: usize = 64;
        let largest = self.distance[farthest];
        let mut least = farthest;
        let mut first = farthest + 1;
        for chunk in self.distance[first..].chunks(CHUNK) {
            // The fold has no branch, so that the compiler vectorises it.
            if chunk.iter().fold(false, |any, &distance| any | (distance == largest)) {
                for i in first..first + chunk.len() {
                    if self.distance[i] == largest && compare(&points[i], &points[least]).is_lt() {
                        least = i;
                    }
                }
            }
            first += chunk.len();
        }
        least
    }

    /// The mean of the points. The sum is exact, so that the order does not matter.
    fn centroid(&self) -> [f32; 3] {
        let n = self.x.len();
        // Coordinates are at most 1, so n of them in units of 2^-bits sum to at most 2^62.
        let bits = 50.min(62 - n.next_power_of_two().ilog2());
        // In f64, the last place of numbers near this one is that unit: adding it rounds the
        // coordinate to the unit and leaves it in the low bits.
        let rounder = 1.5 * (1u64 << (52 - bits)) as f64;
        let unit = 1.0 / (1u64 << bits) as f64;
        [&self.x, &self.y, &self.z].map(|column| {
            let units = |x: f32| (f64::from(x) + rounder).to_bits().wrapping_sub(rounder.to_bits());
            let sum = column.iter().fold(0u64, |sum, &x| sum.wrapping_add(units(x)));
            (sum as i64 as f64 * unit / n as f64) as f32
        })
    }
}

/// The power of two that scales `largest` to between 1/2 and 1; for subnormal numbers, that of the
/// least normal one.
fn power_that_halves(largest: f32) -> f32 {
    let exponent = u64::from(largest.to_bits() >> 23);
    // Both formats' exponents are biased, by 127 and 1023.
    f64::from_bits((1023 + 126 - exponent) << 52) as f32
}

#[cfg(test)]
mod tests {
    use test_support::need;

    use super::super::testing::{any_cloud, extremes, gather, shared_array, shuffled, uniform};
    use super::*;
    use edgepuck_kernels::{KernelName, available};
    use proptest::prelude::*;

    fn select(points: &[[f32; 3]], m: usize, start: FpsStart) -> Vec<u32> {
        let kernels = KernelName::Scalar.kernels().unwrap();
        let mut out = vec![];
        FarthestPoints::default().select(points, m, start, kernels, &mut out);
        out
    }

    /// The reference indices come from NumPy with squared distances in f32, for half of
    /// ModelNet40's test clouds, from index 0.
    #[test]
    fn indices_are_those_of_numpy() {
        const N: usize = 1024;
        const M: usize = 64;
        let clouds = need!(shared_array("modelnet40-clouds/dev.npz", "<i2"));
        let expected = need!(shared_array("reference/3dcertify_64p/fps64_idx.npy", "<u2"));
        let expected = expected.as_chunks::<2>().0;
        assert_eq!(expected.len(), 1234 * M);

        let coordinate = |&bytes: &[u8; 2]| f32::from(i16::from_le_bytes(bytes)) / 32767.0;
        let coordinates: Vec<f32> = clouds.as_chunks().0.iter().map(coordinate).collect();
        let points = coordinates.as_chunks::<3>().0;
        let mut sampler = FarthestPoints::default();
        let mut found = vec![];
        for kernels in available() {
            for (cloud, expected) in points.chunks(N).zip(expected.chunks(M)) {
                sampler.select(cloud, M, FpsStart::First, kernels, &mut found);
                let expected = expected.iter().map(|&bytes| u32::from(u16::from_le_bytes(bytes)));
                assert!(found.iter().copied().eq(expected), "{}", kernels.name);
            }
        }
    }

    #[test]
    fn the_corners_of_a_square_come_before_its_middle() {
        let cloud = [[0.5, 0.5, 0.0], [0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        // All corners are equally far from the centroid: the least by x, then y, comes first.
        assert_eq!(select(&cloud, 5, FpsStart::Farthest), [1, 4, 3, 2, 0]);
        // They are equally far from the middle, too: the lowest index comes first.
        assert_eq!(select(&cloud, 5, FpsStart::First), [0, 1, 2, 3, 4]);
    }

    #[test]
    fn distinct_points_are_taken_once_whatever_their_magnitude() {
        for (what, cloud, n_distinct) in extremes() {
            for start in [FpsStart::First, FpsStart::Farthest] {
                let taken = select(&cloud, 1000, start);
                assert_eq!(taken.len(), n_distinct, "{what}, {start}");
                assert!(select(&cloud, 2, start).iter().eq(taken.iter().take(2)), "{what}");
            }
        }
    }

    #[test]
    fn an_outlier_is_taken_first() {
        let cloud = [uniform(99, 1), vec![[1e9, 0.0, 0.0]]].concat();
        assert_eq!(select(&cloud, 1, FpsStart::Farthest), [99]);
    }

    #[test]
    fn scale_does_not_matter() {
        let cloud = uniform(200, 3);
        let taken = select(&cloud, 50, FpsStart::Farthest);
        for exponent in [-100, -60, 60, 126] {
            let scale = 2f32.powi(exponent);
            let scaled: Vec<_> = cloud.iter().map(|point| point.map(|x| x * scale)).collect();
            assert_eq!(select(&scaled, 50, FpsStart::Farthest), taken, "2^{exponent}");
        }
    }

    proptest! {
        #[test]
        fn each_point_is_a_farthest_one(cloud in any_cloud()) {
            let taken = select(&cloud, 10, FpsStart::First);
            // A power of two, so that the products below are those of f32.
            let largest = cloud.as_flattened().iter().fold(0.0f32, |max, x| max.max(x.abs()));
            let scale = power_that_halves(largest);
            let scaled: Vec<_> = cloud.iter().map(|point| point.map(|x| x * scale)).collect();
            for i in 1..taken.len() {
                let to_taken = |point: &[f32; 3]| {
                    let squares = taken[..i].iter().map(|&other| {
                        let other = scaled[other as usize];
                        let [dx, dy, dz] = [0, 1, 2].map(|axis| point[axis] - other[axis]);
                        (dx * dx + dy * dy) + dz * dz
                    });
                    squares.fold(f32::INFINITY, f32::min)
                };
                let farthest = scaled.iter().map(to_taken).fold(0.0, f32::max);
                prop_assert_eq!(to_taken(&scaled[taken[i] as usize]), farthest);
            }
        }

        #[test]
        fn the_order_of_the_input_does_not_matter(cloud in any_cloud(), seed in any::<u32>()) {
            let shuffled = shuffled(&cloud, seed);
            let straight = select(&cloud, 20, FpsStart::Farthest);
            let permuted = select(&shuffled, 20, FpsStart::Farthest);
            prop_assert_eq!(gather(&cloud, &straight), gather(&shuffled, &permuted));
        }
    }
}
