//! A segmenter allocates nothing for sweeps that are no larger than those it has
//! seen: a robot's memory does not grow.
//!
//! One test alone: the count is the whole process's.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "suite/scanner.rs"]
#[allow(dead_code, reason = "the suite uses all of it")]
mod scanner;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

use edgepuck_segment::{Segmenter, Settings, Sweep};
use scanner::{VLP32C, block, flat, scan};

/// The system's allocator, its calls counted.
struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call goes to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is the system's condition.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is the system's condition.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise is the system's condition.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

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
            let before = ALLOCATIONS.load(Ordering::SeqCst);
            let n_clusters = segment(&small) + segment(&large);
            let n_allocations = ALLOCATIONS.load(Ordering::SeqCst) - before;
            assert_eq!(n_allocations, 0, "radius {radius_m:?}, rings {with_rings}");
            assert!(n_clusters > 0);
        }
    }
}
