//! Triangle meshes in f64, as files hold them.

mod appearance;
mod assembly;
mod error;
mod file;
mod format;
pub mod frame;
mod gltf;
mod load;
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

pub(crate) use appearance::{Appearance, Colour, ColourMap, colours, file_name};
pub use assembly::{AssembledMesh, Assembly, BaseColour, Part};
pub use error::{Malformed, MeshError, ParseError};
pub(crate) use file::read;
pub use format::{MeshFormat, mesh_extensions};
pub use load::{
    LoadedMesh, NO_AREA, check, flat, load, load_assembly, load_bytes, load_hashed, parse,
    parse_assembly,
};
pub use triangle_mesh::{Parsed, TriangleMesh};
