//! Finds the source checkout that this program was built in, if it still runs
//! from there. An installed program has none, and needs none.

use std::path::{Path, PathBuf};

/// The checkout's root: the folder above `target`, if the program lies in there
/// and the sources of the training program are beside it.
pub fn root() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let is_checkout = |folder: &&Path| folder.join("train/Cargo.toml").is_file();
    program.ancestors().skip(1).find(is_checkout).map(Path::to_owned)
}
