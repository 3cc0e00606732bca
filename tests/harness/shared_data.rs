//! Real meshes and recordings for developers, which are no part of the
//! repository.

use std::path::{Path, PathBuf};

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
