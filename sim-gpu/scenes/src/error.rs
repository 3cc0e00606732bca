//! The errors of this crate.

use formats::FormatError;
use sim_gpu::internals::cast_error::CastError;
use sim_gpu::internals::config::{ConfigError, InvalidValue};
use sim_gpu::internals::mesh::MeshError;
use sim_gpu::internals::scan::ScanError;
use std::path::PathBuf;

/// An error in drawing, scanning or packing scenes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The recipe, or a sensor profile that it names, is missing or invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A value of the recipe does not fit a sensor.
    #[error(transparent)]
    Value(#[from] InvalidValue),
    /// A user's mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A user's mesh cannot be scaled to a height, because it is flat.
    #[error("{}: expected a mesh with a height, found all of it at one height", file.display())]
    FlatMesh {
        /// The mesh file.
        file: PathBuf,
    },
    /// The recipe uses a folder of meshes that holds none.
    #[error("{}: expected a folder with OBJ, OFF, PLY or STL files, {cause}", folder.display())]
    NoMeshes {
        /// The folder.
        folder: PathBuf,
        /// What was found instead.
        cause: String,
    },
    /// The caster failed.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The adapter does not open.
    #[error(transparent)]
    Caster(#[from] CastError),
    /// The sweep cannot be segmented.
    #[error("the sweep cannot be segmented: {0}")]
    Segment(String),
    /// A file cannot be written.
    #[error(transparent)]
    Format(#[from] FormatError),
}
