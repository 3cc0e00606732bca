use edgepuck_assets::SCENE_RECIPES;
use edgepuck_mesh::MeshError;
use formats::FormatError;
use sim_gpu::errors::CastError;
use sim_gpu::errors::ScanError;
use sim_gpu::errors::{ConfigError, InvalidValue};
use std::path::PathBuf;

/// An error in drawing, scanning or packing scenes.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The recipe, a sensor profile or a mesh is missing or invalid, the adapter fails, or a file
    /// cannot be written.
    #[error(transparent)]
    Sim(#[from] sim_gpu::Error),
    /// No recipe has this name or path.
    #[error(
        "{}: expected a recipe's file, or one of {}", .0.display(),
        SCENE_RECIPES.map(|(name, _)| name).join(", ")
    )]
    NoRecipe(PathBuf),
    /// A user's mesh cannot be scaled to a height, because it is flat.
    #[error("{}: expected a mesh with a height, found all of it at one height", file.display())]
    FlatMesh {
        /// The mesh file.
        file: PathBuf,
    },
    /// The recipe uses a folder of meshes that holds none.
    #[error("{}: expected a folder with OBJ, OFF, PLY, STL or glTF files, {cause}", folder.display())]
    NoMeshes {
        /// The folder.
        folder: PathBuf,
        /// The files or the error that were found instead.
        cause: String,
    },
    /// The recipe uses no folder of meshes, but one was named.
    #[error("{}: no object of this recipe is of kind \"mesh\": add one to a recipe of your own, or name no meshes", .0.display())]
    UnusedMeshes(PathBuf),
    /// The sweep cannot be segmented.
    #[error("the sweep cannot be segmented: {0}")]
    Segment(String),
}

/// Makes `?` turn these errors into [`SceneError::Sim`].
macro_rules! convert {
    ($($error:ty),+) => {
        $(impl From<$error> for SceneError {
            fn from(error: $error) -> Self {
                Self::Sim(error.into())
            }
        })+
    };
}
convert!(CastError, ConfigError, FormatError, InvalidValue, MeshError, ScanError);
