//! Reads labelled sets from their archives.

use std::collections::BTreeSet;
use std::path::Path;

use super::{LabelledSet, equal_offsets};
use crate::archive::NpzReader;
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::npy;
use crate::number::NumberType;

/// The value of 1.0 in `points_i16`.
const I16_SCALE: f32 = 32767.0;

/// Reads the labelled set at `path`.
///
/// # Errors
/// A missing array of points or labels, an array of an unexpected type or
/// length, offsets that do not ascend from 0 to the number of points, a label
/// without a class: [`FormatError::Malformed`] with file and key.
pub fn read_labelled(path: &Path) -> Result<LabelledSet, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let (shape, mut points) = read_points(&mut npz)?;
    let ragged = match shape[..] {
        [total, 3] => Some(read_offsets(&mut npz, total)?),
        _ => None,
    };
    if let Some(offsets) = ragged.as_ref().filter(|_| npz.has("sensor_origin")) {
        count_from_sensor(&mut npz, offsets, points.as_chunks_mut().0)?;
    }
    let m = ragged.as_ref().map_or(shape[0], |offsets| offsets.len() - 1);
    let classes = npz.has("classes").then(|| npz.text("classes")).transpose()?;
    let (labels, classes) = read_labels(&mut npz, classes)?;
    check_count(&npz, "labels", &labels, m)?;
    let (of_all, of_ragged) = (Some(m), ragged.as_ref().map(|_| m));
    let numbers = |npz: &mut NpzReader, key: &str| read_list(npz, key, |x| x as f32);
    Ok(LabelledSet {
        points,
        // Only once the file is known to hold a label for each cloud: a shape may state any
        // number of clouds without points.
        offsets: ragged.unwrap_or_else(|| equal_offsets(m, shape[1])),
        labels,
        classes,
        names: column(&mut npz, "names", of_all, NpzReader::text)?,
        n_raw: column(&mut npz, "n_raw", of_all, read_whole_numbers)?,
        range_m: column(&mut npz, "range_m", of_ragged, numbers)?,
        height_m: column(&mut npz, "height_m", of_ragged, numbers)?,
        truth_share: column(&mut npz, "truth_share", of_ragged, numbers)?,
        sensor: column(&mut npz, "sensor", of_ragged, NpzReader::text)?,
        ids: column(&mut npz, "ids", of_ragged, NpzReader::text)?,
    })
}

/// Whether the NPZ archive at `path` has labels or offsets, as labelled sets do, damaged ones too.
#[must_use]
pub fn is_labelled(path: &Path) -> bool {
    NpzReader::open(path).is_ok_and(|npz| npz.has("labels") || npz.has("offsets"))
}

/// The `count` values of `key`; `None` if the file does not have it, or without a count.
fn column<T>(
    npz: &mut NpzReader,
    key: &str,
    count: Option<usize>,
    read: impl FnOnce(&mut NpzReader, &str) -> Result<Vec<T>, FormatError>,
) -> Result<Option<Vec<T>>, FormatError> {
    let Some(count) = count.filter(|_| npz.has(key)) else { return Ok(None) };
    let values = read(npz, key)?;
    check_count(npz, key, &values, count)?;
    Ok(Some(values))
}

fn check_count<T>(npz: &NpzReader, key: &str, values: &[T], m: usize) -> Result<(), FormatError> {
    match values.len() {
        found if found == m => Ok(()),
        found => {
            Err(npz.error(key, format!("expected {m} values, one for each cloud, found {found}")))
        }
    }
}

/// The shape of the points, `[m, n, 3]` or `[total, 3]`, and their coordinates.
fn read_points(npz: &mut NpzReader) -> Result<(Vec<usize>, Vec<f32>), FormatError> {
    let (key, scale) =
        if npz.has("points_i16") { ("points_i16", I16_SCALE) } else { ("points", 1.0) };
    if !npz.has(key) {
        let keys = npz.keys().join(", ");
        let cause = format!("expected a packed set of labelled clouds, found the keys [{keys}]");
        return Err(npz.error(key, cause));
    }
    let may_be_ragged = npz.has("offsets");
    npz.entry(key, |header, _, elements| {
        let is_ragged = may_be_ragged && matches!(header.shape[..], [_, 3]);
        if !is_ragged && !matches!(header.shape[..], [_, _, 3]) {
            let expected = if may_be_ragged { "[total, 3]" } else { "[m, n, 3]" };
            return Err(invalid(format!("expected shape {expected}, found {:?}", header.shape)));
        }
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
        // f32 represents every i16 and the scale exactly, so that the quotient is rounded
        // once, as in NumPy.
        let points = npy::read_numbers(elements, &header, |x| x as f32 / scale)?;
        Ok((header.shape, points))
    })
}

