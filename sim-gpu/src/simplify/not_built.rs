//! Stands for the decimation in a build without it.

use super::NotBuilt;
use crate::mesh::Mesh;

/// See [`super::simplified`].
pub(super) fn decimated(_: &Mesh, _: &[u32], _: f64) -> Result<Option<Mesh>, NotBuilt> {
    Err(NotBuilt)
}
