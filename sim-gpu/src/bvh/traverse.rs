//! The traversal of trees on the CPU.

use super::MAX_DEPTH;
use super::wide::{Leaf4, WIDTH, WideBvh, WideChild, WideNode};

/// A bit for each of a node's boxes that matters, and the distance at which each begins.
pub type Entered<Distance> = (u32, [Distance; WIDTH]);

/// A bit for each box that `matters`.
#[inline(always)]
pub fn boxes_that(matters: impl Fn(usize) -> bool) -> u32 {
    (0..WIDTH).fold(0, |bits, i| bits | u32::from(matters(i)) << i)
}

/// A search for triangles in a tree.
pub trait Search {
    /// The type of distances.
    type Distance: PartialOrd + Copy + Default;

    /// The boxes of `node` that matter, and the distance at which each begins.
    fn enter(&self, node: &WideNode) -> Entered<Self::Distance>;

    /// Whether a box that begins at `distance` still matters when it is popped.
    fn matters(&self, distance: Self::Distance) -> bool;

    /// Examines the triangles of `leaf`.
    fn visit(&mut self, leaf: &Leaf4);
}

/// The nodes and leaves that a search has yet to visit. Callers reuse it, because filling a new
/// one takes longer than many a search.
pub struct Stack<Distance> {
    /// Each level of the tree pushes at most all children but one.
    waiting: [(WideChild, Distance); (WIDTH - 1) * MAX_DEPTH],
    height: usize,
}

impl<Distance: Copy + Default> Default for Stack<Distance> {
    fn default() -> Self {
        Self { waiting: [Default::default(); (WIDTH - 1) * MAX_DEPTH], height: 0 }
    }
}

impl<Distance: PartialOrd + Copy + Default> Stack<Distance> {
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.height = 0;
    }

    #[inline(always)]
    fn push(&mut self, child: (WideChild, Distance)) {
        self.waiting[self.height] = child;
        self.height += 1;
    }

    /// Pops children until one `matters`.
    #[inline(always)]
    fn pop(&mut self, search: &impl Search<Distance = Distance>) -> Option<WideChild> {
        loop {
            self.height = self.height.checked_sub(1)?;
            // Surfaces found since the push may have made the child irrelevant.
            let (child, distance) = self.waiting[self.height];
            if search.matters(distance) {
                return Some(child);
            }
        }
    }

    /// Pushes the `entered` children of `node`, the nearest last.
    #[inline(always)]
    fn push_sorted(&mut self, node: &WideNode, (mut entered, distances): Entered<Distance>) {
        let base = self.height;
        while entered != 0 {
            // The remainder changes nothing, and saves the bounds checks.
            let i = entered.trailing_zeros() as usize % WIDTH;
            entered &= entered - 1;
            // Insertion sort: there are eight children at most, and mostly three or four.
            let mut at = self.height;
            while at > base && self.waiting[at - 1].1 < distances[i] {
                self.waiting[at] = self.waiting[at - 1];
                at -= 1;
            }
            self.waiting[at] = (node.children[i], distances[i]);
            self.height += 1;
        }
    }
}

/// Visits the leaves at or below `from` that matter to `search`, those of the nearest boxes first.
#[inline(always)]
pub fn traverse<S: Search>(
    tree: &WideBvh,
    from: WideChild,
    stack: &mut Stack<S::Distance>,
    search: &mut S,
) {
    stack.clear();
    let mut at = Some(from);
    while let Some(child) = at {
        at = step(tree, child, stack, search);
    }
}

/// One step of [`traverse`]: visits the node or leaf `at`, and returns the next.
#[inline(always)]
pub(crate) fn step<S: Search>(
    tree: &WideBvh,
    at: WideChild,
    stack: &mut Stack<S::Distance>,
    search: &mut S,
) -> Option<WideChild> {
    if let Some(leaf) = at.leaf() {
        search.visit(&tree.leaves[leaf]);
        return stack.pop(search);
    }
    let node = &tree.nodes[at.node()];
    let (entered, distances) = search.enter(node);
    // All entered boxes but the lowest.
    let rest = entered & entered.wrapping_sub(1);
    if entered == 0 || rest & rest.wrapping_sub(1) != 0 {
        stack.push_sorted(node, (entered, distances));
        return stack.pop(search);
    }
    // One or two boxes, the common case, need no sort.
    let first = entered.trailing_zeros() as usize % WIDTH;
    if rest == 0 {
        return Some(node.children[first]);
    }
    let second = rest.trailing_zeros() as usize % WIDTH;
    let swap = distances[second] < distances[first];
    let (near, far) = if swap { (second, first) } else { (first, second) };
    stack.push((node.children[far], distances[far]));
    Some(node.children[near])
}
