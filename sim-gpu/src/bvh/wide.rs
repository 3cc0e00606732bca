//! The hierarchy that the CPU searches: nodes of eight children and leaves of up to four
//! triangles, with each coordinate of all of them side by side.
//!
//! Testing eight boxes takes little longer than testing one, and the tree is a third as deep:
//! Dammertz, Hanika, Keller, "Shallow bounding volume hierarchies for fast SIMD ray tracing of
//! incoherent rays", EGSR 2008.

use super::{Bounds, LeafTriangle, MAX_LEAF, Node};
use glam::Vec3A;
use std::iter::repeat;

/// How many children a node has.
pub const WIDTH: usize = 8;

/// How many triangles a leaf holds at most.
pub const LEAF: usize = 4;

const _: () = assert!(MAX_LEAF <= LEAF);

/// An inner node: the boxes and the places of its children. A missing child has the box
/// [`Bounds::NOWHERE`] and is the empty leaf 0, because rays with NaN coordinates enter every box.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct WideNode {
    /// The lowest corner of each child's box, x of all, y of all, z of all; then the highest ones.
    pub boxes: [[[f32; WIDTH]; 3]; 2],
    /// The children.
    pub children: [WideChild; WIDTH],
}

/// The place of a child: the number of a node or, with the highest bit set, of a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WideChild(u32);

/// A leaf of up to four triangles. Unused places hold a triangle without area, which no ray meets.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug)]
pub struct Leaf4 {
    /// Each triangle's corners in canonical order: of the lowest corners x of all,
    /// y of all, z of all, then of the middle ones and of the highest.
    pub corners: [[[f32; LEAF]; 3]; 3],
    /// `LeafTriangle::longest` of each; -1 in unused places, so that the test rejects every ray.
    pub longest: [f32; LEAF],
    pub(crate) indices: [u32; LEAF],
    /// How many triangles there are.
    pub len: u32,
}

/// A tree of wide nodes. The root is node 0.
#[derive(Clone, Debug)]
pub struct WideBvh {
    /// Never empty.
    pub nodes: Vec<WideNode>,
    /// The leaves. Leaf 0 is empty.
    pub leaves: Vec<Leaf4>,
}

impl WideChild {
    /// The root of every tree.
    pub const ROOT: Self = Self(0);
    const IS_LEAF: u32 = 1 << 31;
    const NOTHING: Self = Self(Self::IS_LEAF);

    #[inline]
    pub(crate) fn leaf(self) -> Option<usize> {
        (self.0 & Self::IS_LEAF != 0).then_some((self.0 & !Self::IS_LEAF) as usize)
    }

    /// The number of the node; not meaningful for a leaf.
    #[inline]
    pub(crate) fn node(self) -> usize {
        self.0 as usize
    }
}

impl WideNode {
    const EMPTY: Self =
        Self { boxes: [[[f32::MAX; WIDTH]; 3]; 2], children: [WideChild::NOTHING; WIDTH] };

    /// The box of child `i`.
    #[must_use]
    pub fn bounds(&self, i: usize) -> Bounds {
        let [min, max] = self.boxes.map(|[x, y, z]| Vec3A::new(x[i], y[i], z[i]));
        Bounds { min, max }
    }

    fn set(&mut self, i: usize, bounds: Bounds, child: WideChild) {
        for axis in 0..3 {
            self.boxes[0][axis][i] = bounds.min[axis];
            self.boxes[1][axis][i] = bounds.max[axis];
        }
        self.children[i] = child;
    }
}

impl Leaf4 {
    const NOTHING: Self = Self {
        corners: [[[0.0; LEAF]; 3]; 3],
        longest: [-1.0; LEAF],
        indices: [u32::MAX; LEAF],
        len: 0,
    };

