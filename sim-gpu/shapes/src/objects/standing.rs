//! An object as it is cast: its mesh, and which of it is glass.

use std::ops::Range;

use sim_gpu::mesh::Mesh;

use crate::primitives::Builder;
use crate::tessellation::bounds;

/// Chords of curved surfaces are about this long, metres: a beam of 0.2 degrees
/// at 30 m is 0.1 m wide.
const EDGE_M: f64 = 0.12;

/// Flat surfaces are divided as little as possible.
const FLAT_RATIO: f64 = 1e6;

/// An object at real size: it stands on the ground at height 0, and the middle of
/// its footprint is the origin.
#[derive(Clone, Debug)]
pub struct Object {
    /// Lengths are metres, x points forward, z up.
    pub mesh: Mesh,
    /// The triangles of glass, which come last; empty if there are none. A laser
    /// passes through glass or is mirrored, and returns little.
    pub glass: Range<u32>,
}

impl Object {
    /// What `build` builds.
    pub(super) fn built(build: impl FnOnce(&mut Builder)) -> Self {
        let mut builder = Builder::new(EDGE_M, FLAT_RATIO);
        build(&mut builder);
        let (mut mesh, glass) = builder.finish_with_glass();
        stand(&mut mesh);
        Self { mesh, glass }
    }
}

/// Moves `mesh` so that its lowest vertex is at height 0 and the middle of its
/// footprint at the origin.
pub fn stand(mesh: &mut Mesh) {
    let [low, high] = bounds(mesh);
    let origin = ((low + high) / 2.0).truncate().extend(low.z);
    mesh.vertices.iter_mut().for_each(|vertex| *vertex -= origin);
}
