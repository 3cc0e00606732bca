//! Recognises folders of ModelNet40's HDF5 files by their lists, without the library that reads
//! the files.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::split::Split;

/// The list of the files of one split.
#[must_use]
pub fn list(folder: &Path, split: Split) -> PathBuf {
    folder.join(format!("{split}_files.txt"))
}

/// Whether `folder` has a list of such files.
#[must_use]
pub fn is_one(folder: &Path) -> bool {
    Split::ALL.iter().any(|split| list(folder, *split).is_file())
}

/// Whether one of the words of a command line is such a folder, or a flag `--flag=FOLDER`.
#[must_use]
pub fn is_among(words: &[OsString]) -> bool {
    let value = |word: &OsString| Some(PathBuf::from(word.to_str()?.split_once('=')?.1));
    words.iter().any(|word| is_one(Path::new(word)) || value(word).is_some_and(|v| is_one(&v)))
}
