//! The objects at the peaks of a network's scores.

use super::image::Image;
use super::image::{CELL_M, REACH_M, SIDE};
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
        let mut seen = self.peaks(libm::logf(least / (1.0 - least)));
        seen.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut kept: Vec<Seen> = Vec::new();
        for one in seen {
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

    /// The object of a class at the best cell within `reach` cells of a place, metres; `None` beyond the
    /// cells.
    pub fn near(&self, class: usize, place_m: [f32; 2], reach: usize) -> Option<Seen> {
        let cell = |along: f32| {
            let at = (along + REACH_M) / CELL_M;
            (0.0..SIDE as f32).contains(&at).then_some(at as usize)
        };
        let [row, column] = [cell(place_m[0])?, cell(place_m[1])?];
        let cells = about(row, reach).flat_map(|i| about(column, reach).map(move |j| (i, j)));
        let score = |&(i, j): &(usize, usize)| self.at(class, i, j);
        let best = cells.max_by(|a, b| score(a).total_cmp(&score(b)));
        best.map(|(i, j)| self.object(class, i, j))
    }

    /// An output of a cell of 0.2 m.
    fn at(&self, output: usize, row: usize, column: usize) -> f32 {
        let quarter = 2 * (row % 2) + column % 2;
        self.outputs[(row / 2 * (SIDE / 2) + column / 2) * OUTPUTS + 4 * output + quarter]
    }

    /// The objects at the cells whose scores are `least` or more, before the logistic function, and
    /// none around is greater.
    fn peaks(&self, least: f32) -> Vec<Seen> {
        let mut seen = Vec::new();
        for row in 0..SIDE {
            for column in 0..SIDE {
                for class in 0..N_CLASSES {
                    if self.at(class, row, column) >= least && self.is_peak(class, row, column) {
                        seen.push(self.object(class, row, column));
                    }
                }
            }
        }
        seen
    }

    fn is_peak(&self, class: usize, row: usize, column: usize) -> bool {
        let about = |at: usize| about(at, REACH[class]);
        let score = self.at(class, row, column);
        about(row).all(|i| about(column).all(|j| self.at(class, i, j) <= score))
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
        let found = Scores::new(&Told(vec![([9, 9], 0, 2.0, of_box)]), empty()).objects(0.5);
        assert_eq!(found[0].size_m, [libm::expf(3.0), libm::expf(-2.0), 1.0]);
    }

    /// Persons are peaks beyond a cell, and 0.4 m apart; a car leaves no other car within 1.5 m, and no
    /// person within 0.9 m.
    #[test]
    fn peaks_are_the_best_about_them_and_apart() {
        let at = |row: usize| (row as f32 + 0.5) * CELL_M - REACH_M;
        let found = seen(&[([50, 50], 1, 3.0), ([51, 50], 1, 2.0), ([53, 50], 1, 0.5)]);
        assert_eq!(found, [(1, [at(50), at(50)]), (1, [at(53), at(50)])]);
        let found = seen(&[
            ([50, 50], 0, 3.0),
            ([50, 57], 0, 2.0),
            ([58, 50], 0, 1.0),
            ([54, 50], 1, 2.5),
            ([45, 50], 1, 2.4),
            ([0, 399], 2, -0.1),
        ]);
        let expected = [(0, [50, 50]), (1, [45, 50]), (0, [58, 50])];
        assert_eq!(found, expected.map(|(class, cell)| (class, cell.map(at))));
    }
}
