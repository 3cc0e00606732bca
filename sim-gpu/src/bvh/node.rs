//! The records that casters read. `shaders/shared/bvh.wgsl` declares the same two; a test
//! compares their sizes and offsets.

use super::{BOX_PADDING, Bounds};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// An inner node: the boxes and the places of both children.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Node {
    /// Lowest corner of the left child's box.
    pub left_min: [f32; 3],
    /// The left child: a node, or the first triangle of a leaf.
    pub left: u32,
    /// Highest corner of the left child's box.
    pub left_max: [f32; 3],
    /// Triangles in the left leaf; 0 if the left child is a node.
    pub left_count: u32,
    /// Lowest corner of the right child's box.
    pub right_min: [f32; 3],
    /// The right child: a node, or the first triangle of a leaf.
    pub right: u32,
    /// Highest corner of the right child's box.
    pub right_max: [f32; 3],
    /// Triangles in the right leaf; 0 if the right child is a node.
    pub right_count: u32,
}

/// One triangle, corners in canonical order.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct LeafTriangle {
    /// The lowest corner in lexicographic order.
    pub a: [f32; 3],
    /// The triangle's index in its mesh.
    pub index: u32,
    /// The middle corner.
    pub b: [f32; 3],
    /// The length of the longest side, and 16u for the rounding of two corners in sheared space.
    pub longest: f32,
    /// The highest corner.
    pub c: [f32; 3],
    /// Fills the record up to WGSL's array stride.
    pub _padding_c: u32,
}

/// A child of a node under construction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Child {
    pub bounds: Bounds,
    pub first: u32,
    pub count: u32,
}

impl Child {
    /// A child that no ray hits, for trees of one leaf.
    pub(super) const NONE: Self = Self { bounds: Bounds::NOWHERE, first: 0, count: 1 };
}

impl Node {
    pub(super) fn new(left: Child, right: Child) -> Self {
        // Rounding leaves `Bounds::NOWHERE` as it is, by which a missing child is recognized.
        let [l, r] = [left, right].map(|child| child.bounds.padded(BOX_PADDING));
        Self {
            left_min: l.min.to_array(),
            left: left.first,
            left_max: l.max.to_array(),
            left_count: left.count,
            right_min: r.min.to_array(),
            right: right.first,
            right_max: r.max.to_array(),
            right_count: right.count,
        }
    }

    /// The node in a buffer where this tree begins at `node_base` and `triangle_base`.
    #[must_use]
    pub fn moved(mut self, node_base: u32, triangle_base: u32) -> Self {
        let base = |count: u32| if count == 0 { node_base } else { triangle_base };
        self.left += base(self.left_count);
        self.right += base(self.right_count);
        self
    }
}

/// `nodes`, or, if the whole tree is one leaf or empty, a node above it.
pub(super) fn with_root(mut nodes: Vec<Node>, root: Child) -> Vec<Node> {
    if nodes.is_empty() {
        // Traversal begins at a node, so that a single leaf needs one.
        let leaf = if root.count == 0 { Child::NONE } else { root };
        nodes.push(Node::new(leaf, Child::NONE));
    }
    nodes
}

impl LeafTriangle {
    pub(super) fn new(corners: [[f32; 3]; 3], index: u32) -> Self {
        let [a, b, c] = canonical_corners(corners);
        let length = |[p, q]: [[f32; 3]; 2]| Vec3::from_array(p).distance(Vec3::from_array(q));
        const ROUNDING: f32 = 16.0 / 16_777_216.0;
        let longest = [[a, b], [b, c], [a, c]].map(length).into_iter().fold(0.0, f32::max);
        let longest = longest + ROUNDING;
        Self { a, index, b, longest, c, _padding_c: 0 }
    }
}

/// The corners in lexicographic order of their coordinates.
///
/// Two triangles that share an edge then evaluate its edge function on the same endpoints in the
/// same order, so that both get exactly opposite values however the compiler contracts it. The
/// order is by position, not by index, because CAD files repeat vertices.
#[must_use]
pub fn canonical_corners(mut corners: [[f32; 3]; 3]) -> [[f32; 3]; 3] {
    corners.sort_unstable_by(|p, q| {
        // A total order, so that -0 and 0 do not depend on the order of the file.
        let order = |i: usize| p[i].total_cmp(&q[i]);
        order(0).then_with(|| order(1)).then_with(|| order(2))
    });
    corners
}
