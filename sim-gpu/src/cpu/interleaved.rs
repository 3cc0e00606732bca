//! Rays that run in all directions, several at once, each a step in its turn: while
//! one waits for a node to come from memory, the others go on. Kocberber, Falsafi,
//! Grot, "Asynchronous memory access chaining", VLDB 2015.

use super::traverse::{Along, Instructions, Nearest, Prepared};
use crate::bvh::{Stack, WideBvh, WideChild, step};
use crate::ray::TraceRay;
use bytemuck::Zeroable;
use std::iter::repeat_with;

/// A tree of so many bytes stays in the cache, where one ray after another is faster:
/// measured with 1,000 to 100,000 triangles (`bench sim`).
const CACHED: usize = 2 << 20;

/// How many rays are under way in a larger tree: more make none faster.
const UNDER_WAY: usize = 8;

/// The rays under way.
pub struct Interleaved {
    walks: Vec<Walk>,
}

/// A ray under way.
struct Walk {
    /// Its number.
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
    /// Room for as many rays as `tree` makes worthwhile.
    pub fn for_tree(tree: &WideBvh) -> Self {
        let nowhere = TraceRay::zeroed();
        let walk = || Walk {
            number: 0,
            ray: Prepared::new(&nowhere),
            nearest: Nearest::NONE,
            stack: Stack::default(),
            at: WideChild::ROOT,
        };
        let under_way = if tree.bytes() <= CACHED { 1 } else { UNDER_WAY };
        Self { walks: repeat_with(walk).take(under_way).collect() }
    }

    /// The code of each of `rays`.
    #[inline(always)]
    pub fn trace(
        &mut self,
        tree: &WideBvh,
        rays: &[TraceRay],
        codes: &mut [u32],
        by: impl Instructions,
    ) {
        let mut to_begin = rays.iter().enumerate();
        let under_way = self.walks.len().min(rays.len());
        let mut walks = &mut self.walks[..under_way];
        walks.iter_mut().zip(&mut to_begin).for_each(|(walk, ray)| walk.begin(ray));
        while !walks.is_empty() {
            let mut turn = 0;
            while turn < walks.len() {
                let Walk { number, ray, nearest, stack, at } = &mut walks[turn];
                if let Some(next) = step(tree, *at, stack, &mut Along { ray, nearest, by }) {
                    *at = next;
                    fetch(tree, next);
                    turn += 1;
                    continue;
                }
                codes[*number] = nearest.code(rays[*number].skipped);
                if let Some(next) = to_begin.next() {
                    walks[turn].begin(next);
                } else {
                    let last = walks.len() - 1;
                    walks.swap(turn, last);
                    walks = &mut walks[..last];
                }
            }
        }
    }
}

/// Asks for the node or leaf `at` to be brought from memory.
#[inline(always)]
fn fetch(tree: &WideBvh, at: WideChild) {
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
        for line in (0..size).step_by(CACHE_LINE) {
            // SAFETY: a prefetch reads nothing, whatever the address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(begin.wrapping_add(line)) };
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (tree, at);
}
