use crate::error::DatasetError;
use crate::folder::{DatasetFolder, failure_lines, folders, read_json};
use crate::manifest::Manifest;
use crate::tars::{self, PartManifest, RootManifest, root_file};
use formats::cloud_file::read_cloud;
use formats::hash::{FileHash, Hashing};
use formats::labelled::read_labelled;
use formats::scan_file::{ScanFormat, read_scan};
use formats::{FormatError, velodyne};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::{Path, PathBuf};
use walkdir::WalkDir;

/// The result of [`verify()`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Number of files that the manifests name.
    pub files: usize,
    /// Number of scans, each of which is one or more files.
    pub scans: usize,
    /// Number of clouds in packed files, or of clouds or scans in tars.
    pub clouds: u64,
    /// The hash by which files were compared. Without one, only sizes and numbers of points and
    /// clouds were compared.
    pub hash: Hashing,
    /// The problems, sorted by path; at most one for each file.
    pub problems: Vec<Problem>,
}

/// A problem of one file.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[error("{}: {what}", path.display())]
pub struct Problem {
    /// The file, from the dataset's folder.
    pub path: PathBuf,
    /// The problem.
    pub what: String,
}

impl Report {
    /// Whether every file is as the manifest says.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.problems.is_empty()
    }
}

/// Checks the dataset in `out`, of files or of tars, against its manifest. Every file must exist,
/// match its hash, if it has one, and hold the recorded number of points, clouds or bytes. The
/// folders of scans, packed files and layouts must hold nothing else; other files beside the
/// manifest are the user's.
///
/// # Errors
/// [`DatasetError::Unfinished`] or [`DatasetError::NoManifest`]; a manifest that cannot be read.
/// The report has the problems of all other files.
pub fn verify(out: &Path) -> Result<Report, DatasetError> {
    let Contents { files, scans, clouds, hash, mut problems } = match root_file(out).exists() {
        true => tars_contents(out)?,
        false if is_unfinished(out) => return Err(DatasetError::Unfinished { path: out.into() }),
        false => files_contents(DatasetFolder(out))?,
    };
    problems.extend(self::problems(out, &files));
    problems.sort();
    Ok(Report { files: files.len(), scans, clouds, hash, problems })
}

/// What the manifests of a folder say about it.
struct Contents {
    files: Vec<Expected>,
    scans: usize,
    clouds: u64,
    hash: Hashing,
    /// The problems besides those of `files`.
    problems: Vec<Problem>,
}

fn files_contents(folder: DatasetFolder) -> Result<Contents, DatasetError> {
    let manifest = folder.manifest()?;
    let files = expected_files(&manifest);
    let mut problems = unexpected(folder.0, &manifest, &files);
    problems.extend(failures_problem(folder, &manifest));
    let scans = manifest.meshes.iter().flat_map(|mesh| &mesh.scans);
    let scans = scans.map(|scan| scan.variants.len()).sum();
    let clouds = manifest.packed.iter().map(|packed| packed.clouds).sum();
    Ok(Contents { files, scans, clouds, hash: manifest.config.hash, problems })
}

fn tars_contents(out: &Path) -> Result<Contents, DatasetError> {
    let RootManifest { config, parts, .. } = read_json(&root_file(out))?;
    let clouds = parts.iter().map(|part| part.clouds).sum();
    let mut files = Vec::new();
    for part in parts {
        let (holds, tars) = match read_json::<PartManifest>(&out.join(&part.file)) {
            Ok(manifest) => (Holds::Anything, manifest.tars),
            Err(error) => (Holds::NoManifest(error.to_string()), Vec::new()),
        };
        files.push(Expected { path: part.file.into(), hash: part.hash, holds });
        files.extend(tars.into_iter().map(|tar| Expected {
            path: tar.file.into(),
            hash: tar.hash,
            holds: Holds::Bytes(tar.bytes),
        }));
    }
    Ok(Contents { files, scans: 0, clouds, hash: config.hash, problems: Vec::new() })
}

/// The first file of `manifest`, by its path, that is not as it says in `folder`.
pub(crate) fn first_problem(folder: DatasetFolder, manifest: &Manifest) -> Option<Problem> {
    problems(folder.0, &expected_files(manifest)).into_iter().min()
}

/// Whether a run in `out` was begun and not finished.
pub(crate) fn is_unfinished(out: &Path) -> bool {
    // Beside a manifest, other files are the user's.
    let folder = DatasetFolder(out);
    folder.is_begun() || !folder.manifest_file().exists() && tars::is_unfinished(out)
}

/// A file that a manifest names.
struct Expected {
    path: PathBuf,
    hash: Option<FileHash>,
    holds: Holds,
}

