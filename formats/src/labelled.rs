//! Labelled sets of clouds of one size, read from an NPZ archive of either
//! convention:
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `points` | floating | `[m, n, 3]` | coordinates |
//! | or `points_i16` | i16 | `[m, n, 3]` | coordinates times 32767 |
//! | `labels` | whole numbers | `[m]` or `[m, 1]` | indices into the classes |
//! | `names`, may be absent | text | `[m]` | instances |
//! | `n_raw`, may be absent | whole numbers | `[m]` or `[m, 1]` | points of each scan before resampling |
//! | `classes`, may be absent | text | `[k]` | class names in the order of the labels |
//!
//! [`crate::packed`] writes all of them, with `points`. Other keys are ignored.

use std::io::{Read, Seek};
use std::path::Path;

use crate::archive::NpzReader;
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::npy;
use crate::number::NumberType;

/// What 1.0 is in `points_i16`.
const I16_SCALE: f32 = 32767.0;

/// A labelled set in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LabelledSet {
    /// Coordinates of all clouds, `[m, n_points, 3]` in C order.
    pub points: Vec<f32>,
    /// Points of a cloud.
    pub n_points: usize,
    /// Class of each cloud; an index into `classes` where they are known.
    pub labels: Vec<usize>,
    /// Name of each cloud, where the set names them.
    pub names: Option<Vec<String>>,
    /// Points of each scan before it was resampled, where the set lists them.
    pub n_raw: Option<Vec<u32>>,
    /// Class names in the order of the labels, where the set lists them.
    pub classes: Option<Vec<String>>,
}

impl LabelledSet {
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

    /// The points of cloud `i`, which must be below [`LabelledSet::len`].
    #[must_use]
    pub fn cloud(&self, i: usize) -> &[[f32; 3]] {
        let size = self.n_points * 3;
        self.points[i * size..(i + 1) * size].as_chunks::<3>().0
    }

    /// The clouds at `indices`, which must be below [`LabelledSet::len`], in
    /// that order.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        let points = indices.iter().flat_map(|&i| self.cloud(i).as_flattened().iter().copied());
        Self {
            points: points.collect(),
            n_points: self.n_points,
            labels: chosen(&self.labels, indices),
            names: self.names.as_ref().map(|names| chosen(names, indices)),
            n_raw: self.n_raw.as_ref().map(|n_raw| chosen(n_raw, indices)),
            classes: self.classes.clone(),
        }
    }
}

fn chosen<T: Clone>(values: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().map(|&i| values[i].clone()).collect()
}

/// Reads the labelled set at `path`.
///
/// # Errors
/// A missing array of points or labels, an array of an unexpected type or
/// length, a label without a class: [`FormatError::Malformed`] with file and key.
pub fn read_labelled(path: &Path) -> Result<LabelledSet, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let (m, n_points, points) = read_points(&mut npz)?;
    let labels = read_whole_numbers(&mut npz, "labels")?;
    let names = if npz.has("names") { Some(npz.text("names")?) } else { None };
    let n_raw = if npz.has("n_raw") { Some(read_whole_numbers(&mut npz, "n_raw")?) } else { None };
    let classes = if npz.has("classes") { Some(npz.text("classes")?) } else { None };
    let lengths = [
        ("labels", Some(labels.len())),
        ("names", names.as_ref().map(Vec::len)),
        ("n_raw", n_raw.as_ref().map(Vec::len)),
    ];
    for (key, length) in lengths {
        if let Some(found) = length.filter(|&length| length != m) {
            let cause = format!("expected {m} values, one for each cloud, found {found}");
            return Err(npz.error(key, cause));
        }
    }
    if let Some(classes) = &classes
        && let Some(label) = labels.iter().find(|&&label| label >= classes.len())
    {
        let cause = format!("expected labels below {}, found {label}", classes.len());
        return Err(npz.error("labels", cause));
    }
    Ok(LabelledSet { points, n_points, labels, names, n_raw, classes })
}

/// How many clouds of how many points there are, and their coordinates.
fn read_points<R: Read + Seek>(
    npz: &mut NpzReader<R>,
) -> Result<(usize, usize, Vec<f32>), FormatError> {
    let (key, scale) =
        if npz.has("points_i16") { ("points_i16", I16_SCALE) } else { ("points", 1.0) };
    npz.entry(key, |header, _, elements| {
        let [m, n_points, 3] = header.shape[..] else {
            return Err(invalid(format!("expected shape [m, n, 3], found {:?}", header.shape)));
        };
        let is_expected = match header.number() {
            Some((NumberType::I16, _)) => key == "points_i16",
            Some((NumberType::F16 | NumberType::F32 | NumberType::F64, _)) => key == "points",
            _ => false,
        };
        if !is_expected {
            let expected = if key == "points" { "f2, f4 or f8" } else { "i2" };
            let descr = &header.descr;
            return Err(invalid(format!("expected elements of type {expected}, found {descr}")));
        }
        // f32 holds every i16 and the scale, so that this quotient is rounded
        // once, as NumPy's own in f32.
        let points = npy::read_numbers(elements, &header, |x| x as f32 / scale)?;
        Ok((m, n_points, points))
    })
}

/// The array `key`, a list of whole numbers that fit `T`.
fn read_whole_numbers<R: Read + Seek, T: TryFrom<u64>>(
    npz: &mut NpzReader<R>,
    key: &str,
) -> Result<Vec<T>, FormatError> {
    let numbers = npz.entry(key, |header, _, elements| {
        if !matches!(header.shape[..], [_] | [_, 1]) {
            return Err(invalid(format!("expected shape [m], found {:?}", header.shape)));
        }
        npy::read_numbers(elements, &header, |number| number)
    })?;
    let whole = |number: f64| {
        // Up to 2^53, far beyond any class, f64 holds every whole number.
        let is_whole = number >= 0.0 && number.fract() == 0.0 && number < 2f64.powi(53);
        is_whole.then_some(number as u64).and_then(|number| T::try_from(number).ok())
    };
    let expected =
        |number: f64| npz.error(key, format!("expected whole numbers from 0, found {number}"));
    numbers.into_iter().map(|number| whole(number).ok_or_else(|| expected(number))).collect()
}
