//! The objects at the peaks of a network's scores.

use super::image::Image;
use super::image::{CELL_M, REACH_M, SIDE};
use super::network::Forward;

/// Scores of classes, in the order of the model's card.
pub const N_CLASSES: usize = 4;
/// After the scores come, of the object about a cell: the offset of its centre along x and y (cells), the
/// logarithms of its length, width and height (metres), and the cosine and sine of twice its yaw.
const N_BOX: usize = 7;
/// The outputs of a cell of 0.4 m: each of the above for its four quarters.
pub const OUTPUTS: usize = 4 * (N_CLASSES + N_BOX);
/// The cells of 0.2 m on each side of a peak that have no greater score of its class.
const REACH: [usize; N_CLASSES] = [3, 1, 2, 4];
/// The least distance between two objects: of cars, of persons, of two-wheelers, and of trucks and
/// buses, metres. Objects of two classes may be closer, by this factor.
const APART_M: [f32; N_CLASSES] = [1.5, 0.4, 0.8, 3.0];
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

/// Runs `network` on `image` and returns the objects whose score is `least` or more, the best first.
pub fn objects(network: &dyn Forward, image: Image, least: f32) -> Vec<Seen> {
    let mut outputs = vec![0.0; SIDE * SIDE / 4 * OUTPUTS];
    network.run(image, &mut |row, values| {
        outputs[row * values.len()..][..values.len()].copy_from_slice(values);
    });
    let scores = Scores { outputs };
    let mut seen = scores.peaks(libm::logf(least / (1.0 - least)));
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

struct Scores {
    outputs: Vec<f32>,
}

impl Scores {
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
        let about = |at: usize| at.saturating_sub(REACH[class])..=(at + REACH[class]).min(SIDE - 1);
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
