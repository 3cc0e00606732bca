//! Compares the distance between chosen points and reference points with that of random choices of
//! the same size.

use formats::chamfer::{Chamfer, chamfer};
use formats::streams::Stream;
use infer_cpu::sampler::RandomSubset;

/// Chamfer distances to the same reference points.
#[derive(Clone, Debug, PartialEq)]
pub struct RandomBaseline {
    /// The distance of the chosen points.
    pub ours: Chamfer,
    /// The distances of random subsets, ascending by squared distance.
    pub random: Vec<Chamfer>,
}

impl RandomBaseline {
    /// Computes the distances to `reference` of `chosen`, and of `draws` random subsets. Both
    /// arguments are indices into `points`.
    #[must_use]
    pub fn new(
        points: &[[f32; 3]],
        (chosen, reference): (&[usize], &[usize]),
        draws: u32,
        seed: u64,
    ) -> Self {
        let some = |indices: &[usize]| -> Vec<[f64; 3]> {
            indices.iter().map(|&i| points[i].map(f64::from)).collect()
        };
        let reference = some(reference);
        let subset = |draw| {
            let (key, mut drawn) = (Stream::RandomSubset { draw }.key(seed), Vec::new());
            RandomSubset::default().draw(points.len(), chosen.len(), key, &mut drawn);
            some(&drawn.into_iter().map(|i| i as usize).collect::<Vec<_>>())
        };
        let ours = chamfer(&some(chosen), &reference);
        let mut random: Vec<_> =
            (0..draws).map(|draw| chamfer(&subset(draw), &reference)).collect();
        random.sort_by(|a, b| a.squared.total_cmp(&b.squared));
        Self { ours, random }
    }

    /// The number of random subsets that are nearer than the choice.
    #[must_use]
    pub fn nearer(&self) -> usize {
        self.random.iter().filter(|one| one.squared < self.ours.squared).count()
    }
}
