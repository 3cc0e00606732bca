//! The outlier filter, which drops stray returns beside an object.
//!
//! Farthest point sampling chooses outliers first, and normalisation by the largest radius shrinks
//! the other points. A point is an outlier if the distance of its 8th neighbour exceeds [`REACH`]
//! times the median of that distance over the cloud. (Rusu et al. 2008 compare mean distances with
//! their mean and deviation, which outliers raise; a median is robust until they are half of all
//! points.)
//!
//! All distances of 1,024 points would cost more than some networks. Therefore the median is taken
//! over [`QUERIES`] points; its sampling error of a twentieth is small beside [`REACH`]. For the
//! other points, the filter only tests whether 8 neighbours are within the limit, which takes few
//! comparisons. In clouds of more than [`REFERENCES`] points, it searches for neighbours among that
//! many points at even steps through the sorted cloud: the time then grows linearly with the number
//! of points.
//!
//! Repeated points count once, and the order of points does not matter.

use super::canonical::{CanonicalOrder, compare};

/// The rank of the neighbour whose distance is compared.
const NEIGHBOUR: usize = 8;

/// The ratio to the median beyond which a point is an outlier.
const REACH: f32 = 4.0;

/// The most points over which the median is taken.
const QUERIES: usize = 128;

/// The most points that are searched for neighbours.
const REFERENCES: usize = 4096;

/// Points whose distances are computed together.
const TILE: usize = 64;

/// Drops outliers, and reuses its memory for each cloud.
#[derive(Default)]
pub struct OutlierFilter {
    cloud: CanonicalOrder,
    references: References,
    distances: Vec<f32>,
    /// The outliers, in the order of `cloud`.
    outliers: Vec<[f32; 3]>,
    kept: Vec<u32>,
}

impl OutlierFilter {
    /// Finds the outliers of `points` and returns the number of distinct ones. Points must be
    /// finite and roughly in the unit sphere, so that no square overflows. Fewer than 9 distinct
    /// points have no 8th neighbour, and no outlier.
    pub fn find(&mut self, points: &[[f32; 3]]) -> usize {
        self.cloud.sort(points);
        self.outliers.clear();
        let cloud = &self.cloud.points;
        if cloud.len() <= NEIGHBOUR {
            return 0;
        }
        self.references.set(cloud);
        let references = &self.references;
        let (n, n_references) = (cloud.len(), references.len());
        self.distances.clear();
        let queries = evenly(n_references, QUERIES);
        self.distances.extend(queries.map(|i| references.squared_distance_of_neighbour(i)));
        let middle = self.distances.len() / 2;
        let (_, median, _) = self.distances.select_nth_unstable_by(middle, f32::total_cmp);
        // Both sides are squared, which saves square roots.
        let limit = REACH * REACH * *median;
        let is_alone = |i: &usize| {
            // The first reference that does not precede the point; it may be the point itself.
            let place = (i * n_references).div_ceil(n);
            let is_reference = place < n_references && place * n / n_references == *i;
            let wanted = NEIGHBOUR + usize::from(is_reference);
            !references.has_within(cloud[*i], place, limit, wanted)
        };
        self.outliers.extend((0..n).filter(is_alone).map(|i| cloud[i]));
        self.outliers.len()
    }

    /// Whether `point`, of the cloud of the last [`find`](Self::find), is an outlier.
    #[must_use]
    pub fn is_outlier(&self, point: &[f32; 3]) -> bool {
        self.outliers.binary_search_by(|outlier| compare(outlier, point)).is_ok()
    }

    /// Drops the outliers of `points`, whose coordinates in the unit sphere are `normalized`, and
    /// returns the number of dropped points.
    pub fn drop_outliers(&mut self, points: &mut Vec<[f64; 3]>, normalized: &[[f32; 3]]) -> usize {
        self.kept.clear();
        if self.find(normalized) == 0 {
            return 0;
        }
        // Moved out, because `is_outlier` borrows `self`.
        let mut kept = std::mem::take(&mut self.kept);
        let stays = |&i: &u32| !self.is_outlier(&normalized[i as usize]);
        kept.extend((0..normalized.len() as u32).filter(stays));
        let n_before = points.len();
        for (place, &i) in kept.iter().enumerate() {
            points[place] = points[i as usize];
        }
        points.truncate(kept.len());
        self.kept = kept;
        n_before - points.len()
    }

    /// Turns indices into the points that the last [`drop_outliers`](Self::drop_outliers) kept into
    /// indices into the cloud before.
    pub fn in_whole_cloud(&self, places: &mut [u32]) {
        if !self.kept.is_empty() {
            places.iter_mut().for_each(|place| *place = self.kept[*place as usize]);
        }
    }

