//! Triangle meshes in f64 from OBJ, OFF, PLY, STL and glTF files, robots in URDF, and folders of meshes
//! with their classes.
//!
//! ```no_run
//! use edgepuck_mesh::frame::{Normalize, to_world};
//!
//! let loaded = edgepuck_mesh::load("chair.obj".as_ref())?;
//! // z up, scaled to the unit sphere around the origin.
//! let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere);
//! println!("{} triangles", world.mesh.triangles.len());
//! # Ok::<(), edgepuck_mesh::MeshError>(())
//! ```

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod assembly;
mod error;
mod file;
mod format;
pub mod frame;
mod gltf;
pub mod import;
mod load;
pub mod material;
mod named_faces;
mod obj;
mod off;
mod ply;
mod polygon;
mod stl;
#[cfg(test)]
mod testing;
mod tokens;
pub mod tree;
mod triangle_mesh;
pub mod unit_frame;
pub mod validate;

pub use assembly::{AssembledMesh, Assembly, BaseColour, Part};
pub use error::{Malformed, MeshError, ParseError};
pub use format::{MeshFormat, mesh_extensions};
pub use load::{
    LoadedMesh, check, flat, load, load_assembly, load_bytes, load_hashed, parse, parse_assembly,
};
pub use triangle_mesh::{Parsed, TriangleMesh};
