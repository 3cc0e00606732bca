//! The one rule for outputs that exist already, and for the names of outputs.

use crate::outcome::Usage;
use anyhow::Context;
use std::path::{Path, PathBuf};

/// The flag of commands that write files.
#[derive(clap::Args, Debug, Default)]
pub struct Overwrite {
    /// Replace outputs that exist already
    #[arg(long)]
    overwrite: bool,
}

impl Overwrite {
    /// The rule, where outputs may be replaced or not.
    #[must_use]
    pub fn of(overwrite: bool) -> Self {
        Self { overwrite }
    }

    /// Checks that none of `files` exists, unless they may be replaced, and that [they can be
    /// made](check_place).
    ///
    /// # Errors
    /// Names the first for which this does not hold, or that is a folder.
    pub fn check<'a>(&self, files: impl IntoIterator<Item = &'a Path>) -> Result<(), Usage> {
        files.into_iter().try_for_each(|file| match file.is_dir() {
            true => Err(refused(file, "expected a file to write, found a folder: name another")),
            false => self.check_path(file),
        })
    }

    /// As [`Overwrite::check`], for a folder.
    ///
    /// # Errors
    /// As [`Overwrite::check`], or it is a file.
    pub fn check_folder(&self, folder: &Path) -> Result<(), Usage> {
        match folder.is_file() {
            true => Err(refused(folder, "expected a folder to write, found a file: name another")),
            false => self.check_path(folder),
        }
    }

    fn check_path(&self, path: &Path) -> Result<(), Usage> {
        // Devices and pipes hold nothing to lose.
        if !self.overwrite && (path.is_file() || path.is_dir()) {
            return Err(refused(path, "it exists already: --overwrite replaces it"));
        }
        check_place(path)
    }

    /// As [`Overwrite::check_folder`], of folders that [`Overwrite::clear`] removes, if all files in
    /// them are those of an earlier run, `is_ours`.
    ///
    /// # Errors
    /// As [`Overwrite::check_folder`], or a folder has another file.
    pub fn check_cleared<'a>(
        &self,
        folders: impl IntoIterator<Item = &'a Path, IntoIter: Clone>,
        is_ours: impl Fn(&Path) -> bool,
    ) -> anyhow::Result<()> {
        let mut folders = folders.into_iter();
        for folder in folders.clone() {
            if let Some(other) = other_file(folder, &is_ours)? {
                let cause = "expected only files that this command wrote in a folder to replace: \
                             move this one, or choose another --out";
                return Err(refused(&other, cause).into());
            }
        }
        Ok(folders.try_for_each(|folder| self.check_folder(folder))?)
    }

    /// As [`Overwrite::check_cleared`]; removes the folders that are there.
    ///
    /// # Errors
    /// As [`Overwrite::check_cleared`], or a folder cannot be removed.
    pub fn clear<'a>(
        &self,
        folders: impl IntoIterator<Item = &'a Path, IntoIter: Clone>,
        is_ours: impl Fn(&Path) -> bool,
    ) -> anyhow::Result<()> {
        let folders = folders.into_iter();
        self.check_cleared(folders.clone(), is_ours)?;
        for folder in folders.filter(|folder| folder.exists()) {
            std::fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        Ok(())
    }
}

fn refused(path: &Path, cause: &str) -> Usage {
    Usage(format!("{}: {cause}", path.display()))
}

/// A file in `folder` or below that is not `is_ours`.
fn other_file(folder: &Path, is_ours: &impl Fn(&Path) -> bool) -> std::io::Result<Option<PathBuf>> {
    if !folder.is_dir() {
        return Ok(None);
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let other = match path.is_dir() && !path.is_symlink() {
            true => other_file(&path, is_ours)?,
            false => (!is_ours(&path)).then_some(path),
        };
        if other.is_some() {
            return Ok(other);
        }
    }
    Ok(None)
}

/// Checks that the output `path` can be made: in it, if it is a folder, or else in the nearest
/// folder above it.
///
/// # Errors
/// Names the output and what stands in its way.
pub fn check_place(path: &Path) -> Result<(), Usage> {
    let exists = path.exists();
    if exists && !path.is_file() && !path.is_dir() {
        return Ok(());
    }
    let folder = path.ancestors().skip(usize::from(path.is_file())).find(|above| above.exists());
    let folder = folder.unwrap_or(Path::new("."));
    let (name, place) = (path.display(), folder.display());
    if !folder.is_dir() {
        return Err(Usage(format!("{name}: expected a folder, found the file {place}")));
    }
    let made = tempfile::tempfile_in(folder);
    made.map(drop).map_err(|error| {
        Usage(format!("{name}: no file can be made in the folder {place}: {}", error.kind()))
    })
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
