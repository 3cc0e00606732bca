//! Whether a dataset is what its manifest says.

use super::error::DatasetError;
use super::finish::failure_lines;
use super::journal::Journal;
use super::layout;
use super::manifest::Manifest;
use super::tars;
use formats::hash::{FileHash, Hashing};
use formats::labelled::read_labelled;
use formats::scan_file::{ScanFormat, read_scan};
use formats::{FormatError, velodyne};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// What was found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Files that the manifest names, scans and packed files among them.
    pub files: usize,
    /// Scans, each of which is one or more files.
    pub scans: usize,
    /// Clouds in packed files.
    pub clouds: u64,
    /// The hash that files were compared by. With none, points and clouds were counted.
    pub hash: Hashing,
    /// What is wrong, sorted by path; at most one problem a file.
    pub problems: Vec<Problem>,
}

/// What is wrong with one file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct Problem {
    /// The file, from the dataset's folder.
    pub path: PathBuf,
    /// What is wrong.
    pub what: String,
}

impl Report {
    /// Whether everything is as the manifest says.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }
}

/// Checks the dataset in `out` against its manifest: every file is there, has
/// its hash, if it has one, and can be read with as many points or clouds as recorded; and
/// the folders of scans, packed files and layouts hold nothing else. Other
/// files beside the manifest are the user's.
///
/// # Errors
/// [`DatasetError::Unfinished`] or [`DatasetError::NoManifest`]; a manifest
/// that cannot be read. What is wrong with other files is in the report.
pub fn verify(out: &Path) -> Result<Report, DatasetError> {
    if is_unfinished(out) {
        return Err(DatasetError::Unfinished { path: out.into() });
    }
    let manifest = Manifest::read(&layout::manifest(out))?;
    let expected = expected_files(&manifest);
    // Packed files fill the memory: one at a time.
    let (packed, others): (Vec<_>, Vec<_>) =
        expected.iter().partition(|file| matches!(file.holds, Holds::Clouds(_)));
    let mut problems: Vec<Problem> = packed.iter().filter_map(|file| file.problem(out)).collect();
    problems.par_extend(others.par_iter().filter_map(|file| file.problem(out)));
    problems.extend(failures_problem(out, &manifest));
    problems.extend(unexpected(out, &manifest, &expected));
    problems.sort();
    Ok(Report {
        files: expected.len(),
        scans: manifest.meshes.iter().flat_map(|mesh| &mesh.scans).map(|s| s.variants.len()).sum(),
        clouds: manifest.packed.iter().map(|packed| packed.clouds).sum(),
        hash: manifest.config.hash,
        problems,
    })
}

/// Whether a run in `out` is to be gone on with.
pub(super) fn is_unfinished(out: &Path) -> bool {
    // Beside a manifest, other files are the user's.
    Journal::of(out).exists() || !layout::manifest(out).exists() && tars::is_unfinished(out)
}

/// A file that the manifest names.
struct Expected<'a> {
    path: PathBuf,
    hash: Option<&'a FileHash>,
    holds: Holds,
}

enum Holds {
    Points(ScanFormat, u64),
    Clouds(u64),
    Anything,
}

fn expected_files(manifest: &Manifest) -> Vec<Expected<'_>> {
    let scans = manifest.scan_files().map(|(path, file, written)| Expected {
        path,
        hash: file.hash.as_ref(),
        holds: Holds::Points(file.format, written.tally.points),
    });
    let mut expected: Vec<Expected> = scans.collect();
    expected.extend(manifest.packed.iter().map(|packed| Expected {
        path: PathBuf::from(&packed.file),
        hash: packed.hash.as_ref(),
        holds: Holds::Clouds(packed.clouds),
    }));
    expected.extend(manifest.layout_files.iter().map(|file| Expected {
        path: PathBuf::from(&file.file),
        hash: file.hash.as_ref(),
        holds: Holds::Anything,
    }));
    expected
}

