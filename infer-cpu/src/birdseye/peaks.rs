//! The objects at the peaks of a network's scores.

use super::image::Image;
use super::image::{CELL_M, REACH_M, SIDE, cells_along};
use super::network::Forward;
use super::plan::{N_CLASSES, OUTPUTS};

/// The cells of 0.2 m on each side of a peak that have no greater score of its class.
const REACH: [usize; N_CLASSES] = [3, 1, 2, 4];
/// The least distance between two objects: of cars, of persons, of two-wheelers, and of trucks and
/// buses, metres. Objects of two classes may be closer, by this factor.
const APART_M: [f32; N_CLASSES] = [1.5, 0.4, 0.45, 3.0];
const CLOSER: f32 = 0.6;

/// An object that the network sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// The index of its class.
    pub class: usize,
    /// How much the network believes in it, 0 to 1.
    pub score: f32,
    /// The centre of its footprint, metres in the sensor's frame.
    pub centre_m: [f32; 2],
    /// Length, width and height, metres.
    pub size_m: [f32; 3],
    /// The direction of its length, which is that of its front or of its rear.
    pub yaw_rad: f32,
}

impl Seen {
    /// Whether it is within reach, and does not hold the sensor: what does carries it.
    fn may_be(&self) -> bool {
        let [x, y] = self.centre_m;
        let (sin, cos) = libm::sincosf(self.yaw_rad);
        let off_m = [x * cos + y * sin, y * cos - x * sin];
        let holds_sensor =
            off_m.iter().zip(self.size_m).all(|(off_m, size_m)| off_m.abs() < size_m / 2.0);
        libm::hypotf(x, y) <= REACH_M && !holds_sensor
    }
}

/// What a network says of each cell of a sweep.
pub struct Scores {
    outputs: Vec<f32>,
}

impl Scores {
    /// Runs `network` on `image`.
    pub fn new(network: &dyn Forward, image: Image) -> Self {
        let mut outputs = vec![0.0; SIDE * SIDE / 4 * OUTPUTS];
        network.run(image, &mut |row, values| {
            outputs[row * values.len()..][..values.len()].copy_from_slice(values);
        });
        Self { outputs }
    }

    /// The objects whose score is `least` or more, the best first.
    pub fn objects(&self, least: f32) -> Vec<Seen> {
        let peaks = self.at_least(least).filter(|&(class, cell)| self.is_peak(class, cell));
        let mut seen: Vec<_> =
            peaks.map(|(class, [row, column])| self.object(class, row, column)).collect();
        seen.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut kept: Vec<Seen> = Vec::new();
        for one in seen.into_iter().filter(Seen::may_be) {
            let is_apart = |other: &Seen| {
                let apart_m = APART_M[one.class].max(APART_M[other.class]);
                let factor = if one.class == other.class { 1.0 } else { CLOSER };
                let [dx, dy] = [0, 1].map(|axis| one.centre_m[axis] - other.centre_m[axis]);
                libm::hypotf(dx, dy) > factor * apart_m
            };
            if kept.iter().all(is_apart) {
                kept.push(one);
            }
        }
        kept
    }

    /// The object of a class at the best cell within `reach` cells of a place, metres; `None` if none may
    /// be there.
    pub fn near(&self, class: usize, place_m: [f32; 2], reach: usize) -> Option<Seen> {
        let [row, column] = [cells_along(place_m[0])? as usize, cells_along(place_m[1])? as usize];
        let cells = about(row, reach).flat_map(|i| about(column, reach).map(move |j| (i, j)));
        let score = |&(i, j): &(usize, usize)| self.at(class, i, j);
        let best = cells.max_by(|a, b| score(a).total_cmp(&score(b)));
        best.map(|(i, j)| self.object(class, i, j)).filter(Seen::may_be)
    }

    /// For each cell, row by row, whether one within `reach` cells has a score of `least` or more.
    pub fn about(&self, class: usize, least: f32, reach: usize) -> Vec<bool> {
        let mut is_about = vec![false; SIDE * SIDE];
        for (of, [row, column]) in self.at_least(least) {
            for i in about(row, reach).filter(|_| of == class) {
                let columns = about(column, reach);
                is_about[i * SIDE + columns.start()..=i * SIDE + columns.end()].fill(true);
            }
        }
        is_about
    }

