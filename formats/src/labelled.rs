//! Labelled sets of clouds of one size, as an NPZ archive keeps them under
//! either convention:
//!
//! | key | type | shape | what |
//! | --- | --- | --- | --- |
//! | `points` | floating | `[m, n, 3]` | coordinates |
//! | or `points_i16` | i16 | `[m, n, 3]` | coordinates times 32767 |
//! | `labels` | whole numbers | `[m]` or `[m, 1]` | indices into the classes |
//! | `names`, may be absent | text | `[m]` | instances |
//! | `classes`, may be absent | text | `[k]` | class names in the order of the labels |
//!
//! `formats::packed` writes the first; other keys are passed over.

use std::io::{Read, Seek};
use std::path::Path;

use crate::archive::NpzReader;
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::npy;
use crate::npy_header::Header;
use crate::number::NumberType;

/// What 1.0 is in `points_i16`.
const I16_SCALE: f32 = 32767.0;

/// A labelled set in memory.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelledSet {
    /// Coordinates of all clouds, `[m, n_points, 3]` in C order.
    pub points: Vec<f32>,
    /// Points of a cloud.
    pub n_points: usize,
    /// Class of each cloud; an index into `classes` where they are known.
    pub labels: Vec<usize>,
    /// Name of each cloud, where the set names them.
    pub names: Option<Vec<String>>,
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
}

/// Reads the labelled set at `path`.
///
/// # Errors
/// No points or labels, an array of another type or length than expected, a
/// label without a class: [`FormatError::Malformed`] with file and key.
pub fn read_labelled(path: &Path) -> Result<LabelledSet, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let (m, n_points, points) = read_points(&mut npz)?;
    let labels = read_labels(&mut npz)?;
    let names = if npz.has("names") { Some(npz.text("names")?) } else { None };
    let classes = if npz.has("classes") { Some(npz.text("classes")?) } else { None };
    let lengths = [("labels", Some(labels.len())), ("names", names.as_ref().map(Vec::len))];
    for (key, length) in lengths {
        if let Some(found) = length.filter(|&length| length != m) {
            return Err(npz.error(key, format!("{found} values for {m} clouds")));
        }
    }
    if let Some(classes) = &classes
        && let Some(label) = labels.iter().find(|&&label| label >= classes.len())
    {
        return Err(npz.error("labels", format!("{label} of {} classes", classes.len())));
    }
    Ok(LabelledSet { points, n_points, labels, names, classes })
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
            return Err(invalid(format!("elements of type `{}`", header.descr)));
        }
        // f32 holds every i16 and the scale, so that this quotient is rounded
        // once, as NumPy's own in f32.
        let points = npy::read_numbers(elements, &header, |x| x as f32 / scale)?;
        Ok((m, n_points, points))
    })
}

fn read_labels<R: Read + Seek>(npz: &mut NpzReader<R>) -> Result<Vec<usize>, FormatError> {
    let numbers = npz.entry("labels", |header, _, elements| {
        if !is_list(&header) {
            return Err(invalid(format!("expected shape [m], found {:?}", header.shape)));
        }
        npy::read_numbers(elements, &header, |label| label)
    })?;
    let label = |number: f64| {
        // 2^53 is far beyond any class; up to there f64 tells whole numbers.
        let is_label = number >= 0.0 && number.fract() == 0.0 && number < 2f64.powi(53);
        is_label.then_some(number as usize)
    };
    numbers
        .into_iter()
        .map(|number| {
            label(number).ok_or_else(|| npz.error("labels", format!("{number} is no label")))
        })
        .collect()
}

fn is_list(header: &Header) -> bool {
    matches!(header.shape[..], [_] | [_, 1])
}
