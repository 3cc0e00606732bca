//! Labelled sets of clouds, written to one NPZ: packed clouds of one size ([`PackedWriter`]), and
//! clusters of any size, which a segmentation cuts out of scans ([`ClusterWriter`]).
//!
//! | key | type | packed | clusters | contents |
//! | --- | --- | --- | --- | --- |
//! | `points` | f32 | `[m, n, 3]` | `[total, 3]` | clouds in the unit sphere; clusters in metres, z up, the sensor at the origin |
//! | `offsets` | i64 | | `[m + 1]` | where each cluster begins, and where the last ends |
//! | `labels` | i64 | `[m]` | `[m]` | indices into `classes` |
//! | `names` | text | `[m]` | `[m]` | instances; `NAME_vNUMBER` is a view of `NAME` |
//! | `n_raw` | u32 | `[m]` | | points of the scan before resampling |
//! | `classes` | text | `[k]` | `[k]` | class names in the order of the labels |
//! | `ids` | text | | `[m]` | `FRAME#TRACK` |
//! | `sensor` | text | | `[m]` | the sensor's name |
//! | `range_m` | f32 | | `[m]` | horizontal distance of the cluster from the sensor, metres |
//! | `truth_share` | f32 | | `[m]` | share of the points that lie on the labelled object |
//! | `height_m` | f32 | | `[m]` | height of the lowest point above the ground under it, metres; NaN if unknown |
//!
//! Labels are i64 because PyTorch's losses take no other type as class indices:
//! `torch.from_numpy(set["labels"])` is ready for use. Text is NumPy's fixed-width kind, which
//! `np.load` reads without `allow_pickle`. [`crate::labelled`] reads these sets.
//!
//! The first 32 MiB of points wait in memory. More wait in an unnamed file in the set's folder,
//! which the system removes however the process ends. Memory then grows by the other columns
//! alone, some 100 bytes a cloud. No file has the set's name before `finish`.

use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

use tempfile::SpooledTempFile;

use crate::archive::{NpzWriter, waiting_room, write_archive};
use crate::atomic;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::npy;

/// Writes a packed set: clouds of one size, in the unit sphere.
pub struct PackedWriter {
    set: Columns,
    n_points: usize,
    n_raw: Vec<u32>,
}

impl PackedWriter {
    /// Begins the set at `path`, of clouds of `n_points` points. Labels are indices into `classes`.
    ///
    /// # Errors
    /// The folder cannot be created or written.
    pub fn create(path: &Path, n_points: usize, classes: Vec<String>) -> Result<Self, FormatError> {
        Ok(Self { set: Columns::create(path, classes)?, n_points, n_raw: Vec::new() })
    }

    /// The number of clouds so far.
    #[must_use]
    pub fn n_clouds(&self) -> usize {
        self.set.labels.len()
    }

    /// Appends the cloud `points` of class `label`, called `name`, that was drawn from a scan of
    /// `n_raw` points.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cloud of another size than the set's or a label without a
    /// class; errors of the system.
    pub fn push(
        &mut self,
        points: &[[f32; 3]],
        label: usize,
        name: &str,
        n_raw: u32,
    ) -> Result<(), FormatError> {
        check_size(name, points.len(), self.n_points)?;
        self.set.push(points, label, name)?;
        self.n_raw.push(n_raw);
        Ok(())
    }

    /// Writes the set atomically and returns the hash of the file that `hashing` asks for. The
    /// same clouds in the same order give the same bytes. A set may be empty.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn finish(self, hashing: Hashing) -> Result<Option<FileHash>, FormatError> {
        let Self { set, n_points, n_raw } = self;
        let m = n_raw.len();
        set.finish(hashing, &[m, n_points, 3], |npz, set| {
            npz.array("labels", &[m], set.labels.into_iter())?;
            npz.text("names", &set.names)?;
            npz.array("n_raw", &[m], n_raw.into_iter())?;
            npz.text("classes", &set.classes)
        })
    }
}

/// The columns of a cluster besides its points and class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remarks<'a> {
    /// The object's name. Training keeps the views of one object, `NAME_v0`, `NAME_v1`, …,
    /// together.
    pub name: &'a str,
    /// `FRAME#TRACK`.
    pub id: &'a str,
    /// The sensor's name.
    pub sensor: &'a str,
    /// Horizontal distance from the sensor, metres.
    pub range_m: f32,
    /// Share of the points that lie on the labelled object, 0 to 1.
    pub truth_share: f32,
    /// Height of the lowest point above the ground under it, metres; NaN if unknown.
    pub height_m: f32,
}

/// Writes a set of clusters of any size.
pub struct ClusterWriter {
    set: Columns,
    ids: Vec<String>,
    sensor: Vec<String>,
    /// `range_m`, `truth_share` and `height_m` of each cluster.
    numbers: Vec<[f32; 3]>,
}