impl Expected<'_> {
    fn problem(&self, out: &Path) -> Option<Problem> {
        let path = out.join(&self.path);
        let what = if !path.exists() { Some("is missing".to_owned()) } else { self.flaw(&path) };
        what.map(|what| Problem { path: self.path.clone(), what })
    }

    fn flaw(&self, path: &Path) -> Option<String> {
        match self.hash.map(|recorded| (recorded, recorded.hashing().of_file(path))) {
            Some((_, Err(error))) => return Some(error.to_string()),
            Some((recorded, Ok(Some(found)))) if found != *recorded => {
                return Some(format!("was changed: its {found}, not {}", recorded.digits()));
            }
            Some((_, Ok(_))) | None => {}
        }
        let (found, expected, what) = match self.holds {
            Holds::Points(ScanFormat::Csv, points) => (csv_points(path), points, "points"),
            Holds::Points(ScanFormat::Pcap, points) => {
                return match velodyne::count_returns(path) {
                    Err(error) => Some(error.to_string()),
                    // Of a range that no packet can tell there is no return.
                    Ok(returns) => (returns > points)
                        .then(|| format!("holds {returns} returns of {points} points")),
                };
            }
            Holds::Points(_, points) => {
                (read_scan(path).map(|scan| scan.len() as u64), points, "points")
            }
            Holds::Clouds(clouds) => {
                (read_labelled(path).map(|set| set.len() as u64), clouds, "clouds")
            }
            // The hash has told already whether it is as it was written.
            Holds::Anything if self.hash.is_some() => return None,
            Holds::Anything => return read_through(path).err().map(|error| error.to_string()),
        };
        match found {
            Err(error) => Some(error.to_string()),
            Ok(found) if found != expected => {
                Some(format!("holds {found} {what}, not {expected} as recorded"))
            }
            Ok(_) => None,
        }
    }
}

/// Reads the file to its end.
fn read_through(path: &Path) -> Result<u64, FormatError> {
    let read = || io::copy(&mut std::fs::File::open(path)?, &mut io::sink());
    read().map_err(|source| FormatError::io(path, source))
}

/// Lines but for the header: a point each.
fn csv_points(path: &Path) -> Result<u64, FormatError> {
    let count = || -> io::Result<u64> {
        let mut lines = BufReader::new(std::fs::File::open(path)?).lines();
        let points = lines.try_fold(0, |n, line| line.map(|_| n + 1_u64))?;
        Ok(points.saturating_sub(1))
    };
    count().map_err(|source| FormatError::io(path, source))
}

fn failures_problem(out: &Path, manifest: &Manifest) -> Option<Problem> {
    let found = match std::fs::read(layout::failures(out)) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        found => found,
    };
    let what = match (found, failure_lines(&manifest.failures)) {
        (Err(error), _) | (_, Err(error)) => error.to_string(),
        (Ok(found), Ok(expected)) if found != expected => {
            "does not list the manifest's failures".to_owned()
        }
        _ => return None,
    };
    Some(Problem { path: layout::failures(Path::new("")), what })
}

/// Files in the dataset's folders that the manifest does not name.
fn unexpected(out: &Path, manifest: &Manifest, expected: &[Expected]) -> Vec<Problem> {
    let expected: BTreeSet<&Path> = expected.iter().map(|file| file.path.as_path()).collect();
    let names: BTreeSet<String> = layout::folders(&manifest.config).into_iter().collect();
    let folders = names.into_iter().map(|name| out.join(name)).filter(|folder| folder.exists());
    let mut problems = Vec::new();
    for item in folders.flat_map(WalkDir::new) {
        let (path, what) = match item {
            Ok(item) if item.file_type().is_dir() => continue,
            Ok(item) => (item.into_path(), "is not in the manifest".to_owned()),
            Err(error) => (error.path().unwrap_or(out).to_path_buf(), error.to_string()),
        };
        let path = path.strip_prefix(out).map(Path::to_path_buf).unwrap_or(path);
        if !expected.contains(path.as_path()) {
            problems.push(Problem { path, what });
        }
    }
    problems
}