/// The recorded contents of a file.
enum Holds {
    Points(ScanFormat, u64),
    Clouds(u64),
    Bytes(u64),
    Anything,
    /// Why it is no manifest.
    NoManifest(String),
}

fn expected_files(manifest: &Manifest) -> Vec<Expected> {
    let scans = manifest.scan_files().map(|(path, file, written)| Expected {
        path,
        hash: file.hash.clone(),
        holds: Holds::Points(file.format, written.tally.points),
    });
    let packed = manifest.packed.iter().map(|packed| Expected {
        path: PathBuf::from(&packed.file),
        hash: packed.hash.clone(),
        holds: Holds::Clouds(packed.clouds),
    });
    scans.chain(packed).collect()
}

fn problems(out: &Path, expected: &[Expected]) -> Vec<Problem> {
    // Packed files fill the memory: one at a time.
    let (packed, others): (Vec<_>, Vec<_>) =
        expected.iter().partition(|file| matches!(file.holds, Holds::Clouds(_)));
    let mut problems: Vec<Problem> = packed.iter().filter_map(|file| file.problem(out)).collect();
    problems.par_extend(others.par_iter().filter_map(|file| file.problem(out)));
    problems
}

impl Expected {
    fn problem(&self, out: &Path) -> Option<Problem> {
        let path = out.join(&self.path);
        let what = if !path.exists() { Some("is missing".to_owned()) } else { self.flaw(&path) };
        what.map(|what| Problem { path: self.path.clone(), what })
    }

    fn flaw(&self, path: &Path) -> Option<String> {
        if let Some(recorded) = &self.hash {
            match Hashing::Sha256.of_file(path) {
                Err(error) => return Some(error.to_string()),
                Ok(Some(found)) if found != *recorded => {
                    return Some(format!("was changed: its {found}, not {}", recorded.sha256));
                }
                Ok(_) => {}
            }
        }
        let (found, expected, what) = match &self.holds {
            Holds::Points(ScanFormat::Csv, points) => (csv_points(path), *points, "points"),
            Holds::Points(ScanFormat::Pcd, points) => {
                (read_cloud(path).map(|cloud| cloud.len() as u64), *points, "points")
            }
            Holds::Points(ScanFormat::Pcap, points) => {
                return match velodyne::count_returns(path) {
                    Err(error) => Some(error.to_string()),
                    // Packets hold no return of a range that they cannot represent.
                    Ok(returns) => (returns > *points)
                        .then(|| format!("holds {returns} returns of {points} points")),
                };
            }
            Holds::Points(_, points) => {
                (read_scan(path).map(|scan| scan.len() as u64), *points, "points")
            }
            Holds::Clouds(clouds) => {
                (read_labelled(path).map(|set| set.len() as u64), *clouds, "clouds")
            }
            Holds::NoManifest(why) => return Some(why.clone()),
            // The hash was compared already.
            Holds::Bytes(_) | Holds::Anything if self.hash.is_some() => return None,
            Holds::Bytes(bytes) => (size_of(path), *bytes, "bytes"),
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

fn size_of(path: &Path) -> Result<u64, FormatError> {
    let size = std::fs::metadata(path).map(|file| file.len());
    size.map_err(|source| FormatError::io(path, source))
}

/// Reads the file to its end.
fn read_through(path: &Path) -> Result<u64, FormatError> {
    let read = || io::copy(&mut File::open(path)?, &mut io::sink());
    read().map_err(|source| FormatError::io(path, source))
}

/// The points of a CSV file: its lines without the header.
fn csv_points(path: &Path) -> Result<u64, FormatError> {
    let count = || -> io::Result<u64> {
        let mut lines = BufReader::new(File::open(path)?).lines();
        let points = lines.try_fold(0, |n, line| line.map(|_| n + 1_u64))?;
        Ok(points.saturating_sub(1))
    };
    count().map_err(|source| FormatError::io(path, source))
}

fn failures_problem(folder: DatasetFolder, manifest: &Manifest) -> Option<Problem> {
    let found = match std::fs::read(folder.failures_file()) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        found => found,
    };
    let what = match found {
        Err(error) => error.to_string(),
        Ok(found) if found == failure_lines(&manifest.failures).as_bytes() => return None,
        Ok(_) => "does not list the manifest's failures".to_owned(),
    };
    Some(Problem { path: DatasetFolder(Path::new("")).failures_file(), what })
}

/// Files in the dataset's folders that the manifest does not name.
fn unexpected(out: &Path, manifest: &Manifest, expected: &[Expected]) -> Vec<Problem> {
    let expected: BTreeSet<&Path> = expected.iter().map(|file| file.path.as_path()).collect();
    let names: BTreeSet<String> = folders(&manifest.config).into_iter().collect();
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
