//! Test-time augmentation: several random subsets or rotations of one cloud, whose
//! log-probabilities are averaged.

use formats::streams::Stream;

use crate::error::Error;
use crate::options::{Options, UpAxis};
use crate::sampler::{SamplerKind, SamplerSpec};

/// Collects votes, and reuses its memory for each cloud.
pub struct TestTimeAugmentation {
    n: u32,
    rotations: bool,
    up: UpAxis,
    seed: u64,
    cloud: Vec<[f32; 3]>,
    sums: Vec<f64>,
}

impl TestTimeAugmentation {
    /// The augmentation that `options` request, for a network of `n_classes` with the sampler
    /// `spec`.
    pub fn new(options: &Options, spec: &SamplerSpec, n_classes: usize) -> Result<Self, Error> {
        let n = options.votes.max(1);
        if n > 1 && spec.kind != SamplerKind::Random && !options.vote_rotations {
            return Err(Error::VotesWithoutDraws(spec.kind));
        }
        Ok(Self {
            n,
            rotations: options.vote_rotations,
            up: options.up,
            seed: spec.seed,
            cloud: Vec::new(),
            sums: vec![0.0; n_classes],
        })
    }

    pub fn n(&self) -> u32 {
        self.n
    }

    pub fn reserve(&mut self, n_points: usize) {
        if self.n > 1 {
            self.cloud.reserve(n_points);
        }
    }

    pub fn begin(&mut self, cloud: &[[f32; 3]]) {
        self.cloud.clear();
        self.cloud.extend(cloud);
        self.sums.fill(0.0);
    }

    /// The seed of vote `vote`; the first is the sampler's own.
    pub fn seed(&self, vote: u32) -> u64 {
        if vote == 0 {
            return self.seed;
        }
        let [low, high, ..] = Stream::Vote { vote }.key(self.seed).words([0; 4]);
        u64::from(high) << 32 | u64::from(low)
    }

    /// Writes the cloud of vote `vote` to `out`: with rotations, it is turned by `vote / n` of a
    /// full turn about the up axis.
    pub fn turn(&self, vote: u32, out: &mut [[f32; 3]]) {
        let angle = match self.rotations {
            true => f64::from(vote) / f64::from(self.n) * std::f64::consts::TAU,
            false => 0.0,
        };
        let (sin, cos) = libm::sincos(angle);
        let [a, b] = self.up.others();
        for (out, point) in out.iter_mut().zip(&self.cloud) {
            *out = *point;
            if angle != 0.0 {
                let (x, y) = (f64::from(point[a]), f64::from(point[b]));
                out[a] = (x * cos - y * sin) as f32;
                out[b] = (x * sin + y * cos) as f32;
            }
        }
    }

    pub fn count(&mut self, logits: &[f32]) {
        let largest = logits.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        let shifted = |logit: f32| f64::from(logit) - f64::from(largest);
        let log_sum = libm::log(logits.iter().map(|&logit| libm::exp(shifted(logit))).sum::<f64>());
        for (sum, &logit) in self.sums.iter_mut().zip(logits) {
            *sum += shifted(logit) - log_sum;
        }
    }

    /// Writes the mean log-probabilities to `out`.
    pub fn result(&self, out: &mut Vec<f32>) {
        out.clear();
        out.extend(self.sums.iter().map(|sum| (sum / f64::from(self.n)) as f32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_votes_are_the_quarter_turns_about_the_up_axis_and_count_alike() {
        for (up, quarters) in [
            (UpAxis::Z, [[1.0, 2.0, 5.0], [-2.0, 1.0, 5.0], [-1.0, -2.0, 5.0], [2.0, -1.0, 5.0]]),
            (UpAxis::Y, [[1.0, 2.0, 5.0], [5.0, 2.0, -1.0], [-1.0, 2.0, -5.0], [-5.0, 2.0, 1.0]]),
        ] {
            let options = Options { votes: 4, vote_rotations: true, up, ..Options::default() };
            let mut votes =
                TestTimeAugmentation::new(&options, &SamplerSpec::default(), 2).unwrap();
            votes.begin(&[[1.0, 2.0, 5.0]]);
            let mut mean = Vec::new();
            for (vote, expected) in (0..).zip(quarters) {
                let mut turned = [[0.0; 3]];
                votes.turn(vote, &mut turned);
                let off = [0, 1, 2].map(|axis| (turned[0][axis] - expected[axis]).abs());
                assert!(off.iter().all(|off| *off < 1e-6), "{up:?}, vote {vote}: {turned:?}");
                // Two votes of 3 to 1 and two of 1 to 3.
                let logits = [3.0f32.ln(), 0.0];
                votes.count(&if vote < 2 { logits } else { [logits[1], logits[0]] });
            }
            votes.result(&mut mean);
            let expected = (0.75f32.ln() + 0.25f32.ln()) / 2.0;
            assert!(mean.iter().all(|mean| (mean - expected).abs() < 1e-6), "{mean:?}");
        }
    }
}
