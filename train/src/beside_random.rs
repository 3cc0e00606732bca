//! How near a choice of points comes to others, beside random choices of as many.

use formats::rng::StreamKey;
use infer_cpu::sampler::RandomSubset;

use formats::chamfer::{Chamfer, chamfer};

/// Distances to the same points.
#[derive(Clone, Debug, PartialEq)]
pub struct BesideRandom {
    /// Of the choice.
    pub ours: Chamfer,
    /// Of random subsets, ascending by squared distance.
    pub random: Vec<Chamfer>,
}

impl BesideRandom {
    /// Of `chosen` and `reference`, indices into `points`, and of `draws`
    /// subsets by `seed`.
    #[must_use]
    pub fn of(
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
            let (key, mut drawn) = (StreamKey::new(seed, "random subsets", draw), Vec::new());
            RandomSubset::default().draw(points.len(), chosen.len(), key, &mut drawn);
            some(&drawn.into_iter().map(|i| i as usize).collect::<Vec<_>>())
        };
        let ours = chamfer(&some(chosen), &reference);
        let mut random: Vec<_> =
            (0..draws).map(|draw| chamfer(&subset(draw), &reference)).collect();
        random.sort_by(|a, b| a.squared.total_cmp(&b.squared));
        Self { ours, random }
    }

    /// How many random subsets are nearer.
    #[must_use]
    pub fn nearer(&self) -> usize {
        self.random.iter().filter(|one| one.squared < self.ours.squared).count()
    }
}