    /// Allocates memory for clouds of `n` points.
    pub fn reserve(&mut self, n: usize) {
        let all: Vec<[f32; 3]> = (0..n).map(|i| [i as f32, 0.0, 0.0]).collect();
        self.cloud.sort(&all);
        self.references.set(&self.cloud.points);
        self.outliers.reserve(n);
        self.distances.reserve(QUERIES);
        self.kept.reserve(n);
    }
}

/// At most `most` of `n` indices, at even steps.
fn evenly(n: usize, most: usize) -> impl Iterator<Item = usize> {
    let taken = n.min(most);
    (0..taken).map(move |i| i * n / taken)
}

/// The points that are searched for neighbours, as one array per axis, ascending by x.
#[derive(Default)]
struct References {
    axes: [Vec<f32>; 3],
}

impl References {
    /// Copies at most [`REFERENCES`] of `sorted`, at even steps.
    fn set(&mut self, sorted: &[[f32; 3]]) {
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.clear();
            axis.extend(evenly(sorted.len(), REFERENCES).map(|i| sorted[i][k]));
        }
    }

    fn len(&self) -> usize {
        self.axes[0].len()
    }

    fn point(&self, i: usize) -> [f32; 3] {
        [0, 1, 2].map(|k| self.axes[k][i])
    }

    /// The squared distance of point `i` from its 8th neighbour.
    fn squared_distance_of_neighbour(&self, i: usize) -> f32 {
        // The point itself is the nearest.
        let mut nearest = [f32::INFINITY; NEIGHBOUR + 1];
        self.visit(self.point(i), i, |tile| {
            for &squared in tile {
                if squared < nearest[NEIGHBOUR] {
                    let place = nearest.partition_point(|other| *other <= squared);
                    nearest[place..].rotate_right(1);
                    nearest[place] = squared;
                }
            }
            nearest[NEIGHBOUR]
        });
        nearest[NEIGHBOUR]
    }

    /// Whether `n` points are within the squared distance `limit` of `p`, whose index among them is
    /// `place`.
    fn has_within(&self, p: [f32; 3], place: usize, limit: f32, n: usize) -> bool {
        let mut found = 0;
        self.visit(p, place, |tile| {
            found += tile.iter().map(|squared| usize::from(*squared <= limit)).sum::<usize>();
            if found < n { limit } else { NOTHING }
        });
        found >= n
    }

    /// Calls `see` with the squared distances of `p` from tiles of points: first the tile of
    /// `place`, then the nearest along x. `see` returns the squared distance up to which further
    /// points matter.
    fn visit(&self, p: [f32; 3], place: usize, mut see: impl FnMut(&[f32]) -> f32) {
        let [xs, ys, zs] = &self.axes;
        let first = place / TILE * TILE;
        let (mut low, mut high) = (first, first);
        let mut squared = [0.0; TILE];
        let mut reach = f32::INFINITY;
        while low > 0 || high < xs.len() {
            let below = if low > 0 { p[0] - xs[low - 1] } else { f32::INFINITY };
            let above = if high < xs.len() { xs[high] - p[0] } else { f32::INFINITY };
            let gap = below.min(above).max(0.0);
            // References ascend by x, so that all further ones are at least as far along x alone.
            if gap * gap > reach {
                return;
            }
            let tile =
                if above <= below { high..xs.len().min(high + TILE) } else { low - TILE..low };
            (low, high) = (low.min(tile.start), high.max(tile.end));
            let squared = &mut squared[..tile.len()];
            let (xs, ys, zs) = (&xs[tile.clone()], &ys[tile.clone()], &zs[tile]);
            for (i, squared) in squared.iter_mut().enumerate() {
                let (x, y, z) = (xs[i] - p[0], ys[i] - p[1], zs[i] - p[2]);
                *squared = x * x + y * y + z * z;
            }
            reach = see(squared);
        }
    }
}

/// The result of `see` that ends a visit.
const NOTHING: f32 = -1.0;

#[cfg(test)]
mod tests {
    use super::super::testing::{shuffled, uniform};
    use super::*;

    /// The definition, for clouds of distinct points that are small enough to be all queries and
    /// references.
    fn by_definition(cloud: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let eighth = |p: &[f32; 3]| {
            let squared = |q: &[f32; 3]| (0..3).map(|k| (q[k] - p[k]) * (q[k] - p[k])).sum::<f32>();
            let mut all: Vec<f32> = cloud.iter().filter(|q| *q != p).map(squared).collect();
            all.sort_by(f32::total_cmp);
            all[NEIGHBOUR - 1]
        };
        let mut all: Vec<f32> = cloud.iter().map(eighth).collect();
        all.sort_by(f32::total_cmp);
        let limit = 4.0 * 4.0 * all[cloud.len() / 2];
        cloud.iter().filter(|p| eighth(p) > limit).copied().collect()
    }

    fn outliers(cloud: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mut filter = OutlierFilter::default();
        let n = filter.find(cloud);
        let found: Vec<_> = cloud.iter().filter(|p| filter.is_outlier(p)).copied().collect();
        assert!(found.len() >= n);
        found
    }

