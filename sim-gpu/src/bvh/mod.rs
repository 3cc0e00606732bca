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

use glam::Vec3A;
use std::sync::OnceLock;

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
/// A box must not reject a ray that truly meets a triangle inside it. In units of 2^-24, the ray and
/// the triangle are off by 17 (`cpu::intersect`), and a slab test moves the planes of a box by 4 more
/// (`cpu::traverse`). 2^-18 is 64 such units.
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
    /// The tree that the CPU searches.
    pub wide: WideBvh,
    builder: Builder,
    two_wide: OnceLock<TwoWide>,
}

/// The tree that shaders search.
#[derive(Clone, Debug)]
pub struct TwoWide {
    /// Nodes; the root is number 0. Never empty.
    pub nodes: Vec<Node>,
    /// Triangles in leaf order.
    pub triangles: Vec<LeafTriangle>,
}

/// Above this number of triangles, the GPU's tree (90 bytes a triangle) is freed once the CPU's is built
/// from it, and built again if a GPU casts.
const KEPT_UP_TO: usize = 1 << 20;

/// As small as its numbers: to sort many of them takes most of the time of a build.
#[derive(Clone, Copy)]
struct Primitive {
    min: [f32; 3],
    triangle: u32,
    max: [f32; 3],
    _padding: u32,
}

impl Primitive {
    fn new(corners: &[[f32; 3]; 3], triangle: u32) -> Self {
        let Bounds { min, max } = Bounds::around(corners);
        Self { min: min.to_array(), triangle, max: max.to_array(), _padding: 0 }
    }

    #[inline]
    fn bounds(&self) -> Bounds {
        Bounds { min: Vec3A::from_array(self.min), max: Vec3A::from_array(self.max) }
    }
}

impl Bvh {
    /// Builds a hierarchy over triangles with these `indices`, which casters answer with. `corners`
    /// gives those of the nth, in the unit frame.
    #[must_use]
    pub fn build(
        builder: Builder,
        indices: &[u32],
        corners: impl Fn(usize) -> [[f32; 3]; 3],
    ) -> Self {
        let (nodes, order) = build_nodes(builder, indices.len(), &corners);
        let triangle = |at: usize| leaf_triangle(order[at], indices, &corners);
        let wide = WideBvh::collapsed(&nodes, &triangle);
        let two_wide = OnceLock::new();
        if indices.len() <= KEPT_UP_TO {
            let triangles = (0..indices.len()).map(triangle).collect();
            two_wide.get_or_init(|| TwoWide { nodes, triangles });
        }
        Self { wide, builder, two_wide }
    }

    /// The tree that shaders search.
    #[must_use]
    pub fn two_wide(&self) -> &TwoWide {
        // Outside of `get_or_init`: the pool that builds may run a task that wants the same tree.
        self.two_wide.get().unwrap_or_else(|| {
            let mut all: Vec<(u32, [[f32; 3]; 3])> = self.wide.triangles().collect();
            // In the order of the first build, which gives the same tree.
            all.sort_unstable_by_key(|(index, _)| *index);
            let (indices, corners): (Vec<u32>, Vec<_>) = all.into_iter().unzip();
            let corners = |nth: usize| corners[nth];
            let (nodes, order) = build_nodes(self.builder, indices.len(), &corners);
            let triangle = |nth: &u32| leaf_triangle(*nth, &indices, &corners);
            let triangles = order.iter().map(triangle).collect();
            self.two_wide.get_or_init(|| TwoWide { nodes, triangles })
        })
    }

    /// Bytes of the trees that there are.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let of_shaders = self
            .two_wide
            .get()
            .map_or(0, |tree| size_of_val(&tree.nodes[..]) + size_of_val(&tree.triangles[..]));
        of_shaders + self.wide.bytes()
    }
}

/// Triangle number `nth` of those with these `indices` and `corners`.
fn leaf_triangle(
    nth: u32,
    indices: &[u32],
    corners: &impl Fn(usize) -> [[f32; 3]; 3],
) -> LeafTriangle {
    LeafTriangle::new(corners(nth as usize), indices[nth as usize])
}

/// The two-wide nodes over `n` triangles, and the number of the triangle at each place of the leaves.
fn build_nodes(
    builder: Builder,
    n: usize,
    corners: &impl Fn(usize) -> [[f32; 3]; 3],
) -> (Vec<Node>, Vec<u32>) {
    let primitive = |nth: usize| Primitive::new(&corners(nth), nth as u32);
    let mut primitives: Vec<Primitive> = (0..n).map(primitive).collect();
    // Builders also sort the primitives into leaf order.
    let nodes = match builder {
        Builder::Sah => sah::build(&mut primitives),
        Builder::Morton => morton::build(&mut primitives),
    };
    (nodes, primitives.iter().map(|p| p.triangle).collect())
}
