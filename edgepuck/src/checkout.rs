//! Finds the source checkout of a program that runs from its `target` folder. An installed program
//! has no checkout.

use std::path::{Path, PathBuf};

/// The root of the checkout: the nearest folder above the program that holds the sources of the
/// training program.
pub fn root() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let is_checkout = |folder: &&Path| folder.join("train/Cargo.toml").is_file();
    program.ancestors().skip(1).find(is_checkout).map(Path::to_owned)
}
