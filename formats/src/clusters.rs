//! Sets of labelled clusters: what a segmentation cuts out of scans, clouds of any
//! size in the sensor's frame, in one NPZ.
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `points` | f32 | `[total, 3]` | metres, z up, the sensor at the origin |
//! | `offsets` | i64 | `[m + 1]` | where each cluster begins, and where the last ends |
//! | `labels` | i64 | `[m]` | indices into `classes` |
//! | `classes` | text | `[k]` | class names in the order of the labels |
//! | `names` | text | `[m]` | objects; `NAME_vNUMBER` is a view of `NAME` |
//! | `ids` | text | `[m]` | `FRAME#TRACK` |
//! | `sensor` | text | `[m]` | the sensor's name |
//! | `range_m` | f32 | `[m]` | horizontal distance of the cluster from the sensor, metres |
//! | `truth_share` | f32 | `[m]` | share of the points that lie on the labelled object |
//! | `height_m` | f32 | `[m]` | height of the lowest point above the ground under it, metres; NaN if unknown |
//!
//! [`crate::labelled`] reads these sets.

use std::path::{Path, PathBuf};

use crate::archive::write_archive;
use crate::error::FormatError;
use crate::hash::Hashing;
use crate::packed::check_label;
use crate::waiting_points::{WaitingPoints, write_points};

/// What is noted beside a cluster's points and class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remarks<'a> {
    /// The object's name. Training keeps the views of one object, `NAME_v0`,
    /// `NAME_v1`, …, together.
    pub name: &'a str,
    /// `FRAME#TRACK`.
    pub id: &'a str,
    /// The sensor's name.
    pub sensor: &'a str,
    /// Horizontal distance from the sensor, metres.
    pub range_m: f32,
    /// Share of the points that lie on the labelled object, 0 to 1.
    pub truth_share: f32,
    /// Height of the lowest point above the ground under it, metres; NaN if
    /// unknown.
    pub height_m: f32,
}

/// A set of clusters that is being written.
///
/// The first 32 MiB of points wait in memory; more wait in a file without a name in
/// the set's folder, which the system removes however the process ends. Nothing
/// lies under the set's name before [`ClusterWriter::finish`].
pub struct ClusterWriter {
    path: PathBuf,
    classes: Vec<String>,
    points: WaitingPoints,
    offsets: Vec<i64>,
    labels: Vec<i64>,
    names: Vec<String>,
    ids: Vec<String>,
    sensor: Vec<String>,
    range_m: Vec<f32>,
    truth_share: Vec<f32>,
    height_m: Vec<f32>,
}

impl ClusterWriter {
    /// Begins the set at `path`. A label is an index into `classes`.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn create(path: &Path, classes: Vec<String>) -> Result<Self, FormatError> {
        Ok(Self {
            path: path.to_path_buf(),
            classes,
            points: WaitingPoints::new(path)?,
            offsets: vec![0],
            labels: Vec::new(),
            names: Vec::new(),
            ids: Vec::new(),
            sensor: Vec::new(),
            range_m: Vec::new(),
            truth_share: Vec::new(),
            height_m: Vec::new(),
        })
    }

    /// How many clusters were pushed.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether none was.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// Appends the cluster `points`, metres in the sensor's frame, of class
    /// `label`.
    ///
    /// # Errors
    /// [`FormatError::Instance`] for a cluster without points or a label without a
    /// class; what the system reports.
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
        check_label(name, label, self.classes.len())?;
        self.points.push(points).map_err(|source| FormatError::io(&self.path, source))?;
        let before = self.offsets.last().copied().unwrap_or(0);
        self.offsets.push(before + points.len() as i64);
        self.labels.push(label as i64);
        self.names.push(name.to_owned());
        self.ids.push(id.to_owned());
        self.sensor.push(sensor.to_owned());
        self.range_m.push(range_m);
        self.truth_share.push(truth_share);
        self.height_m.push(height_m);
        Ok(())
    }

    /// Writes the set, atomically; the same
    /// clusters in the same order give the same bytes. A set may be empty.
    ///
    /// # Errors
    /// What the system reports.
    pub fn finish(self) -> Result<(), FormatError> {
        let Self { path, classes, points, offsets, labels, .. } = self;
        let points = points.close().map_err(|source| FormatError::io(&path, source))?;
        let (m, total) = (labels.len(), offsets.last().map_or(0, |&total| total as usize));
        let columns = [
            ("range_m", self.range_m),
            ("truth_share", self.truth_share),
            ("height_m", self.height_m),
        ];
        write_archive(&path, Hashing::None, |npz| {
            write_points(npz, points, &[total, 3])?;
            npz.array("offsets", &[m + 1], offsets.into_iter())?;
            npz.array("labels", &[m], labels.into_iter())?;
            npz.text("classes", &classes)?;
            npz.text("names", &self.names)?;
            npz.text("ids", &self.ids)?;
            npz.text("sensor", &self.sensor)?;
            columns
                .into_iter()
                .try_for_each(|(key, values)| npz.array(key, &[m], values.into_iter()))
        })
        .map(drop)
    }
}
