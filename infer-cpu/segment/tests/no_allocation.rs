//! A segmenter allocates nothing for sweeps that are no larger than those it has seen: a robot's
//! memory does not grow.
//!
//! One test alone: the count is the whole process's.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "suite/scanner.rs"]
#[allow(dead_code, reason = "the suite uses all of it")]
mod scanner;

use edgepuck_segment::{Segmenter, Settings, Sweep};
use scanner::{VLP32C, block, flat, scan};
use test_support::allocations::{self, Counting};

#[global_allocator]
static COUNTING: Counting = Counting;

fn main() {
    let large = scan(&VLP32C, &[flat(), block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5)]);
    let small = scan(&VLP32C[5..], &[flat(), block([6.0, -3.0], [2.0, 2.0], 0.0, 1.5)]);
    for radius_m in [None, Some(0.3)] {
        for with_rings in [true, false] {
            let mut settings = Settings::default();
            settings.radius_m = radius_m;
            let mut segmenter = Segmenter::new(settings).unwrap();
            let mut segment = |scan: &scanner::Scan| {
                let rings = with_rings.then_some(&scan.rings[..]);
                let sweep = Sweep { points: &scan.points, rings };
                segmenter.segment(&sweep).unwrap().clusters().len()
            };
            segment(&large);
            let before = allocations::count();
            let n_clusters = segment(&small) + segment(&large);
            let n_allocations = allocations::count() - before;
            assert_eq!(n_allocations, 0, "radius {radius_m:?}, rings {with_rings}");
            assert!(n_clusters > 0);
        }
    }
}
