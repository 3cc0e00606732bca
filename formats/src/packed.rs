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
//! Labels are i64 because PyTorch's losses take nothing else for class
//! indices: `torch.from_numpy(set["labels"])` is ready for use. Text is NumPy's
//! fixed-width kind, which `np.load` reads without `allow_pickle`.

use std::fs::File;
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use crate::archive::{NpzReader, NpzWriter, Values};
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
            let cause = format!("{} points in a set of {}", points.len(), self.n_points);
            return Err(FormatError::instance(name, cause));
        }
        if label >= self.classes.len() {
            let cause = format!("label {label} of {} classes", self.classes.len());
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

/// A packed set in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct PackedSet {
    /// Coordinates of all clouds, `[m, n_points, 3]` in C order.
    pub points: Vec<f32>,
    /// Points of a cloud.
    pub n_points: usize,
    /// Class of each cloud, an index into `classes`.
    pub labels: Vec<i64>,
    /// Name of each cloud.
    pub names: Vec<String>,
    /// Points of each scan before it was resampled.
    pub n_raw: Vec<u32>,
    /// Class names in the order of the labels.
    pub classes: Vec<String>,
}

impl PackedSet {
    /// How many clouds there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The points of cloud `i`, which must be below [`PackedSet::len`].
    #[must_use]
    pub fn cloud(&self, i: usize) -> &[[f32; 3]] {
        let size = self.n_points * 3;
        self.points[i * size..(i + 1) * size].as_chunks::<3>().0
    }
}

/// Reads the packed set at `path`.
///
/// # Errors
/// An array that is missing, of another type or length than expected, or a
/// label without a class: [`FormatError::Malformed`] with file and key.
pub fn read_packed(path: &Path) -> Result<PackedSet, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let Values { shape, elements: points } = npz.array::<f32>("points")?;
    let [m, n_points, 3] = shape[..] else {
        return Err(npz.error("points", format!("expected shape [m, n, 3], found {shape:?}")));
    };
    let set = PackedSet {
        points,
        n_points,
        labels: npz.array("labels")?.elements,
        names: npz.text("names")?,
        n_raw: npz.array("n_raw")?.elements,
        classes: npz.text("classes")?,
    };
    let lengths =
        [("labels", set.labels.len()), ("names", set.names.len()), ("n_raw", set.n_raw.len())];
    if let Some((key, found)) = lengths.into_iter().find(|&(_, length)| length != m) {
        return Err(npz.error(key, format!("{found} values for {m} clouds")));
    }
    let has_class = |&label: &i64| usize::try_from(label).is_ok_and(|l| l < set.classes.len());
    if let Some(label) = set.labels.iter().find(|label| !has_class(label)) {
        return Err(npz.error("labels", format!("{label} of {} classes", set.classes.len())));
    }
    Ok(set)
}
