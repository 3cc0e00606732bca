//! An object ready for casting: its mesh, and its triangles of glass.

use std::ops::Range;

use edgepuck_mesh::TriangleMesh;

use crate::tessellation::bounds;

/// An object at real size. It stands on the ground at height 0, with the middle of its footprint at
/// the origin.
#[derive(Clone, Debug)]
pub struct Object {
    /// The mesh, in metres; x points forward, z up.
    pub mesh: TriangleMesh,
    /// The triangles of glass, which are the last ones; empty without glass. Glass transmits or
    /// mirrors most of a beam and returns little.
    pub glass: Range<u32>,
}

/// Moves `mesh` so that its lowest vertex is at height 0 and the middle of its footprint at the
/// origin.
#[doc(hidden)]
pub fn stand(mesh: &mut TriangleMesh) {
    let [low, high] = bounds(mesh);
    let origin = ((low + high) / 2.0).truncate().extend(low.z);
    mesh.vertices.iter_mut().for_each(|vertex| *vertex -= origin);
}
