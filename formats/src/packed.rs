//! Packed sets: every cloud of one half of a dataset, at one size, in one NPZ.
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `points` | f32 | `[m, n, 3]` | clouds, normalised to the unit sphere |
//! | `labels` | i64 | `[m]` | indices into `classes` |
//! | `names` | text | `[m]` | instances |
//! | `n_raw` | u32 | `[m]` | points of the scan before resampling |
//! | `classes` | text | `[k]` | class names in the order of the labels |
//!
//! Labels are i64 because PyTorch's losses take no other type as class indices:
//! `torch.from_numpy(set["labels"])` is ready for use. Text is NumPy's
//! fixed-width kind, which `np.load` reads without `allow_pickle`.
//! [`crate::labelled`] reads these sets.

use std::path::{Path, PathBuf};

use crate::archive::write_archive;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::waiting_points::{WaitingPoints, write_points};

/// A packed set that is being written.
///
/// The first 32 MiB of points wait in memory; more wait in a file without a name in
/// the set's folder, which the system removes however the process ends. Memory then
/// grows by the names alone, some 100 bytes a cloud. Nothing lies under the set's
/// name before [`PackedWriter::finish`].
pub struct PackedWriter {
    path: PathBuf,
    n_points: usize,
    classes: Vec<String>,
    points: WaitingPoints,
    labels: Vec<i64>,
    names: Vec<String>,
    n_raw: Vec<u32>,
}

impl PackedWriter {
    /// Begins the set at `path`, of clouds of `n_points` points. A label is an
    /// index into `classes`.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn create(path: &Path, n_points: usize, classes: Vec<String>) -> Result<Self, FormatError> {
        Ok(Self {
            path: path.to_path_buf(),
            n_points,
            classes,
            points: WaitingPoints::new(path)?,
            labels: Vec::new(),
            names: Vec::new(),
            n_raw: Vec::new(),
        })
    }

    /// How many clouds were pushed.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether none was.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Appends the cloud `points` of class `label`, called `name`, that was
    /// drawn from a scan of `n_raw` points.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cloud of another size than the set's or
    /// a label without a class; what the system reports.
    pub fn push(
        &mut self,
        points: &[[f32; 3]],
        label: usize,
        name: &str,
        n_raw: u32,
    ) -> Result<(), FormatError> {
        check_cloud(name, points.len(), self.n_points, label, self.classes.len())?;
        self.points.push(points).map_err(|source| FormatError::io(&self.path, source))?;
        self.labels.push(label as i64);
        self.names.push(name.to_owned());
        self.n_raw.push(n_raw);
        Ok(())
    }

    /// Writes the set, atomically, and returns the hash of the file that `hashing` asks for; the same
    /// clouds in the same order give the same bytes. A set may be empty.
    ///
    /// # Errors
    /// What the system reports.
    pub fn finish(self, hashing: Hashing) -> Result<Option<FileHash>, FormatError> {
        let Self { path, n_points, classes, points, labels, names, n_raw } = self;
        let points = points.close().map_err(|source| FormatError::io(&path, source))?;
        write_archive(&path, hashing, |npz| {
            write_points(npz, points, &[labels.len(), n_points, 3])?;
            npz.array("labels", &[labels.len()], labels.iter().copied())?;
            npz.text("names", &names)?;
            npz.array("n_raw", &[n_raw.len()], n_raw.iter().copied())?;
            npz.text("classes", &classes)
        })
    }
}

/// Checks that the cloud `name` has the points of its set's clouds, and a class.
pub(crate) fn check_cloud(
    name: &str,
    points: usize,
    expected: usize,
    label: usize,
    classes: usize,
) -> Result<(), FormatError> {
    if points != expected {
        let cause = format!("expected {expected} points, found {points}");
        return Err(FormatError::instance(name, cause));
    }
    check_label(name, label, classes)
}

/// Checks that the cloud `name` has a class.
pub(crate) fn check_label(name: &str, label: usize, classes: usize) -> Result<(), FormatError> {
    if label >= classes {
        let cause = format!("expected a label below {classes}, found {label}");
        return Err(FormatError::instance(name, cause));
    }
    Ok(())
}
