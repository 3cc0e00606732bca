//! Triangle meshes in f64, as files hold them.
//!
//! [`tree`] finds the meshes of a dataset, [`load()`] reads one, [`frame`]
//! turns and scales it into the world, [`validate`] says which of its triangles
//! a ray can meet.

mod error;
mod format;
pub mod frame;
mod line_feeder;
mod load;
mod obj;
mod off;
mod ply;
mod stl;
mod tokens;
pub mod tree;
mod triangle_mesh;
pub mod validate;

pub use error::{Malformed, MeshError, ParseError, Part};
pub use format::{MeshFormat, mesh_extensions};
pub use load::{LoadedMesh, load, parse};
pub use triangle_mesh::{Mesh, Parsed};