    /// An output of a cell of 0.2 m.
    fn at(&self, output: usize, row: usize, column: usize) -> f32 {
        let quarter = 2 * (row % 2) + column % 2;
        self.outputs[(row / 2 * (SIDE / 2) + column / 2) * OUTPUTS + 4 * output + quarter]
    }

    /// The class and the cell of each score of `least` or more.
    fn at_least(&self, least: f32) -> impl Iterator<Item = (usize, [usize; 2])> {
        let least = libm::logf(least / (1.0 - least));
        self.outputs.chunks_exact(OUTPUTS).enumerate().flat_map(move |(cell, outputs)| {
            let scores = outputs[..4 * N_CLASSES].iter().enumerate();
            scores.filter(move |(_, score)| **score >= least).map(move |(number, _)| {
                let [row, column] = [cell / (SIDE / 2), cell % (SIDE / 2)];
                (number / 4, [2 * row + number % 4 / 2, 2 * column + number % 2])
            })
        })
    }

    /// Whether none around is greater; of several that are the same, the first is a peak.
    fn is_peak(&self, class: usize, [row, column]: [usize; 2]) -> bool {
        let about = |at: usize| about(at, REACH[class]);
        let score = self.at(class, row, column);
        let is_less = |i: usize, j: usize| {
            let other = self.at(class, i, j);
            other < score || other == score && (i, j) >= (row, column)
        };
        about(row).all(|i| about(column).all(|j| is_less(i, j)))
    }

    fn object(&self, class: usize, row: usize, column: usize) -> Seen {
        let of_box = |number: usize| self.at(N_CLASSES + number, row, column);
        let along = |at: usize, off: f32| (at as f32 + 0.5 + off) * CELL_M - REACH_M;
        Seen {
            class,
            score: 1.0 / (1.0 + libm::expf(-self.at(class, row, column))),
            centre_m: [along(row, of_box(0)), along(column, of_box(1))],
            // Between 0.14 and 20 m, whatever the network says.
            size_m: [2, 3, 4].map(|number| libm::expf(of_box(number).clamp(-2.0, 3.0))),
            yaw_rad: 0.5 * libm::atan2f(of_box(6), of_box(5)),
        }
    }
}

