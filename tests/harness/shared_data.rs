//! Archives of real meshes for developers, which are no part of the repository.

use std::process::Command;
use tempfile::TempDir;
use test_support::shared_data;

/// What a `tar.xz` below `../shared/data` holds, in a temporary folder.
pub fn unpacked(relative: &str) -> Result<TempDir, String> {
    let archive = shared_data(relative)?;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let status = Command::new("tar").arg("-xJf").arg(archive).arg("-C").arg(folder.path()).status();
    let is_unpacked = status.is_ok_and(|status| status.success());
    if is_unpacked { Ok(folder) } else { Err("tar cannot unpack xz here".to_owned()) }
}