/// The offsets of clouds of `total` points together.
fn read_offsets(npz: &mut NpzReader, total: usize) -> Result<Vec<usize>, FormatError> {
    const KEY: &str = "offsets";
    let offsets: Vec<usize> = read_whole_numbers(npz, KEY)?;
    let ends = [("first", offsets.first(), 0), ("last", offsets.last(), total)];
    for (which, found, expected) in ends {
        if found != Some(&expected) {
            let found = found.map_or("none".to_owned(), usize::to_string);
            return Err(npz.error(KEY, format!("expected {expected} {which}, found {found}")));
        }
    }
    if let Some(at) = offsets.windows(2).position(|pair| pair[0] > pair[1]) {
        let [before, after] = [offsets[at], offsets[at + 1]];
        let cause = format!("expected values that ascend, found {after} after {before}");
        return Err(npz.error(KEY, cause));
    }
    Ok(offsets)
}

/// Moves the clouds that begin at `offsets` so that the sensor is at 0.
fn count_from_sensor(
    npz: &mut NpzReader,
    offsets: &[usize],
    points: &mut [[f32; 3]],
) -> Result<(), FormatError> {
    let m = offsets.len() - 1;
    let origins = npz.entry("sensor_origin", |header, _, elements| match header.shape[..] {
        [3] => Ok(npy::read_numbers(elements, &header, |x| x as f32)?.repeat(m)),
        [n, 3] if n == m => npy::read_numbers(elements, &header, |x| x as f32),
        _ => {
            let found = header.shape;
            Err(invalid(format!("expected shape [3] or [{m}, 3], found {found:?}")))
        }
    })?;
    for (span, origin) in offsets.windows(2).zip(origins.as_chunks::<3>().0) {
        for point in &mut points[span[0]..span[1]] {
            *point = [0, 1, 2].map(|axis| point[axis] - origin[axis]);
        }
    }
    Ok(())
}

fn read_labels(
    npz: &mut NpzReader,
    classes: Option<Vec<String>>,
) -> Result<(Vec<usize>, Option<Vec<String>>), FormatError> {
    const KEY: &str = "labels";
    let is_text = npz.entry(KEY, |header, _, _| Ok(header.descr.contains(['U', 'S'])))?;
    if !is_text {
        let labels: Vec<usize> = read_whole_numbers(npz, KEY)?;
        let most = classes.as_ref().map_or(usize::MAX, Vec::len);
        return match labels.iter().find(|&&label| label >= most) {
            Some(label) => {
                Err(npz.error(KEY, format!("expected labels below {most}, found {label}")))
            }
            None => Ok((labels, classes)),
        };
    }
    let words = npz.text(KEY)?;
    let classes = classes
        .unwrap_or_else(|| words.iter().collect::<BTreeSet<_>>().into_iter().cloned().collect());
    let label = |word: &String| {
        let place = classes.iter().position(|class| class == word);
        place.ok_or_else(|| npz.error(KEY, format!("expected one of the classes, found `{word}`")))
    };
    let labels = words.iter().map(label).collect::<Result<_, _>>()?;
    Ok((labels, Some(classes)))
}

fn read_whole_numbers<T: TryFrom<u64>>(
    npz: &mut NpzReader,
    key: &str,
) -> Result<Vec<T>, FormatError> {
    let numbers = read_list(npz, key, |number| number)?;
    let whole = |number: f64| {
        // f64 represents every whole number up to 2^53, far beyond any class.
        let is_whole = number >= 0.0 && number.fract() == 0.0 && number < 2f64.powi(53);
        is_whole.then_some(number as u64).and_then(|number| T::try_from(number).ok())
    };
    let expected =
        |number: f64| npz.error(key, format!("expected whole numbers from 0, found {number}"));
    numbers.into_iter().map(|number| whole(number).ok_or_else(|| expected(number))).collect()
}

fn read_list<T: Copy>(
    npz: &mut NpzReader,
    key: &str,
    convert: impl Fn(f64) -> T,
) -> Result<Vec<T>, FormatError> {
    npz.entry(key, |header, _, elements| {
        if !matches!(header.shape[..], [_] | [_, 1]) {
            return Err(invalid(format!("expected shape [m], found {:?}", header.shape)));
        }
        npy::read_numbers(elements, &header, convert)
    })
}