    /// `n` points in a tenth of the unit cube, and `n_strays` points in a cube three times its
    /// size.
    fn object_among(n: usize, n_strays: usize, seed: u32) -> Vec<[f32; 3]> {
        let mut cloud: Vec<_> = uniform(n, seed).iter().map(|p| p.map(|x| 0.1 * x)).collect();
        cloud.extend(uniform(n_strays, seed + 1).iter().map(|p| p.map(|x| 3.0 * x)));
        cloud
    }

    #[test]
    fn outliers_are_those_of_the_definition() {
        for (n, n_strays, seed) in [(9, 0, 1), (9, 1, 2), (60, 3, 3), (120, 8, 4), (100, 0, 5)] {
            let cloud = object_among(n, n_strays, seed);
            assert_eq!(outliers(&cloud), by_definition(&cloud), "{n} and {n_strays}");
        }
    }

    /// In a lattice, the eighth neighbour is sqrt(2) steps away. That of a point at a distance d
    /// beside the middle of a square of one face is sqrt(d^2 + 2.5) away.
    #[test]
    fn an_outlier_is_more_than_four_times_as_far_from_its_neighbours_as_usual() {
        let steps = 0..10u8;
        let lattice: Vec<[f32; 3]> = steps
            .clone()
            .flat_map(|x| steps.clone().map(move |y| (x, y)))
            .flat_map(|(x, y)| steps.clone().map(move |z| [x, y, z].map(f32::from)))
            .collect();
        for (times, is_outlier) in [(3.5f32, false), (4.5, true)] {
            let distance = (2.0 * times * times - 2.5).sqrt();
            let mut cloud = lattice.clone();
            cloud.push([-distance, 4.5, 4.5]);
            assert_eq!(outliers(&cloud).len(), usize::from(is_outlier), "{times}");
        }
    }

    #[test]
    fn strays_go_and_the_object_stays_in_clouds_of_any_size() {
        for n in [200, 1024, 5000, 20_000] {
            let mut cloud = object_among(n, 0, 7);
            let strays = [[2.0, 0.0, 0.0], [-1.0, 2.0, 1.0], [0.0, 0.0, -3.0]];
            cloud.extend(strays);
            assert_eq!(outliers(&cloud), strays, "{n}");
        }
    }

    #[test]
    fn neither_order_nor_repetitions_count() {
        let cloud = object_among(300, 5, 9);
        let mut expected = outliers(&cloud);
        assert!(!expected.is_empty());
        let mut found = outliers(&shuffled(&cloud, 3));
        expected.sort_by(compare);
        found.sort_by(compare);
        assert_eq!(found, expected);
        // Ten times repeated, strays are still outliers, even if all other points are repeated,
        // too.
        let mut ten_times = outliers(&cloud.repeat(10));
        ten_times.sort_by(compare);
        ten_times.dedup();
        assert_eq!(ten_times, expected);
    }

    #[test]
    fn clouds_without_an_outlier_keep_all() {
        let line = |n: usize, step: f32| (0..n).map(move |i| [step * i as f32, 0.0, 0.0]);
        let clouds: Vec<(&str, Vec<[f32; 3]>)> = vec![
            ("nothing", vec![]),
            ("8 points, one far away", line(7, 0.01).chain([[1.0; 3]]).collect()),
            ("one point, often", vec![[0.5; 3]; 100]),
            // The neighbours of its ends are all on one side, and twice as far.
            ("a thin rod", line(200, 0.01).collect()),
            ("a sparse shape", uniform(20, 1)),
            ("a wall of one x", uniform(500, 2).iter().map(|p| [0.25, p[1], p[2]]).collect()),
            // All squared distances but one are 0 in f32.
            ("a speck", line(50, 1e-30).collect()),
        ];
        for (what, cloud) in clouds {
            assert_eq!(outliers(&cloud), [[0.0; 3]; 0], "{what}");
        }
    }

    #[test]
    fn what_is_left_knows_its_places_in_the_whole() {
        let mut cloud = object_among(100, 0, 3);
        cloud.insert(2, [3.0; 3]);
        let mut points: Vec<[f64; 3]> = cloud.iter().map(|p| p.map(f64::from)).collect();
        let mut filter = OutlierFilter::default();
        assert_eq!(filter.drop_outliers(&mut points, &cloud), 1);
        assert_eq!((points.len(), points[2]), (100, cloud[3].map(f64::from)));
        let mut places = [0, 1, 2, 99];
        filter.in_whole_cloud(&mut places);
        assert_eq!(places, [0, 1, 3, 100]);
        // The next cloud has no outliers, so that its indices do not change.
        assert_eq!(filter.drop_outliers(&mut points[..50].to_vec(), &cloud[3..53]), 0);
        filter.in_whole_cloud(&mut places);
        assert_eq!(places, [0, 1, 3, 100]);
    }
}