    /// A leaf of one to four `triangles`.
    fn new(mut triangles: impl ExactSizeIterator<Item = LeafTriangle>) -> Self {
        let len = triangles.len() as u32;
        let first = triangles.next().expect("invariant: a leaf has a triangle");
        // A point of the first triangle stays inside the box of the leaf.
        let without_area = LeafTriangle { b: first.a, c: first.a, longest: -1.0, ..first };
        let mut leaf = Self { len, ..Self::NOTHING };
        let places = std::iter::once(first).chain(triangles).chain(repeat(without_area));
        for (i, triangle) in places.take(LEAF).enumerate() {
            (leaf.indices[i], leaf.longest[i]) = (triangle.index, triangle.longest);
            for (corner, from) in leaf.corners.iter_mut().zip([triangle.a, triangle.b, triangle.c])
            {
                (0..3).for_each(|axis| corner[axis][i] = from[axis]);
            }
        }
        leaf
    }

    /// Each triangle's index in its mesh.
    #[must_use]
    #[inline(always)]
    pub fn indices(&self) -> &[u32] {
        // The remainder changes nothing, and saves the bounds check.
        &self.indices[..self.len as usize % (LEAF + 1)]
    }
}

impl WideBvh {
    /// Collapses the two-wide tree of `nodes`, whose leaves have these `triangles`: the wide tree has
    /// some of its boxes.
    #[must_use]
    pub(super) fn collapsed(nodes: &[Node], triangles: &impl Fn(usize) -> LeafTriangle) -> Self {
        let to = Self { nodes: vec![WideNode::EMPTY], leaves: vec![Leaf4::NOTHING] };
        let mut collapse = Collapse { nodes, triangles, costs: Vec::new(), to };
        collapse.count_costs();
        collapse.fill(0, 0);
        collapse.to
    }

    /// The index and the corners, in canonical order, of each triangle.
    pub fn triangles(&self) -> impl Iterator<Item = (u32, [[f32; 3]; 3])> + '_ {
        self.leaves.iter().flat_map(|leaf| {
            let corners = |i: usize| leaf.corners.map(|corner| corner.map(|axis| axis[i]));
            leaf.indices().iter().enumerate().map(move |(i, &index)| (index, corners(i)))
        })
    }

    /// Bytes of nodes and leaves together.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }
}

/// Collapses a tree of two-wide nodes so that its search costs least by the surface area
/// heuristic: Ylitie, Karras, Laine, "Efficient incoherent ray traversal on GPUs through
/// compressed wide BVHs", HPG 2017, section 3.1.
struct Collapse<'a, Triangles> {
    nodes: &'a [Node],
    triangles: &'a Triangles,
    /// By two-wide node.
    costs: Vec<Cost>,
    to: WideBvh,
}

/// The cost of searching the subtree of a two-wide node, in areas of its box.
#[derive(Clone, Copy, Default)]
struct Cost {
    /// The cost if it becomes at most 1, 2, ... children of one wide node.
    as_children: [f32; WIDTH],
    first: u32,
    count: u32,
    is_leaf: bool,
}

#[derive(Clone, Copy)]
struct Subtree {
    bounds: Bounds,
    /// `None` for a leaf; a missing child is a leaf without triangles.
    node: Option<u32>,
    first: u32,
    count: u32,
}

