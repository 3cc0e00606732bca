//! The one rule for outputs that exist already, and for the names of outputs.

use crate::outcome::Usage;
use std::path::Path;

/// The flag of commands that write files.
#[derive(clap::Args, Debug, Default)]
pub struct Overwrite {
    /// Replace outputs that exist already
    #[arg(long)]
    overwrite: bool,
}

impl Overwrite {
    /// Checks that none of the files or folders `outputs` exists, unless they may be replaced.
    ///
    /// # Errors
    /// Names the first that does.
    pub fn check<'a>(&self, outputs: impl IntoIterator<Item = &'a Path>) -> Result<(), Usage> {
        // Devices and pipes hold nothing to lose.
        let stands = |path: &&Path| path.is_file() || path.is_dir();
        let existing = outputs.into_iter().find(|path| !self.overwrite && stands(path));
        let refused = |path: &Path| {
            Usage(format!("{}: it exists already: --overwrite replaces it", path.display()))
        };
        existing.map_or(Ok(()), |path| Err(refused(path)))
    }

    /// As [`Overwrite::check`]; removes the folders that are there.
    ///
    /// # Errors
    /// As [`Overwrite::check`], or a folder cannot be removed.
    pub fn clear<'a>(&self, folders: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<()> {
        for folder in folders {
            self.check([folder])?;
            if folder.exists() {
                std::fs::remove_dir_all(folder)?;
            }
        }
        Ok(())
    }
}

/// Checks that the name of the file to write has one of the extensions `expected`.
///
/// # Errors
/// Names the flag and the file.
pub fn need_extension(flag: &str, file: &Path, expected: &[&str]) -> Result<(), Usage> {
    let found = file.extension().unwrap_or_default();
    if expected.iter().any(|extension| found.eq_ignore_ascii_case(extension)) {
        return Ok(());
    }
    let expected = expected.join(" or .");
    Err(Usage(format!("{flag}: expected a name with .{expected}, found {}", file.display())))
}
