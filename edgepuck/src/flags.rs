//! What flags of several commands have in common.

use crate::Usage;
use std::path::Path;

/// Fails if meshes are to be simplified and this program was built without that.
///
/// # Errors
/// A usage error that says how to get a program that simplifies.
pub fn need_simplification(wanted: bool) -> Result<(), Usage> {
    if !wanted || cfg!(feature = "simplify") {
        return Ok(());
    }
    Err(Usage(
        "--simplify: this program was built without mesh simplification; released programs have \
         it, and `cargo install --path edgepuck --features simplify` builds it, which takes a C++ \
         compiler"
            .to_owned(),
    ))
}

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
