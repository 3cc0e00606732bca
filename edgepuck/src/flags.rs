//! What flags of several commands have in common.

use crate::Usage;
use std::path::Path;

/// Why `--simplify` fails in a program that was built without it.
pub const BUILT_WITHOUT_SIMPLIFY: &str = "--simplify: this program was built without mesh \
     simplification; released programs have it, and `cargo install --path edgepuck --features \
     simplify` builds it, which takes a C++ compiler";

/// Fails unless `--meshes`, where it is given, names a folder.
///
/// # Errors
/// A usage error that names the path.
pub fn need_folder_of_meshes(meshes: Option<&Path>) -> Result<(), Usage> {
    match meshes.filter(|path| !path.is_dir()) {
        Some(path) => Err(Usage(format!("--meshes: expected a folder, found {}", path.display()))),
        None => Ok(()),
    }
}

/// A finite number above 0.
pub fn positive(word: &str) -> Result<f64, String> {
    match word.parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("expected a finite number above 0".to_owned()),
    }
}
