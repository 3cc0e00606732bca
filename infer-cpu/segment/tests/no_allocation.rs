//! A segmenter allocates nothing for sweeps that are no larger than those it has seen: a robot's
//! memory does not grow.
//!
//! One test alone: the count is the whole process's.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "suite/scanner.rs"]
#[allow(dead_code, reason = "the suite uses all of it")]
mod scanner;

use edgepuck_segment::{Segmenter, Settings, Stream, Sweep};
use scanner::{VLP32C, block, flat, scan};
use test_support::allocations::{self, Counting};

#[global_allocator]
static COUNTING: Counting = Counting;

/// Worths for as many nodes as there may be.
static WORTHS: [f64; 1000] = [1.0; 1000];

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
                let n_clusters = segmenter.segment(&sweep).unwrap().clusters().len();
                let n_nodes = segmenter.hierarchy(&sweep).unwrap().len();
                n_clusters + segmenter.cut(&WORTHS[..n_nodes], 0.1).0.len()
            };
            segment(&large);
            let before = allocations::count();
            let n_clusters = segment(&small) + segment(&large);
            let n_allocations = allocations::count() - before;
            assert_eq!(n_allocations, 0, "radius {radius_m:?}, rings {with_rings}");
            assert!(n_clusters > 0);
        }
    }
    stream_allocates_nothing(&large);
}

/// After its first two turns, whose grounds take the room for all others.
fn stream_allocates_nothing(scan: &scanner::Scan) {
    let mut settings = Settings::default();
    settings.ring_elevations_deg = Some(VLP32C.map(|degrees| degrees as f32).to_vec());
    let mut stream = Stream::new(settings, 150_000).unwrap();
    let (mut before, mut n_clusters) = (0, 0);
    for turn in 0..5 {
        if turn == 3 {
            before = allocations::count();
        }
        // The scanner turns counterclockwise, the stream's sensor clockwise.
        for i in (0..scan.points.len()).rev() {
            let [x, y, _] = scan.points[i];
            stream.advance(-y.atan2(x) - 0.01, |_| n_clusters += 1);
            stream.push(scan.points[i], scan.rings[i], ());
        }
    }
    assert_eq!(allocations::count() - before, 0, "stream");
    assert!(n_clusters > 3);
}
