//! Atomic writes: a file is complete or absent.
//!
//! A file is written under a temporary name in its own folder and renamed when it is complete, so
//! that a process killed at any moment leaves no part of a file under its final name. Nothing is
//! synced to the disk, which would guard against power cuts but cost more than writing a small scan.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::TempPath;

use crate::error::FormatError;
#[cfg(feature = "dataset")]
use crate::hash::{FileHash, Hasher, Hashing};

const PREFIX: &str = ".edgepuck-";
const SUFFIX: &str = ".tmp";

/// Bytes of the buffer, which holds most scans.
const BUFFER: usize = 64 << 10;

/// The files and folders of this process that are not complete yet. Who makes, renames or removes them
/// holds the lock: after [`abandon`], all others wait for the end of the process, and what was removed
/// stays away.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes the files and folders that are not complete yet, and begins no others: for a process that
/// ends.
pub fn abandon() {
    let unfinished = unfinished();
    for path in unfinished.iter() {
        // While another thread puts a file into a folder, the folder cannot be removed. What stays after
        // some attempts stays: the process ends anyway.
        for _ in 0..100 {
            let removed =
                if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
            if removed.is_ok() || !path.exists() {
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
    std::mem::forget(unfinished);
}

/// A folder that is removed, with all that is in it, unless it is finished.
pub struct UnfinishedFolder(PathBuf);

impl UnfinishedFolder {
    /// Begins the folder at `path`, which does not exist yet or is empty.
    #[must_use]
    pub fn begin(path: &Path) -> Self {
        unfinished().insert(path.to_path_buf());
        Self(path.to_path_buf())
    }

    /// Begins the folder at `path`; `None` if it has entries already, which others may need.
    #[must_use]
    pub fn begin_new(path: &Path) -> Option<Self> {
        let has_entries = fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_some());
        (!has_entries).then(|| Self::begin(path))
    }

    /// Keeps the folder.
    pub fn finish(self) {
        unfinished().remove(&self.0);
    }
}

impl Drop for UnfinishedFolder {
    fn drop(&mut self) {
        if unfinished().remove(&self.0) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }
}

/// Writes or replaces the file at `path` with `fill`, atomically. Creates missing folders.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FormatError> {
    write_through(path, |file| file, fill, drop)
}

/// As [`write()`]; returns the hash of the file that `hashing` asks for.
#[cfg(feature = "dataset")]
pub fn write_hashed(
    path: &Path,
    hashing: Hashing,
    fill: impl FnOnce(&mut BufWriter<HashingFile>) -> io::Result<()>,
) -> Result<Option<FileHash>, FormatError> {
    let open = |file| HashingFile { file, hash: Hasher::new(hashing) };
    write_through(path, open, fill, |written| written.hash.finish())
}

/// A file whose bytes are hashed while they are written.
#[cfg(feature = "dataset")]
pub struct HashingFile {
    file: File,
    hash: Hasher,
}

#[cfg(feature = "dataset")]
impl Write for HashingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes)?;
        self.hash.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Writes a temporary file through the writer of `open`, ends it with `close` and renames it.
fn write_through<W: Write, T>(
    path: &Path,
    open: impl FnOnce(File) -> W,
    fill: impl FnOnce(&mut BufWriter<W>) -> io::Result<()>,
    close: impl FnOnce(W) -> T,
) -> Result<T, FormatError> {
    let mut file = Unfinished::open(path, open)?;
    file.append(fill)?;
    file.close(close)
}

/// A file that is written piece by piece. It gets its name when it is finished; one that is dropped
/// before is removed.
pub struct Unfinished<W: Write = File> {
    path: PathBuf,
    writer: BufWriter<W>,
    temporary: Temporary,
}

/// A temporary file, which is known as unfinished while it is there.
struct Temporary {
    path: TempPath,
    known: Known,
}

/// The path of a file that is known as unfinished.
struct Known(PathBuf);

