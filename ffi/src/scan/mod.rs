mod mesh;
mod pose;
mod scene;
mod sensor;
mod sweep;

pub use mesh::*;
pub use pose::*;
pub use scene::*;
pub use sensor::*;
pub use sweep::*;

use sim_gpu::Error;

use crate::status::{EdgepuckStatus, Failure};

/// The errors of scans and casts. Meshes and sensors have statuses of their own.
impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let status = match &error {
            Error::Value(invalid) if invalid.key.starts_with("effects") => {
                EdgepuckStatus::BadEffects
            }
            Error::Value(_) => EdgepuckStatus::BadValue,
            _ => EdgepuckStatus::Internal,
        };
        Self::new(status, error.to_string())
    }
}
