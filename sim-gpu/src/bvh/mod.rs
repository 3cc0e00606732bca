//! Bounding volume hierarchies over triangles in the unit frame.
//!
//! Shaders read two-wide nodes of 64 bytes that hold the boxes of both children (Aila and Laine
//! 2009), and triangles of 48 bytes, those of one leaf side by side. The CPU searches the same
//! tree collapsed to eight-wide nodes.

mod bounds;
mod choose;
mod morton;
mod node;
mod sah;
mod traverse;
mod validate;
mod wide;

pub use bounds::Bounds;
pub use node::{LeafTriangle, Node, canonical_corners};
pub(crate) use traverse::step;
pub use traverse::{Entered, Search, Stack, boxes_that, traverse};
pub use validate::assert_well_formed;
pub use wide::{LEAF, Leaf4, WIDTH, WideBvh, WideChild, WideNode};

/// The longest path from the root to a leaf; casters size their stacks by it.
pub const MAX_DEPTH: usize = 64;

/// The depth below which builders halve nodes instead of choosing a split, so that
/// `HALVING_DEPTH + log2(triangles) <= MAX_DEPTH` for up to 2^31 triangles.
const HALVING_DEPTH: usize = 32;

const MAX_LEAF: usize = 4;

/// How far boxes reach beyond their triangles, in the unit frame, whose coordinates are at most 1.
///
/// A box must not reject a ray that a triangle inside it accepts. By rounding, a triangle test
/// may accept a ray that passes 48 units of 2^-24 outside the triangle (`cpu::intersect`), and a
/// slab test moves the planes of a box by 4 more (`cpu::traverse`). 2^-18 is 64 such units.
const BOX_PADDING: f32 = 1.0 / (1 << 18) as f32;

/// An algorithm that builds hierarchies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Builder {
    /// Binned surface area heuristic (Wald 2007), in parallel: the fastest tree to trace.
    Sah,
    /// Midpoint splits along a Morton curve (Lauterbach et al. 2009): the fastest tree to build.
    Morton,
}

/// A hierarchy over the triangles of one mesh.
#[derive(Clone, Debug)]
pub struct Bvh {
    /// Nodes; the root is number 0. Never empty.
    pub nodes: Vec<Node>,
    /// Triangles in leaf order.
    pub triangles: Vec<LeafTriangle>,
    /// The same tree as the CPU searches it.
    pub wide: WideBvh,
}

#[derive(Clone, Copy)]
struct Primitive {
    bounds: Bounds,
    triangle: u32,
}

impl Bvh {
    /// Builds a hierarchy over triangles with these `corners`, in the unit frame, and these
    /// `indices`, which casters answer with. Both `[n_triangles]`.
    #[must_use]
    pub fn build(builder: Builder, corners: &[[[f32; 3]; 3]], indices: &[u32]) -> Self {
        debug_assert_eq!(corners.len(), indices.len());
        let mut primitives: Vec<Primitive> = corners
            .iter()
            .zip(0..)
            .map(|(corners, triangle)| Primitive { bounds: Bounds::around(corners), triangle })
            .collect();
        // Builders also sort the primitives into leaf order.
        let nodes = match builder {
            Builder::Sah => sah::build(&mut primitives),
            Builder::Morton => morton::build(&mut primitives),
        };
        let triangles: Vec<LeafTriangle> = primitives
            .iter()
            .map(|p| LeafTriangle::new(corners[p.triangle as usize], indices[p.triangle as usize]))
            .collect();
        let wide = WideBvh::collapsed(&nodes, &triangles);
        Self { nodes, triangles, wide }
    }

    /// Bytes of both trees.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.triangles[..]) + self.wide.bytes()
    }
}