impl Drop for Known {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

impl Temporary {
    /// The temporary file of the file at `path`. Creates missing folders.
    fn of(path: &Path) -> Result<(File, Self), FormatError> {
        let mut builder = tempfile::Builder::new();
        let mut known = None;
        let made = builder.prefix(PREFIX).suffix(SUFFIX).make_in(make_folder_of(path)?, |path| {
            // The name before this one was taken: it is forgotten before the lock is held.
            known = Some(Known(path.to_path_buf()));
            let mut unfinished = unfinished();
            unfinished.insert(path.to_path_buf());
            File::options().write(true).create_new(true).open(path)
        });
        let (file, made) = made.map_err(|source| FormatError::io(path, source))?.into_parts();
        let known = known.expect("invariant: a file is known before it is made");
        Ok((file, Self { path: made, known }))
    }

    fn persist(self, path: &Path) -> io::Result<()> {
        let Self { path: temporary, known } = self;
        let unfinished = unfinished();
        let persisted = temporary.persist(path).map_err(|error| error.error);
        drop(unfinished);
        drop(known);
        persisted
    }
}

/// Follows the symbolic links at `path` to a file, which need not exist. Without links, this is `path`.
fn behind_links(path: &Path) -> PathBuf {
    // As many as Linux follows.
    const MOST_LINKS: usize = 40;
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { break };
        path = path.parent().unwrap_or(Path::new("")).join(target);
    }
    path
}

impl Unfinished {
    /// Begins the file at `path`. Missing folders are created.
    ///
    /// # Errors
    /// Errors of the system; a folder of that name.
    pub fn create(path: &Path) -> Result<Self, FormatError> {
        if path.is_dir() {
            return Err(FormatError::io(path, io::ErrorKind::IsADirectory.into()));
        }
        Self::open(path, |file| file)
    }

    /// Gives the file its name, and replaces an existing file.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn finish(self) -> Result<(), FormatError> {
        self.close(drop)
    }
}

impl<W: Write> Unfinished<W> {
    fn open(path: &Path, open: impl FnOnce(File) -> W) -> Result<Self, FormatError> {
        let path = behind_links(path);
        let (file, temporary) = Temporary::of(&path)?;
        let writer = BufWriter::with_capacity(BUFFER, open(file));
        Ok(Self { path, writer, temporary })
    }

    /// Appends the output of `fill`.
    ///
    /// # Errors
    /// Errors of the system or of `fill`, with the name of the file.
    pub fn append(
        &mut self,
        fill: impl FnOnce(&mut BufWriter<W>) -> io::Result<()>,
    ) -> Result<(), FormatError> {
        fill(&mut self.writer).map_err(|source| FormatError::io(&self.path, source))
    }

    fn close<T>(self, close: impl FnOnce(W) -> T) -> Result<T, FormatError> {
        let Self { path, writer, temporary } = self;
        let here = |source| FormatError::io(&path, source);
        // Windows cannot rename a file that is open for writing.
        let closed = close(writer.into_inner().map_err(|error| here(error.into_error()))?);
        temporary.persist(&path).map_err(here)?;
        Ok(closed)
    }
}

/// As [`write()`], for bytes in memory.
///
/// # Errors
/// As [`write()`].
pub fn write_bytes(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), FormatError> {
    write(path, |writer| writer.write_all(bytes.as_ref()))
}

/// Makes the missing folders of the file at `path`, and returns its own: none after [`abandon`].
///
/// # Errors
/// A folder that cannot be made.
pub fn make_folder_of(path: &Path) -> Result<&Path, FormatError> {
    let _unfinished = unfinished();
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    // Usually the folder exists, and looking is cheaper than trying to create it.
    if !folder.is_dir() {
        fs::create_dir_all(folder).map_err(|source| FormatError::io(folder, source))?;
    }
    Ok(folder)
}

