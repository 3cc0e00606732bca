//! The search through a tree that all users on the CPU share.

use super::MAX_DEPTH;
use super::wide::{Leaf4, WIDTH, WideBvh, WideChild, WideNode};

/// Which of a node's boxes matter, a bit each, and how far away each begins.
pub type Entered<Distance> = (u32, [Distance; WIDTH]);

/// The boxes that `matter`, a bit each.
#[inline(always)]
pub fn boxes_that(matter: impl Fn(usize) -> bool) -> u32 {
    (0..WIDTH).fold(0, |bits, i| bits | u32::from(matter(i)) << i)
}

/// What is looked for in a tree.
pub trait Search {
    /// What says how far away something begins.
    type Distance: PartialOrd + Copy + Default;

    /// Which boxes of `node` matter, and how far away each begins.
    fn enter(&self, node: &WideNode) -> Entered<Self::Distance>;

    /// Whether what begins at `distance` still matters, now that its turn has come.
    fn matters(&self, distance: Self::Distance) -> bool;

    /// Looks at the triangles of `leaf`.
    fn visit(&mut self, leaf: &Leaf4);
}

/// What a search has still to visit. The caller keeps it, so that a search does
/// not begin by filling it.
pub struct Stack<Distance> {
    /// On each level of the tree all children but one may have to wait.
    waiting: [(WideChild, Distance); (WIDTH - 1) * MAX_DEPTH],
    height: usize,
}

impl<Distance: Copy + Default> Default for Stack<Distance> {
    fn default() -> Self {
        Self { waiting: [Default::default(); (WIDTH - 1) * MAX_DEPTH], height: 0 }
    }
}

impl<Distance: PartialOrd + Copy + Default> Stack<Distance> {
    /// Forgets what a search that has ended early left.
    #[inline(always)]
    pub(crate) fn clear(&mut self) {
        self.height = 0;
    }

    #[inline(always)]
    fn push(&mut self, child: (WideChild, Distance)) {
        self.waiting[self.height] = child;
        self.height += 1;
    }

    /// Takes the last child that `matters`, and forgets those after it.
    #[inline(always)]
    fn pop(&mut self, search: &impl Search<Distance = Distance>) -> Option<WideChild> {
        loop {
            self.height = self.height.checked_sub(1)?;
            let (child, distance) = self.waiting[self.height];
            if search.matters(distance) {
                return Some(child);
            }
        }
    }

    /// Pushes the children that are `entered`, the nearest last.
    #[inline(always)]
    fn push_sorted(&mut self, node: &WideNode, (mut entered, distances): Entered<Distance>) {
        let base = self.height;
        while entered != 0 {
            let i = entered.trailing_zeros() as usize % WIDTH;
            entered &= entered - 1;
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

/// Visits the leaves at or below `from` that matter to `search`, nearer ones first.
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

/// One step of [`traverse`]: visits the node or leaf `at`, and says which is next.
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
    let rest = entered & entered.wrapping_sub(1);
    if entered == 0 || rest & rest.wrapping_sub(1) != 0 {
        stack.push_sorted(node, (entered, distances));
        return stack.pop(search);
    }
    // Most often one or two are entered: these need no sort.
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
