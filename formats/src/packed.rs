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

use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use crate::archive::NpzWriter;
use crate::atomic;
use crate::error::FormatError;
use crate::npy_header;

/// A packed set that is being written.
///
/// Points wait in a file without a name in the set's folder, which the system
/// removes however the process ends; memory grows by the names alone, some
/// 100 bytes a cloud. Nothing lies under the set's name before
/// [`PackedWriter::finish`].
pub struct PackedWriter {
    path: PathBuf,
    n_points: usize,
    classes: Vec<String>,
    points: BufWriter<File>,
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
        let folder = atomic::make_folder_of(path)?;
        let points =
            tempfile::tempfile_in(folder).map_err(|source| FormatError::io(folder, source))?;
        Ok(Self {
            path: path.to_path_buf(),
            n_points,
            classes,
            points: BufWriter::new(points),
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
        if points.len() != self.n_points {
            let cause = format!("expected {} points, found {}", self.n_points, points.len());
            return Err(FormatError::instance(name, cause));
        }
        if label >= self.classes.len() {
            let cause = format!("expected a label below {}, found {label}", self.classes.len());
            return Err(FormatError::instance(name, cause));
        }
        for coordinate in points.as_flattened() {
            self.points
                .write_all(&coordinate.to_le_bytes())
                .map_err(|source| FormatError::io(&self.path, source))?;
        }
        self.labels.push(label as i64);
        self.names.push(name.to_owned());
        self.n_raw.push(n_raw);
        Ok(())
    }

    /// Writes the set, atomically; the same clouds in the same order give the
    /// same bytes. A set may be empty.
    ///
    /// # Errors
    /// What the system reports.
    pub fn finish(self) -> Result<(), FormatError> {
        let Self { path, n_points, classes, points, labels, names, n_raw } = self;
        let here = |source| FormatError::io(&path, source);
        let mut points = points.into_inner().map_err(|error| here(error.into_error()))?;
        points.rewind().map_err(here)?;
        atomic::write(&path, |writer| {
            NpzWriter::write(writer, |npz| {
                let header = npy_header::header_bytes("<f4", &[labels.len(), n_points, 3]);
                let n_bytes = header.len() as u64 + points.metadata()?.len();
                let entry = npz.begin("points", n_bytes)?;
                entry.write_all(&header)?;
                io::copy(&mut points, entry)?;
                npz.array("labels", &[labels.len()], labels.iter().copied())?;
                npz.text("names", &names)?;
                npz.array("n_raw", &[n_raw.len()], n_raw.iter().copied())?;
                npz.text("classes", &classes)
            })
        })
    }
}
