use std::iter::repeat_n;

use formats::rng::StreamKey;

/// Draws the consecutive numbers of one random stream.
#[derive(Clone, Debug)]
pub struct Sampler {
    key: StreamKey,
    next: u64,
}

impl Sampler {
    /// Starts at the first number of `key`'s stream.
    pub fn new(key: StreamKey) -> Self {
        Self { key, next: 0 }
    }

    /// A number in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        let unit = self.key.unit(self.next);
        self.next += 1;
        low + (high - low) * unit
    }

    /// A number in the range `[low, high]`.
    pub fn within(&mut self, [low, high]: [f64; 2]) -> f64 {
        self.uniform(low, high)
    }

    /// A number in `low..high` whose logarithm is uniform; both above 0.
    pub fn log_uniform(&mut self, low: f64, high: f64) -> f64 {
        libm::exp(self.uniform(libm::log(low), libm::log(high)))
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.uniform(0.0, 1.0) < p
    }

    /// An integer in `low..=high`.
    pub fn count(&mut self, low: usize, high: usize) -> usize {
        let drawn = self.key.below((high - low + 1) as u64, self.next);
        self.next += 1;
        low + drawn as usize
    }

    /// One of `choices`, all equally likely. `choices` must not be empty.
    pub fn pick<T: Clone>(&mut self, choices: &[T]) -> T {
        choices[self.count(0, choices.len() - 1)].clone()
    }

    /// One of `choices` with a probability proportional to its weight. `choices` must not be empty.
    pub fn weighted<T: Clone>(&mut self, choices: &[(usize, T)]) -> T {
        let copies = choices.iter().flat_map(|(weight, choice)| repeat_n(choice, *weight));
        self.pick(&copies.collect::<Vec<_>>()).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_stay_in_their_ranges_and_reach_both_ends() {
        let mut sampler = Sampler::new(StreamKey::new(3, "sampler", 0));
        let mut counts = [0; 3];
        for _ in 0..3000 {
            assert!((-1.0..2.0).contains(&sampler.uniform(-1.0, 2.0)));
            assert!((0.1..10.0).contains(&sampler.log_uniform(0.1, 10.0)));
            counts[sampler.count(1, 3) - 1] += 1;
        }
        // 1000 expected, standard deviation 26: 800 lies 7 sigma below.
        assert!(counts.iter().all(|&count| count > 800), "{counts:?}");
    }
}
