use crate::height_grid::HeightGrid;
use crate::label::Label;
use crate::sets::Sets;
use crate::settings::Settings;

/// Points of a sweep that belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cluster<'a> {
    /// Indices of the points in the sweep, ascending.
    pub points: &'a [u32],
    /// Height of the ground under the middle of the points' bounding box, in metres in the sensor's
    /// frame; `None` where it is unknown.
    pub ground_z_m: Option<f32>,
}

/// A sweep, segmented into ground and clusters.
#[derive(Default)]
pub struct Segmentation {
    pub(crate) labels: Vec<Label>,
    pub(crate) ground: HeightGrid,
    /// The points of all clusters, one cluster after the other.
    members: Vec<u32>,
    /// For each cluster, the end of its members and the height of its ground.
    ends: Vec<(u32, Option<f32>)>,
    /// For each point that is the first of its set, the index of the set in `extents`.
    components: Vec<u32>,
    /// The extent of each set, and its cluster if it is one.
    extents: Vec<(Extent, Option<u32>)>,
}

impl Segmentation {
    /// One label for each point of the sweep.
    #[must_use]
    pub fn labels(&self) -> &[Label] {
        &self.labels
    }

    /// The clusters, in the order of their first points.
    pub fn clusters(&self) -> impl ExactSizeIterator<Item = Cluster<'_>> {
        (0..self.ends.len()).map(|number| {
            let start = number.checked_sub(1).map_or(0, |before| self.ends[before].0);
            let (end, ground_z_m) = self.ends[number];
            Cluster { points: &self.members[start as usize..end as usize], ground_z_m }
        })
    }

    /// Height of the ground at `(x, y)`, all in metres in the sensor's frame; `None` where too
    /// little ground was seen nearby.
    #[must_use]
    pub fn ground_z_m(&self, x: f32, y: f32) -> Option<f32> {
        self.ground.z_m(x, y)
    }

    /// Makes each of `objects` a cluster, before those that are there. These stay clusters if they keep half of
    /// their points and `min_points`: a few points about an object are no other one.
    pub(crate) fn claim<'a>(
        &mut self,
        objects: impl Iterator<Item = (&'a [u32], Option<f32>)>,
        min_points: usize,
    ) {
        let (members, ends) = (std::mem::take(&mut self.members), std::mem::take(&mut self.ends));
        let mut is_claimed = vec![false; self.labels.len()];
        for (points, ground_z_m) in objects {
            self.push(points, ground_z_m);
            points.iter().for_each(|&point| is_claimed[point as usize] = true);
        }
        let mut start = 0;
        for (end, ground_z_m) in ends {
            let left = members[start..end as usize].iter().copied();
            let left: Vec<u32> = left.filter(|&point| !is_claimed[point as usize]).collect();
            match left.len() >= min_points && 2 * left.len() >= end as usize - start {
                true => self.push(&left, ground_z_m),
                false => left.iter().for_each(|&point| self.labels[point as usize] = Label::Small),
            }
            start = end as usize;
        }
    }

    /// Adds a cluster of these points, above ground of this height.
    pub(crate) fn push(&mut self, points: &[u32], ground_z_m: Option<f32>) {
        let number = self.ends.len() as u32;
        let start = self.members.len();
        self.members.extend_from_slice(points);
        self.members[start..].sort_unstable();
        points.iter().for_each(|&point| self.labels[point as usize] = Label::Cluster(number));
        self.ends.push((self.members.len() as u32, ground_z_m));
    }

    /// Turns the sets of obstacles that are neither too small nor too large into clusters.
    pub(crate) fn collect(&mut self, points: &[[f32; 3]], sets: &mut Sets, settings: &Settings) {
        self.measure(points, sets);
        self.ends.clear();
        let mut n_members = 0;
        for (extent, number) in &mut self.extents {
            let is_cluster = extent.is_cluster(settings);
            *number = is_cluster.then_some(self.ends.len() as u32);
            if is_cluster {
                // The end begins at the cluster's start and advances with each member below.
                let [x, y] = extent.middle();
                self.ends.push((n_members, self.ground.z_m(x, y)));
                n_members += extent.count as u32;
            }
        }
        self.members.clear();
        self.members.resize(n_members as usize, 0);
        for (point, label) in self.labels.iter_mut().enumerate() {
            if *label != Label::OBSTACLE {
                continue;
            }
            let first = sets.first(point as u32) as usize;
            match self.extents[self.components[first] as usize].1 {
                None => *label = Label::Small,
                Some(number) => {
                    *label = Label::Cluster(number);
                    let end = &mut self.ends[number as usize].0;
                    self.members[*end as usize] = point as u32;
                    *end += 1;
                }
            }
        }
    }

    /// Counts and bounds the points of each set of obstacles.
    fn measure(&mut self, points: &[[f32; 3]], sets: &mut Sets) {
        self.extents.clear();
        self.components.clear();
        self.components.resize(points.len(), 0);
        for (point, label) in self.labels.iter().enumerate() {
            if *label != Label::OBSTACLE {
                continue;
            }
            let first = sets.first(point as u32) as usize;
            if first == point {
                self.components[first] = self.extents.len() as u32;
                self.extents.push((Extent::at(points[point]), None));
            } else {
                self.extents[self.components[first] as usize].0.add(&Extent::at(points[point]));
            }
        }
    }
}

/// The number of points of a set and their bounding rectangle, seen from above.
#[derive(Clone, Copy, Debug, Default)]
pub struct Extent {
    count: usize,
    low: [f32; 2],
    high: [f32; 2],
}

impl Extent {
    /// Of some points; without any, of one at the origin that does not count.
    #[must_use]
    pub fn of(points: impl Iterator<Item = [f32; 3]>) -> Self {
        let join = |mut all: Self, one| {
            all.add(&one);
            all
        };
        points.map(Self::at).reduce(join).unwrap_or_default()
    }

    fn at([x, y, _]: [f32; 3]) -> Self {
        Self { count: 1, low: [x, y], high: [x, y] }
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        for axis in 0..2 {
            self.low[axis] = self.low[axis].min(other.low[axis]);
            self.high[axis] = self.high[axis].max(other.high[axis]);
        }
    }

    /// Whether the set is neither too small nor too large for a cluster.
    fn is_cluster(&self, settings: &Settings) -> bool {
        (settings.min_points..=settings.max_points).contains(&self.count)
            && self.diagonal_m() <= settings.max_size_m
    }

    /// The diagonal of the rectangle, metres.
    #[must_use]
    pub fn diagonal_m(&self) -> f32 {
        libm::hypotf(self.high[0] - self.low[0], self.high[1] - self.low[1])
    }

    /// The middle of the rectangle, metres.
    #[must_use]
    pub fn middle(&self) -> [f32; 2] {
        // Halves first: a sum may overflow.
        [0, 1].map(|axis| self.low[axis] / 2.0 + self.high[axis] / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::Extent;

    #[test]
    fn the_extent_is_that_of_the_points_from_above() {
        let points = [[1.0, 2.0, 9.0], [4.0, 6.0, -9.0], [2.0, 3.0, 0.0]];
        let extent = Extent::of(points.into_iter());
        assert_eq!((extent.middle(), extent.diagonal_m()), ([2.5, 4.0], 5.0));
    }
}
