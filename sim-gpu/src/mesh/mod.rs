//! Triangle meshes in f64, as files hold them.
//!
//! [`tree`] finds the meshes of a dataset, [`load()`] reads one, [`frame`]
//! turns and scales it into the world, [`census`] says which of its triangles
//! a ray can meet.

use glam::DVec3;

pub mod census;
mod error;
pub mod frame;
mod line_feeder;
mod load;
mod obj;
mod off;
mod ply;
mod stl;
pub mod tree;
mod words;

pub use error::{Malformed, MeshError, ParseError, Part};
pub use load::{LoadedMesh, MeshFormat, Parsed, load, mesh_extensions, parse};

/// A triangle mesh in f64.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Vertex positions in the file's units, `[n_vertices]`, all finite.
    pub vertices: Vec<DVec3>,
    /// Corners as indices into `vertices`, `[n_triangles, 3]`, in the file's
    /// order; all in range.
    pub triangles: Vec<[u32; 3]>,
}
