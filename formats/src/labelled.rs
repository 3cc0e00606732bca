//! Labelled sets of clouds, read from an NPZ archive of any of three
//! conventions: clouds of one size as they are or in whole numbers, or clusters of
//! any size, one behind the other.
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `points` | floating | `[m, n, 3]` | coordinates |
//! | or `points_i16` | i16 | `[m, n, 3]` | coordinates times 32767 |
//! | or `points` with `offsets` | floating | `[total, 3]` | coordinates of all clouds |
//! | `offsets` | whole numbers | `[m + 1]` | where each cloud begins, and where the last ends |
//! | `labels` | whole numbers | `[m]` or `[m, 1]` | indices into the classes |
//! | or `labels` | text | `[m]` | class names |
//! | `names`, may be absent | text | `[m]` | instances |
//! | `n_raw`, may be absent | whole numbers | `[m]` or `[m, 1]` | points of each scan before resampling |
//! | `classes`, may be absent | text | `[k]` | class names in the order of the labels |
//! | `range_m`, with `offsets` | floating | `[m]` | distance from the sensor, metres; may be absent |
//! | `height_m`, with `offsets` | floating | `[m]` | height of the lowest point above the ground, metres, NaN if unknown; may be absent |
//! | `truth_share`, with `offsets` | floating | `[m]` | share of the points on the labelled object; may be absent |
//! | `sensor`, with `offsets` | text | `[m]` | the sensor's name; may be absent |
//! | `ids`, with `offsets` | text | `[m]` | `FRAME#TRACK`, or any other name of the object; may be absent |
//! | `sensor_origin`, with `offsets` | floating | `[3]` or `[m, 3]` | where the sensor was, from where `points` are then counted; may be absent |
//!
//! Where labels are text and no classes are listed, the classes are the sorted
//! distinct labels. `packed` writes both kinds. Other keys are ignored.

mod read;

pub use read::{is_labelled, read_labelled};

/// A labelled set in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledSet {
    /// Coordinates of all clouds, `[total, 3]` in C order.
    pub points: Vec<f32>,
    /// Where each cloud begins, and where the last ends: `[m + 1]`, ascending from 0.
    pub offsets: Vec<usize>,
    /// Class of each cloud; an index into `classes` where they are known.
    pub labels: Vec<usize>,
    /// Name of each cloud, where the set names them.
    pub names: Option<Vec<String>>,
    /// Points of each scan before it was resampled, where the set lists them.
    pub n_raw: Option<Vec<u32>>,
    /// Class names in the order of the labels, where the set lists them.
    pub classes: Option<Vec<String>>,
    /// Distance of each cloud from the sensor in metres, where the set lists them.
    pub range_m: Option<Vec<f32>>,
    /// Height of each cloud's lowest point above the ground under it, metres, NaN
    /// where that is unknown; where the set lists them.
    pub height_m: Option<Vec<f32>>,
    /// Share of each cloud's points that lie on the labelled object, where the set lists them.
    pub truth_share: Option<Vec<f32>>,
    /// Name of the sensor of each cloud, where the set lists them.
    pub sensor: Option<Vec<String>>,
    /// Frame and track of each cloud, `FRAME#TRACK`, where the set lists them.
    pub ids: Option<Vec<String>>,
}

impl Default for LabelledSet {
    fn default() -> Self {
        Self {
            points: Vec::new(),
            offsets: vec![0],
            labels: Vec::new(),
            names: None,
            n_raw: None,
            classes: None,
            range_m: None,
            height_m: None,
            truth_share: None,
            sensor: None,
            ids: None,
        }
    }
}

/// The offsets of `m` clouds of `n_points` points.
#[must_use]
pub fn equal_offsets(m: usize, n_points: usize) -> Vec<usize> {
    (0..=m).map(|i| i * n_points).collect()
}

impl LabelledSet {
    /// The number of clouds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether the set has no clouds.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.labels.is_empty()
    }

    /// The points of cloud `i`, which must be below [`LabelledSet::len`].
    #[must_use]
    pub fn cloud(&self, i: usize) -> &[[f32; 3]] {
        self.points[3 * self.offsets[i]..3 * self.offsets[i + 1]].as_chunks::<3>().0
    }

    /// The points of cloud `i`, mutable.
    #[must_use]
    pub fn cloud_mut(&mut self, i: usize) -> &mut [[f32; 3]] {
        self.points[3 * self.offsets[i]..3 * self.offsets[i + 1]].as_chunks_mut::<3>().0
    }

    /// What cloud `i` is a view of: its name without the number that gen-dataset appends after `_v`, or
    /// in a set without names its own number.
    #[must_use]
    pub fn instance(&self, i: usize) -> String {
        let Some(names) = &self.names else { return i.to_string() };
        match names[i].rsplit_once("_v") {
            Some((mesh, view)) if view.bytes().all(|b| b.is_ascii_digit()) => mesh.to_owned(),
            _ => names[i].clone(),
        }
    }

    /// How many meshes, or other instances, the clouds of each of `n_classes` labels are views of.
    #[must_use]
    pub fn n_instances(&self, n_classes: usize) -> Vec<usize> {
        let all = (0..self.len()).map(|i| (self.labels[i], self.instance(i)));
        let mut counts = vec![0; n_classes];
        for (label, _) in all.collect::<std::collections::BTreeSet<_>>() {
            counts[label] += 1;
        }
        counts
    }

    /// The points of the smallest cloud; 0 without clouds.
    #[must_use]
    pub fn smallest_cloud(&self) -> usize {
        self.offsets.windows(2).map(|pair| pair[1] - pair[0]).min().unwrap_or(0)
    }

    /// Height of the ground under cloud `i` in the cloud's frame, metres, if the set has it.
    #[must_use]
    pub fn ground_z(&self, i: usize) -> Option<f32> {
        let height_m = self.height_m.as_ref()?[i];
        let lowest = self.cloud(i).iter().fold(f32::INFINITY, |lowest, point| lowest.min(point[2]));
        height_m.is_finite().then_some(lowest - height_m)
    }

    /// Appends a cloud of class `label`. The caller extends the optional columns, such as names.
    pub fn push(&mut self, points: &[[f32; 3]], label: usize) {
        self.points.extend_from_slice(points.as_flattened());
        self.offsets.push(self.points.len() / 3);
        self.labels.push(label);
    }

    /// The clouds at `indices`, in that order; all are below [`LabelledSet::len`].
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let mut some = Self {
            names: chosen(self.names.as_ref(), indices),
            n_raw: chosen(self.n_raw.as_ref(), indices),
            classes: self.classes.clone(),
            range_m: chosen(self.range_m.as_ref(), indices),
            height_m: chosen(self.height_m.as_ref(), indices),
            truth_share: chosen(self.truth_share.as_ref(), indices),
            sensor: chosen(self.sensor.as_ref(), indices),
            ids: chosen(self.ids.as_ref(), indices),
            ..Self::default()
        };
        indices.iter().for_each(|&i| some.push(self.cloud(i), self.labels[i]));
        some
    }
}

fn chosen<T: Clone>(column: Option<&Vec<T>>, indices: &[usize]) -> Option<Vec<T>> {
    column.map(|values| indices.iter().map(|&i| values[i].clone()).collect())
}
