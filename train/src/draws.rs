//! Random numbers that are drawn one after another.

use formats::rng::StreamKey;

pub(crate) struct Draws {
    stream: StreamKey,
    n: u64,
}

impl Draws {
    pub fn new(stream: StreamKey) -> Self {
        Self { stream, n: 0 }
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.n += 1;
        self.stream.unit(self.n)
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn below(&mut self, bound: usize) -> usize {
        self.n += 1;
        self.stream.below(bound as u64, self.n) as usize
    }

    /// Standard normal (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let (radius, angle) = (1.0 - self.unit(), self.unit());
        (-2.0 * libm::log(radius)).sqrt() * libm::cos(std::f64::consts::TAU * angle)
    }

    /// Swaps points of `cloud` so that the first `n` are a random choice in random order (Fisher
    /// and Yates).
    pub fn shuffled(&mut self, cloud: &[[f32; 3]], n: usize) -> Vec<[f32; 3]> {
        let mut points = cloud.to_vec();
        for i in 0..n {
            let j = i + self.below(points.len() - i);
            points.swap(i, j);
        }
        points
    }
}
