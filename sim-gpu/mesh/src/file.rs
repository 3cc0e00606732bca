//! Reads the bytes of a mesh's files.

use std::fs;
use std::path::Path;

use super::error::MeshError;

/// The bytes of the file at `path`, which is no folder, pipe or device.
pub(crate) fn read(path: &Path) -> Result<Vec<u8>, MeshError> {
    let failed = |source| MeshError::Read { path: path.into(), source };
    let kind = fs::metadata(path).map_err(failed)?;
    if !kind.is_file() {
        let what = if kind.is_dir() { "a directory" } else { "a pipe or device" };
        return Err(MeshError::NotAFile { path: path.into(), what });
    }
    fs::read(path).map_err(failed)
}