/// Removes the temporary files that killed runs left in `folder` and below, and returns their
/// number. Links are not followed. The folder need not exist.
///
/// Nothing else may write there meanwhile, since temporary files in use look the same.
///
/// # Errors
/// A folder that cannot be listed, a file that cannot be removed.
pub fn sweep_leftovers(folder: &Path) -> Result<usize, FormatError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(0),
        entries => entries.map_err(|source| FormatError::io(folder, source))?,
    };
    let mut removed = 0;
    for entry in entries {
        let entry = entry.map_err(|source| FormatError::io(folder, source))?;
        let path = entry.path();
        let kind = entry.file_type().map_err(|source| FormatError::io(&path, source))?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if kind.is_dir() {
            removed += sweep_leftovers(&path)?;
        } else if name.starts_with(PREFIX) && name.ends_with(SUFFIX) {
            fs::remove_file(&path).map_err(|source| FormatError::io(&path, source))?;
            removed += 1;
        }
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_only_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/scan.bin");
        write(&path, |writer| {
            writer.write_all(b"half")?;
            writer.flush()?;
            assert!(!path.exists());
            let beside = names(path.parent().unwrap());
            assert!(beside[0].starts_with('.') && beside[0].ends_with(".tmp"), "{beside:?}");
            writer.write_all(b" and half")
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"half and half");
        assert_eq!(names(path.parent().unwrap()), ["scan.bin"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [link, target] = ["link", "inside/target"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink("inside/target", &link).unwrap();
        for content in ["first", "second"] {
            write_bytes(&link, content).unwrap();
            assert_eq!(fs::read_to_string(&target).unwrap(), content);
            assert!(link.is_symlink());
        }
    }

    #[test]
    fn a_failed_write_keeps_the_old_file_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.bin");
        fs::write(&path, "old").unwrap();
        let error = write(&path, |writer| {
            writer.write_all(b"new")?;
            Err(io::ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert!(matches!(error, FormatError::DiskFull { .. }));
        assert!(error.to_string().ends_with("scan.bin: the disk is full"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["scan.bin"]);
    }

    #[cfg(feature = "dataset")]
    #[test]
    fn a_file_is_hashed_as_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scan.bin");
        // More than one buffer, in pieces of many lengths.
        let bytes: Vec<u8> = (0..100_000u32).map(|i| (i.wrapping_mul(i) >> 3) as u8).collect();
        for hashing in Hashing::ALL {
            let hash = write_hashed(&path, hashing, |writer| {
                let mut rest = &bytes[..];
                for length in (1..).take_while(|length| length * (length + 1) / 2 <= bytes.len()) {
                    let (piece, others) = rest.split_at(length);
                    writer.write_all(piece)?;
                    rest = others;
                }
                writer.write_all(rest)
            })
            .unwrap();
            assert_eq!(fs::read(&path).unwrap(), bytes);
            assert_eq!(hash, hashing.of_file(&path).unwrap());
        }
    }

    #[test]
    fn a_folder_that_is_not_finished_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        for (name, is_kept) in [("kept", true), ("lost", false)] {
            let path = folder.path().join(name);
            let begun = UnfinishedFolder::begin(&path);
            write_bytes(&path.join("a"), b"x").unwrap();
            if is_kept {
                begun.finish();
            }
        }
        assert_eq!(names(folder.path()), ["kept"]);
        assert!(UnfinishedFolder::begin_new(&folder.path().join("new")).is_some());
        // With files of others, it stays.
        assert!(UnfinishedFolder::begin_new(folder.path()).is_none());
    }

    #[test]
    fn leftovers_of_a_killed_process_are_swept_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let below = folder.path().join("chair/train");
        fs::create_dir_all(&below).unwrap();
        std::mem::forget(Temporary::of(&below.join("scan.bin")).unwrap());
        fs::write(below.join(".hidden.tmp"), "").unwrap();
        assert_eq!(sweep_leftovers(folder.path()).unwrap(), 1);
        assert_eq!(names(&below), [".hidden.tmp"]);
        assert_eq!(sweep_leftovers(&folder.path().join("absent")).unwrap(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode =
            |name: &str| fs::metadata(folder.path().join(name)).unwrap().permissions().mode();
        fs::write(folder.path().join("plain"), "").unwrap();
        write(&folder.path().join("atomic"), |_| Ok(())).unwrap();
        assert_eq!(mode("atomic"), mode("plain"));
    }
}
