//! The outputs that this process may make and not replace: one that is there when it is finished is another
//! program's.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

static NEW: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn new() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    NEW.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Notes whether this process may only make a file or a folder at `path`, and replace none.
#[cfg(feature = "cli")]
pub(crate) fn expect(path: &Path, is_new: bool) {
    let path = behind_links(path);
    let mut new = new();
    let _ = if is_new { new.insert(path) } else { new.remove(&path) };
}

/// Forgets which outputs are new: for a process that runs several commands, one after the other.
#[cfg(feature = "cli")]
pub fn forget() {
    new().clear();
}

/// Whether nothing may be replaced at `path`.
pub(crate) fn has(path: &Path) -> bool {
    new().contains(path)
}

/// As [`has`]. What is made there now, this process may replace.
pub(crate) fn take(path: &Path) -> bool {
    new().remove(path)
}

pub(crate) fn made_meanwhile() -> io::Error {
    let cause = "another program made it meanwhile: name another, or replace it by --overwrite";
    io::Error::new(io::ErrorKind::AlreadyExists, cause)
}

/// Follows the symbolic links at `path` to a file, which need not exist. Without links, this is `path`.
pub(crate) fn behind_links(path: &Path) -> PathBuf {
    // As many as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    path
}