impl ClusterWriter {
    /// Begins the set at `path`. A label is an index into `classes`.
    ///
    /// # Errors
    /// The folder cannot be created or written.
    pub fn create(path: &Path, classes: Vec<String>) -> Result<Self, FormatError> {
        let set = Columns::create(path, classes)?;
        Ok(Self { set, ids: Vec::new(), sensor: Vec::new(), numbers: Vec::new() })
    }

    /// Appends the cluster `points`, metres in the sensor's frame, of class `label`.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cluster without points or a label without a class; errors
    /// of the system.
    pub fn push(
        &mut self,
        points: &[[f32; 3]],
        label: usize,
        remarks: &Remarks<'_>,
    ) -> Result<(), FormatError> {
        let Remarks { name, id, sensor, range_m, truth_share, height_m } = *remarks;
        if points.is_empty() {
            return Err(FormatError::instance(name, "expected points, found none"));
        }
        self.set.push(points, label, name)?;
        self.ids.push(id.to_owned());
        self.sensor.push(sensor.to_owned());
        self.numbers.push([range_m, truth_share, height_m]);
        Ok(())
    }

    /// Writes the set, which may be empty, atomically. The same clusters give the same bytes.
    ///
    /// # Errors
    /// Errors of the system.
    pub fn finish(self) -> Result<(), FormatError> {
        let Self { set, ids, sensor, numbers } = self;
        let (m, total) = (ids.len(), set.offsets[ids.len()] as usize);
        set.finish(Hashing::None, &[total, 3], |npz, set| {
            npz.array("offsets", &[m + 1], set.offsets.into_iter())?;
            npz.array("labels", &[m], set.labels.into_iter())?;
            npz.text("classes", &set.classes)?;
            npz.text("names", &set.names)?;
            npz.text("ids", &ids)?;
            npz.text("sensor", &sensor)?;
            let keys = ["range_m", "truth_share", "height_m"];
            keys.iter()
                .enumerate()
                .try_for_each(|(i, key)| npz.array(key, &[m], numbers.iter().map(|row| row[i])))
        })
        .map(drop)
    }
}

/// The columns that both kinds of sets have.
struct Columns {
    path: PathBuf,
    classes: Vec<String>,
    points: BufWriter<SpooledTempFile>,
    /// `[m + 1]`, from 0.
    offsets: Vec<i64>,
    labels: Vec<i64>,
    names: Vec<String>,
}

impl Columns {
    fn create(path: &Path, classes: Vec<String>) -> Result<Self, FormatError> {
        let points = BufWriter::new(waiting_room(atomic::make_folder_of(path)?));
        let (path, labels, names) = (path.to_path_buf(), Vec::new(), Vec::new());
        Ok(Self { path, classes, points, offsets: vec![0], labels, names })
    }

    fn push(&mut self, points: &[[f32; 3]], label: usize, name: &str) -> Result<(), FormatError> {
        check_label(name, label, self.classes.len())?;
        for coordinate in points.as_flattened() {
            let written = self.points.write_all(&coordinate.to_le_bytes());
            written.map_err(|source| FormatError::io(&self.path, source))?;
        }
        self.offsets.push(self.offsets[self.labels.len()] + points.len() as i64);
        self.labels.push(label as i64);
        self.names.push(name.to_owned());
        Ok(())
    }

    /// Writes the archive: the points as an array of `shape`, then the arrays that `fill` writes.
    fn finish(
        mut self,
        hashing: Hashing,
        shape: &[usize],
        fill: impl FnOnce(&mut NpzWriter<&mut SpooledTempFile>, Self) -> io::Result<()>,
    ) -> Result<Option<FileHash>, FormatError> {
        let path = self.path.clone();
        write_archive(&path, hashing, |npz| {
            // Seeking writes what is left in the buffer.
            let size = self.points.stream_position()?;
            self.points.rewind()?;
            let header = npy::header_bytes("<f4", shape);
            let entry = npz.begin("points", header.len() as u64 + size)?;
            entry.write_all(&header)?;
            io::copy(self.points.get_mut(), entry)?;
            fill(npz, self)
        })
    }
}

pub(crate) fn check_size(name: &str, points: usize, expected: usize) -> Result<(), FormatError> {
    if points != expected {
        let cause = format!("expected {expected} points, found {points}");
        return Err(FormatError::instance(name, cause));
    }
    Ok(())
}

pub(crate) fn check_label(name: &str, label: usize, classes: usize) -> Result<(), FormatError> {
    if label >= classes {
        let cause = format!("expected a label below {classes}, found {label}");
        return Err(FormatError::instance(name, cause));
    }
    Ok(())
}
