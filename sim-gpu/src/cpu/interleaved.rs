//! Traces incoherent rays, several at once, one step of each in turn: while one waits for memory,
//! the others proceed. Kocberber, Falsafi, Grot, "Asynchronous memory access chaining", VLDB 2015.

#![allow(
    unsafe_code,
    reason = "an instruction that fetches memory; its block says why it is sound"
)]

use super::traverse::{Along, Instructions, Nearest, Prepared};
use crate::bvh::{Stack, WideBvh, WideChild, step};
use crate::ray::TraceRay;
use bytemuck::Zeroable;
use std::iter::repeat_with;

/// The size in bytes up to which a tree stays in the cache, where tracing one ray after another
/// is faster: measured with 1,000 to 100,000 triangles (`bench embree`).
const CACHED: usize = 2 << 20;

/// The number of rays in flight in larger trees: more do not raise the speed.
const IN_FLIGHT: usize = 8;

pub struct Interleaved {
    walks: Vec<Walk>,
}

struct Walk {
    /// Its place among the rays to trace.
    number: usize,
    ray: Prepared,
    nearest: Nearest,
    stack: Stack<f32>,
    at: WideChild,
}

impl Walk {
    #[inline(always)]
    fn begin(&mut self, (number, ray): (usize, &TraceRay)) {
        self.number = number;
        self.ray = Prepared::new(ray);
        self.nearest = Nearest::NONE;
        self.stack.clear();
        self.at = WideChild::ROOT;
    }
}

impl Interleaved {
    /// Allocates as many walks as are worthwhile in `tree`.
    pub fn for_tree(tree: &WideBvh) -> Self {
        let nowhere = TraceRay::zeroed();
        let walk = || Walk {
            number: 0,
            ray: Prepared::new(&nowhere),
            nearest: Nearest::NONE,
            stack: Stack::default(),
            at: WideChild::ROOT,
        };
        let in_flight = if tree.bytes() <= CACHED { 1 } else { IN_FLIGHT };
        Self { walks: repeat_with(walk).take(in_flight).collect() }
    }

    #[inline(always)]
    pub fn trace(
        &mut self,
        tree: &WideBvh,
        rays: &[TraceRay],
        codes: &mut [u32],
        by: impl Instructions,
    ) {
        let mut to_begin = rays.iter().enumerate();
        let in_flight = self.walks.len().min(rays.len());
        let mut walks = &mut self.walks[..in_flight];
        walks.iter_mut().zip(&mut to_begin).for_each(|(walk, ray)| walk.begin(ray));
        while !walks.is_empty() {
            let mut turn = 0;
            while turn < walks.len() {
                let Walk { number, ray, nearest, stack, at } = &mut walks[turn];
                if let Some(next) = step(tree, *at, stack, &mut Along { ray, nearest, by }) {
                    // The node arrives while the other rays take their turns.
                    *at = next;
                    prefetch(tree, next);
                    turn += 1;
                    continue;
                }
                codes[*number] = nearest.code();
                if let Some(next) = to_begin.next() {
                    walks[turn].begin(next);
                } else {
                    // The last walk takes the turn of the one that ended.
                    let last = walks.len() - 1;
                    walks.swap(turn, last);
                    walks = &mut walks[..last];
                }
            }
        }
    }
}

#[inline(always)]
fn prefetch(tree: &WideBvh, at: WideChild) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        const CACHE_LINE: usize = 64;
        let (begin, size) = match at.leaf() {
            Some(leaf) => {
                ((&raw const tree.leaves[leaf]).cast::<i8>(), size_of_val(&tree.leaves[leaf]))
            }
            None => {
                let node = &tree.nodes[at.node()];
                ((&raw const *node).cast::<i8>(), size_of_val(node))
            }
        };
        // A node and a leaf take several cache lines.
        for line in (0..size).step_by(CACHE_LINE) {
            // SAFETY: SSE is part of x86-64, and a prefetch neither reads nor faults, whatever the
            // address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(begin.wrapping_add(line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (tree, at);
}
