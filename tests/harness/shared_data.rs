//! Real meshes and recordings for developers, which are no part of the
//! repository.

use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// A path below `../shared/data`; where it is absent, a line says that the
/// test skips.
#[must_use]
pub fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(relative);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
    }
    path.exists().then_some(path)
}

/// What a `tar.xz` below `../shared/data` holds, in a folder that is removed
/// when dropped; where it cannot be had, a line says that the test skips.
///
/// # Panics
/// If no temporary folder can be made.
#[must_use]
pub fn unpacked(relative: &str) -> Option<TempDir> {
    let archive = shared(relative)?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let status = Command::new("tar").arg("-xJf").arg(archive).arg("-C").arg(folder.path()).status();
    let is_unpacked = status.is_ok_and(|status| status.success());
    if !is_unpacked {
        println!("skipped: tar cannot unpack xz here");
    }
    is_unpacked.then_some(folder)
}
