//! The order of the points in the kernels.
//!
//! Callers sort the points, so that a block would cover only one corner of the cloud. With steps of
//! a golden section of the cloud, every block is a sample of the whole. The first blocks then come
//! close to the largest products, which leaves less for the prefilter to compute.

#[derive(Clone, Copy, Debug, Default)]
pub struct Interleave {
    n: u64,
    step: u64,
}

impl Interleave {
    pub fn new(n: usize) -> Self {
        let n = n as u64;
        // (√5 - 1) / 2: no other ratio leaves rows more evenly spread (Knuth, TAOCP vol. 3, §6.4,
        // theorem S).
        let golden = (n as f64 * 0.618_033_988_749_895).round() as u64;
        let step = (golden.max(1)..=n).find(|&step| gcd(step, n) == 1).unwrap_or(1);
        Self { n, step }
    }

    /// The order of the points themselves.
    pub fn none(n: usize) -> Self {
        Self { n: n as u64, step: 1 }
    }

    pub fn point(self, row: usize) -> usize {
        (row as u64 * self.step % self.n.max(1)) as usize
    }
}

fn gcd(a: u64, b: u64) -> u64 {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_comes_once() {
        for n in (1..300).chain([1023, 1024, 4096, 65_537]) {
            let interleave = Interleave::new(n);
            let mut came = vec![false; n];
            (0..n).for_each(|row| came[interleave.point(row)] = true);
            assert!(came.into_iter().all(|came| came), "{n}");
        }
    }

    #[test]
    fn a_block_is_a_sample_of_the_whole() {
        let (n, block) = (1024, 48);
        let interleave = Interleave::new(n);
        for first in (0..n - block).step_by(block) {
            let mut points: Vec<_> =
                (first..first + block).map(|row| interleave.point(row)).collect();
            points.sort_unstable();
            // Evenly spread, gaps would be n / block.
            let widest = points.windows(2).map(|pair| pair[1] - pair[0]).max();
            assert!(widest.unwrap() < 2 * n / block, "{points:?}");
        }
    }
}
