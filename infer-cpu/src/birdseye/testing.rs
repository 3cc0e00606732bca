//! A network that answers what a test tells it.

use edgepuck_segment::Label;

use super::Heights;
use super::image::{Image, SIDE};
use super::network::Forward;
use super::plan::{N_CLASSES, OUTPUTS};

/// A network whose outputs are those of some cells of 0.2 m (row and column, class, its logit, and the seven numbers of the
/// box), and whose other scores are low.
pub struct Told(pub Vec<([usize; 2], usize, f32, [f32; 7])>);

impl Forward for Told {
    fn run(&self, _: Image, each: &mut dyn FnMut(usize, &[f32])) {
        for row in 0..SIDE / 2 {
            let mut values = vec![0.0; SIDE / 2 * OUTPUTS];
            for cell in values.chunks_mut(OUTPUTS) {
                cell[..4 * N_CLASSES].fill(-9.0);
            }
            for &([i, j], class, logit, of_box) in &self.0 {
                if i / 2 == row {
                    let cell = &mut values[j / 2 * OUTPUTS..][..OUTPUTS];
                    let quarter = 2 * (i % 2) + j % 2;
                    cell[4 * class + quarter] = logit;
                    for (number, value) in of_box.into_iter().enumerate() {
                        cell[4 * (N_CLASSES + number) + quarter] = value;
                    }
                }
            }
            each(row, &values);
        }
    }
}

pub fn empty() -> Image {
    let ground = Heights::of(&[[0.0; 3]], &[Label::Ground]);
    Image::new(&[], &[], &ground.unwrap())
}

impl Told {
    /// What it says of a sweep, of cells with boxes of 1 m.
    pub fn scores(told: &[([usize; 2], usize, f32)]) -> super::Scores {
        let told = told.iter().map(|&(at, class, logit)| (at, class, logit, [0.0; 7])).collect();
        super::Scores::new(&Self(told), empty())
    }
}