impl<Triangles: Fn(usize) -> LeafTriangle> Collapse<'_, Triangles> {
    fn children(&self, at: usize) -> [Subtree; 2] {
        let node = &self.nodes[at];
        let child = |min, max, child: u32, count| {
            let bounds = Bounds { min: Vec3A::from_array(min), max: Vec3A::from_array(max) };
            // Trees of a single leaf have such a child.
            if bounds == Bounds::NOWHERE {
                return Subtree { bounds, node: None, first: 0, count: 0 };
            }
            if count > 0 {
                return Subtree { bounds, node: None, first: child, count };
            }
            let Cost { first, count, .. } = self.costs[child as usize];
            Subtree { bounds, node: Some(child), first, count }
        };
        [
            child(node.left_min, node.left_max, node.left, node.left_count),
            child(node.right_min, node.right_max, node.right, node.right_count),
        ]
    }

    /// The cost of `subtree` as at most 1, 2, ... children. A visit of a leaf costs as much as a
    /// visit of a node (`bench embree`).
    fn costs(&self, subtree: &Subtree) -> [f32; WIDTH] {
        match subtree.node {
            Some(node) => self.costs[node as usize].as_children,
            None if subtree.count == 0 => [0.0; WIDTH],
            None => [subtree.bounds.half_area(); WIDTH],
        }
    }

    /// The least cost of two subtrees as `n` children, two or more, and how many of these the
    /// left one becomes.
    fn distributed(&self, [left, right]: &[[f32; WIDTH]; 2], n: usize) -> (f32, usize) {
        let split = |on_left: usize| (left[on_left - 1] + right[n - on_left - 1], on_left);
        let first = split(1);
        (2..n).map(split).fold(first, |best, next| if next.0 < best.0 { next } else { best })
    }

    fn count_costs(&mut self) {
        self.costs = vec![Cost::default(); self.nodes.len()];
        // Builders put nodes before their children.
        for at in (0..self.nodes.len()).rev() {
            let children = self.children(at);
            let [left, right] = &children;
            let area = left.bounds.union(right.bounds).half_area();
            let count = left.count + right.count;
            // Builders put the triangles of a subtree side by side, the left ones first.
            let first = if left.count > 0 { left.first } else { right.first };
            let costs = children.each_ref().map(|child| self.costs(child));
            let as_node = self.distributed(&costs, WIDTH).0 + area;
            let is_leaf = count as usize <= LEAF;
            // A subtree of few triangles becomes one leaf, which costs a single visit.
            let mut least = if is_leaf { area } else { as_node };
            let mut as_children = [least; WIDTH];
            for n in 2..=WIDTH {
                least = least.min(self.distributed(&costs, n).0);
                as_children[n - 1] = least;
            }
            self.costs[at] = Cost { as_children, first, count, is_leaf };
        }
    }

    /// Fills wide node `to` with the children that two-wide node `at` becomes.
    fn fill(&mut self, at: u32, to: usize) {
        let mut subtrees = Vec::with_capacity(WIDTH);
        self.gather(at, WIDTH, &mut subtrees);
        for (i, subtree) in subtrees.into_iter().enumerate() {
            let child = match subtree.node {
                Some(at) => {
                    // Allocated before its own children, which stand behind it.
                    let node = self.to.nodes.len();
                    self.to.nodes.push(WideNode::EMPTY);
                    self.fill(at, node);
                    WideChild(node as u32)
                }
                None => {
                    let range = subtree.first as usize..(subtree.first + subtree.count) as usize;
                    self.to.leaves.push(Leaf4::new(range.map(self.triangles)));
                    WideChild((self.to.leaves.len() - 1) as u32 | WideChild::IS_LEAF)
                }
            };
            self.to.nodes[to].set(i, subtree.bounds, child);
        }
    }

    /// Gathers the at most `n` children, two or more, that two-wide node `at` becomes.
    fn gather(&self, at: u32, n: usize, to: &mut Vec<Subtree>) {
        let children = self.children(at as usize);
        let costs = children.each_ref().map(|child| self.costs(child));
        let on_left = self.distributed(&costs, n).1;
        for (child, costs, n) in [(0, costs[0], on_left), (1, costs[1], n - on_left)] {
            let child = children[child];
            // The fewest children of the same cost.
            let n = (1..n).find(|&fewer| costs[fewer - 1] <= costs[n - 1]).unwrap_or(n);
            match child.node {
                Some(node) if n > 1 => self.gather(node, n, to),
                Some(node) if self.costs[node as usize].is_leaf => {
                    to.push(Subtree { node: None, ..child });
                }
                None if child.count == 0 => {}
                _ => to.push(child),
            }
        }
    }
}