/// The rows or columns within `reach` of one.
fn about(at: usize, reach: usize) -> std::ops::RangeInclusive<usize> {
    at.saturating_sub(reach)..=(at + reach).min(SIDE - 1)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{Told, empty};
    use super::*;

    fn seen(told: &[([usize; 2], usize, f32)]) -> Vec<(usize, [f32; 2])> {
        let found = Told::scores(told).objects(0.5);
        found.into_iter().map(|one| (one.class, one.centre_m)).collect()
    }

    #[test]
    fn a_peak_has_its_box() {
        let of_box = [1.5, -0.5, 1.4, 0.5, 0.4, 0.0, 2.0];
        let scores = Scores::new(&Told(vec![([300, 101], 0, 2.0, of_box)]), empty());
        let found = scores.objects(0.5);
        let [one] = found[..] else { panic!("{found:?}") };
        assert!(one.class == 0 && (one.score - 0.880_797).abs() < 1e-6, "{one:?}");
        // The middles of the cells are 20.1 and -19.7 m.
        let expected_m = [20.1 + 0.3, -19.7 - 0.1];
        assert!((0..2).all(|i| (one.centre_m[i] - expected_m[i]).abs() < 1e-5), "{one:?}");
        assert_eq!(one.size_m, [1.4, 0.5, 0.4].map(libm::expf));
        assert!((one.yaw_rad - std::f32::consts::FRAC_PI_4).abs() < 1e-6, "{one:?}");
        // It is also the best about its cell, and far from it is none.
        assert_eq!(scores.near(0, [20.4, -19.3], 2), Some(one));
        assert!(scores.near(0, [20.6, -19.3], 2).unwrap().score < 0.001);
        assert_eq!(scores.near(0, [40.1, 0.0], 2), None);
        // Sizes that no object has.
        let of_box = [0.0, 0.0, 9.0, -9.0, 0.0, 1.0, 0.0];
        let found = Scores::new(&Told(vec![([99, 99], 0, 2.0, of_box)]), empty()).objects(0.5);
        assert_eq!(found[0].size_m, [libm::expf(3.0), libm::expf(-2.0), 1.0]);
    }

    /// Persons are peaks beyond a cell, and 0.4 m apart; a car leaves no other car within 1.5 m, and no
    /// person within 0.9 m.
    #[test]
    fn peaks_are_the_best_about_them_and_apart() {
        let at = |row: usize| (row as f32 + 0.5) * CELL_M - REACH_M;
        let found = seen(&[([100, 100], 1, 3.0), ([101, 100], 1, 2.0), ([103, 100], 1, 0.5)]);
        assert_eq!(found, [(1, [at(100), at(100)]), (1, [at(103), at(100)])]);
        let found = seen(&[
            ([100, 100], 0, 3.0),
            ([100, 107], 0, 2.0),
            ([108, 100], 0, 1.0),
            ([104, 100], 1, 2.5),
            ([95, 100], 1, 2.4),
            ([0, 399], 2, -0.1),
        ]);
        let expected = [(0, [100, 100]), (1, [95, 100]), (0, [108, 100])];
        assert_eq!(found, expected.map(|(class, cell)| (class, cell.map(at))));
    }

    /// A car of 4 m by 1.6 m whose middle is 1.9 m ahead of the sensor carries it; one beside
    /// it does not, and what is in a corner of the cells is too far away.
    #[test]
    fn no_object_holds_the_sensor_or_is_beyond_reach() {
        let of_box = [0.0, 0.0, 4f32.ln(), 1.6f32.ln(), 0.4, 1.0, 0.0];
        let rows = |cells: &[[usize; 2]]| {
            let told = cells.iter().map(|&cell| (cell, 0, 2.0, of_box)).collect();
            let scores = Scores::new(&Told(told), empty());
            (scores.objects(0.5).len(), scores.near(0, [1.9, 0.1], 1).is_some())
        };
        assert_eq!(rows(&[[209, 200]]), (0, false));
        assert_eq!(rows(&[[200, 205], [210, 200]]), (2, true));
        assert_eq!([rows(&[[342, 342]]).0, rows(&[[340, 340]]).0], [0, 1]);
    }

    #[test]
    fn a_plateau_is_one_peak() {
        let plateau: Vec<_> = (0..3).map(|i| ([100, 100 + i], 1, 2.0)).collect();
        let expected = [100.5, 100.5].map(|along| along * CELL_M - REACH_M);
        assert_eq!(seen(&plateau), [(1, expected)]);
    }

    #[test]
    fn cells_about_a_score_are_those_within_reach() {
        let scores = Told::scores(&[([50, 60], 1, 2.0), ([0, 0], 1, -1.0), ([9, 9], 0, 2.0)]);
        let is_about = scores.about(1, 0.5, 2);
        let cells = (0..SIDE * SIDE).filter(|&cell| is_about[cell]);
        let expected = (48..=52).flat_map(|row| (58..=62).map(move |column| row * SIDE + column));
        assert!(cells.eq(expected));
    }

    /// A car of 4 m by 1.6 m, turned by 45 degrees, 1.8 m from the sensor along its length or aside.
    #[test]
    fn a_turned_object_holds_the_sensor_along_its_length() {
        let of_box = [0.0, 0.0, 4f32.ln(), 1.6f32.ln(), 0.4, 0.0, 1.0];
        let n_seen = |cell: [usize; 2]| {
            Scores::new(&Told(vec![(cell, 0, 2.0, of_box)]), empty()).objects(0.5).len()
        };
        assert_eq!([[206, 206], [206, 193], [193, 193]].map(n_seen), [0, 1, 0]);
    }

    /// The cell at the end of a row is not beside the first one of the next, nor is one beyond the last row.
    #[test]
    fn nothing_is_beyond_the_last_cells() {
        assert_eq!(seen(&[([200, 399], 1, 2.0), ([202, 0], 1, 3.0)]).len(), 2);
        assert_eq!(seen(&[([399, 200], 1, 2.0), ([399, 399], 1, 2.0)]).len(), 1);
    }

    #[test]
    fn what_holds_the_sensor_hides_nothing_beside_it() {
        let of_box = [0.0, 0.0, 4f32.ln(), 1.6f32.ln(), 0.4, 1.0, 0.0];
        let told = vec![([203, 200], 0, 3.0, of_box), ([203, 206], 0, 2.0, of_box)];
        let found = Scores::new(&Told(told), empty()).objects(0.5);
        assert!(found.len() == 1 && found[0].centre_m[1] > 1.0, "{found:?}");
    }
}
