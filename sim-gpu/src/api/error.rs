//! The errors of the root's types.

use crate::cast_error::CastError;
use crate::config::{ConfigError, InvalidValue};
use crate::scan::ScanError;
use edgepuck_mesh::MeshError;
use edgepuck_mesh::material::MaterialError;
use formats::FormatError;

/// Why a mesh, a sensor or a scene cannot be read, scanned or saved. The message names the file,
/// the line or key, and the cause.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A mesh cannot be read, or its triangles are wrong.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The materials of a mesh cannot be read.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// A file of settings (a scene or a sensor's profile) is wrong.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A value is outside of its bounds.
    #[error(transparent)]
    Value(#[from] InvalidValue),
    /// The adapter is missing or failed.
    #[error(transparent)]
    Cast(#[from] CastError),
    /// A scan cannot be saved.
    #[error(transparent)]
    Format(#[from] FormatError),
}

impl From<ScanError> for Error {
    fn from(error: ScanError) -> Self {
        match error {
            ScanError::Request(invalid) => Self::Value(invalid),
            ScanError::Cast(error) => Self::Cast(error),
        }
    }
}
