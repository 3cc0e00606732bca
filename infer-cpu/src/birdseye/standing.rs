//! The points that stand on the ground, sorted so that those of a box are found fast.

use edgepuck_segment::Label;

use super::heights::{Heights, N, index, nearest_index};
use super::image::{CELL_M, FARTHEST_M, REACH_M, SIDE};
use super::peaks::Seen;
use super::plan::PERSON;

/// How far about a box its points are, and about the middle of a person, metres.
const MARGIN_M: f32 = 0.15;
const PERSON_M: f32 = 0.55;
/// The least and the greatest height over the ground, metres: what is higher is over an object, such as
/// a roof or the crown of a tree.
const LOWEST_M: f32 = -0.6;
const HIGHEST_M: f32 = 4.0;

/// The points of a sweep that are not ground, by square cells of a metre.
pub struct Standing<'a> {
    points: &'a [[f32; 3]],
    /// For each cell, the end of its points in `members`.
    ends: Vec<u32>,
    members: Vec<u32>,
}

impl<'a> Standing<'a> {
    /// The points of `points` that stand on `ground`.
    pub fn new(points: &'a [[f32; 3]], labels: &[Label], ground: &Heights) -> Self {
        let cell_of = |(&[x, y, z], label): (&[f32; 3], &Label)| {
            let height_m = z - ground.z_m([x, y]);
            let is_standing = !matches!(label, Label::Ground | Label::Invalid)
                && height_m > LOWEST_M
                && height_m < HIGHEST_M
                && libm::hypotf(x, y) < FARTHEST_M;
            is_standing.then(|| Some(index(x)? * N + index(y)?)).flatten()
        };
        let cells: Vec<_> = points.iter().zip(labels).map(cell_of).collect();
        let mut ends = vec![0; N * N + 1];
        cells.iter().flatten().for_each(|&cell| ends[cell + 1] += 1);
        (1..ends.len()).for_each(|cell| ends[cell] += ends[cell - 1]);
        let mut members = vec![0; ends[N * N] as usize];
        for (point, cell) in (0..).zip(&cells) {
            if let Some(cell) = *cell {
                members[ends[cell] as usize] = point;
                ends[cell] += 1;
            }
        }
        ends.truncate(N * N);
        Self { points, ends, members }
    }

    /// The indices of those in some cells of the image, row by row; those beyond the image count as in the
    /// nearest.
    pub fn about(&self, is_about: &[bool]) -> Vec<u32> {
        let cell = |along_m: f32| ((along_m + REACH_M) / CELL_M).clamp(0.0, (SIDE - 1) as f32);
        let is_near = |&&point: &&u32| {
            let [x, y, _] = self.points[point as usize];
            is_about[cell(x) as usize * SIDE + cell(y) as usize]
        };
        self.members.iter().filter(is_near).copied().collect()
    }

    /// The indices of the points of an object, ascending.
    pub fn of(&self, seen: &Seen) -> Vec<u32> {
        let [length_m, width_m, _] = seen.size_m;
        let reach_m = libm::hypotf(length_m, width_m) / 2.0 + PERSON_M.max(MARGIN_M);
        let [rows, columns] = seen
            .centre_m
            .map(|along| nearest_index(along - reach_m)..=nearest_index(along + reach_m));
        let (sin, cos) = libm::sincosf(seen.yaw_rad);
        let is_own = |&&point: &&u32| is_within(seen, [cos, sin], self.points[point as usize]);
        let mut found = Vec::new();
        for row in rows {
            let (first, last) = (row * N + columns.start(), row * N + columns.end());
            let begin = first.checked_sub(1).map_or(0, |before| self.ends[before]);
            let near = &self.members[begin as usize..self.ends[last] as usize];
            found.extend(near.iter().filter(is_own));
        }
        found.sort_unstable();
        found
    }
}

/// Whether a point is one of an object, whose yaw has this cosine and sine.
fn is_within(seen: &Seen, [cos, sin]: [f32; 2], [x, y, _]: [f32; 3]) -> bool {
    let [dx, dy] = [x - seen.centre_m[0], y - seen.centre_m[1]];
    if seen.class == PERSON {
        return libm::hypotf(dx, dy) < PERSON_M;
    }
    let off_m = [dx * cos + dy * sin, dy * cos - dx * sin];
    off_m.iter().zip(seen.size_m).all(|(off_m, size_m)| off_m.abs() < size_m / 2.0 + MARGIN_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(class: usize, yaw_rad: f32) -> Seen {
        Seen { class, score: 0.5, centre_m: [10.0, -5.0], size_m: [4.0, 1.6, 1.5], yaw_rad }
    }

    /// A lattice of 0.1 m about the box, at the height of 1 m.
    #[test]
    fn the_points_of_a_box_are_those_within_its_margin() {
        let lattice = |i: u16| f32::from(i) * 0.1 - 4.05;
        let mut points = vec![[0.5, 0.5, 0.0]];
        points.extend((0..81 * 81).map(|i| [10.0 + lattice(i / 81), lattice(i % 81) - 5.0, 1.0]));
        let mut labels = vec![Label::Small; points.len()];
        labels[0] = Label::Ground;
        let ground = Heights::of(&points, &labels).unwrap();
        let standing = Standing::new(&points, &labels, &ground);
        for (object, [along, across]) in
            [(seen(0, 0.0), [2.15, 0.95]), (seen(0, std::f32::consts::FRAC_PI_2), [0.95, 2.15])]
        {
            let is_own = |&[x, y, z]: &[f32; 3]| {
                (x - 10.0).abs() < along && (y + 5.0).abs() < across && z > 0.5
            };
            let own = (0..).zip(&points).filter(|(_, point)| is_own(point)).map(|(i, _)| i);
            assert_eq!(standing.of(&object), own.collect::<Vec<u32>>());
        }
        let of_person = standing.of(&seen(1, 0.7));
        let is_near = |&[x, y, z]: &[f32; 3]| (x - 10.0).hypot(y + 5.0) < 0.55 && z > 0.5;
        assert_eq!(of_person.len(), points.iter().filter(|point| is_near(point)).count());
    }

    #[test]
    fn ground_and_what_is_over_an_object_are_left_out() {
        let heights_m = [0.0, 0.3, 3.9, 4.1, -0.7, 1.0];
        let points = heights_m.map(|z| [10.0, -5.0, z]);
        let mut labels = [Label::Cluster(3); 6];
        (labels[0], labels[5]) = (Label::Ground, Label::Invalid);
        let ground = Heights::of(&points, &labels).unwrap();
        assert_eq!(Standing::new(&points, &labels, &ground).of(&seen(0, 0.0)), [1, 2]);
    }

    /// Of a small person at the border of a cell, in the next one.
    #[test]
    fn the_points_of_a_person_are_found_beyond_its_box() {
        let person = Seen { centre_m: [10.47, -4.5], size_m: [0.5, 0.5, 1.7], ..seen(PERSON, 0.0) };
        let points = [[10.47, -4.5, 0.0], [11.01, -4.5, 1.0], [11.03, -4.5, 1.0]];
        let labels = [Label::Ground, Label::Small, Label::Small];
        let ground = Heights::of(&points, &labels).unwrap();
        assert_eq!(Standing::new(&points, &labels, &ground).of(&person), [1]);
    }
}
