//! Triangle meshes in f64, as files hold them.

use glam::DVec3;

/// A triangle mesh in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the file's units, `[n_vertices]`, all finite.
    pub vertices: Vec<DVec3>,
    /// Corners as indices into `vertices`, `[n_triangles, 3]`, in the file's
    /// order; all in range.
    pub triangles: Vec<[u32; 3]>,
}
