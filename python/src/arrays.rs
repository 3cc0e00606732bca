//! Rust's lists as NumPy arrays, without a copy, and arrays as lists.

use crate::error::{raised, warn};
use edgepuck_segment::other_axis_up;
use formats::Scan;
use formats::hash::Hashing;
use formats::plausible::{judge_surroundings, judge_sweep};
use formats::points_file::PointsReader;
use formats::scan::{Attribute, ColumnSlot, OBJECT_TEXTS};
use formats::scan_file::{ScanFormat, write_scan};
use numpy::ndarray::Array2;
use numpy::{Element, IntoPyArray, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::PathBuf;

/// `[n, 3]`.
pub fn vectors(py: Python<'_>, vectors: Vec<[f32; 3]>) -> PyResult<Bound<'_, PyAny>> {
    let n = vectors.len();
    let array = Array2::from_shape_vec((n, 3), vectors.into_flattened()).map_err(raised)?;
    Ok(array.into_pyarray(py).into_any())
}

pub fn points(array: &PyReadonlyArray2<'_, f32>) -> PyResult<Vec<[f32; 3]>> {
    if array.shape()[1] != 3 {
        return Err(raised(format!("expected points of shape [n, 3], found {:?}", array.shape())));
    }
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// The points of a sweep, metres from the sensor.
pub fn sweep(py: Python<'_>, array: &PyReadonlyArray2<'_, f32>) -> PyResult<Vec<[f32; 3]>> {
    let points = points(array)?;
    let remedy = "subtract the sensor's position before rounding to 32 bits, or give metres";
    let warning = judge_sweep(points.iter().map(|point| point.map(f64::from)), remedy)
        .map_err(|(part, cause)| raised(format!("{part}: {cause}")))?;
    let is_around = || judge_surroundings(&points, || other_axis_up(&points));
    warn(py, warning.or_else(is_around).as_slice())?;
    Ok(points)
}

/// The columns of a `scan` that was cast.
pub fn cast(py: Python<'_>, scan: Scan) -> PyResult<Bound<'_, PyDict>> {
    if scan.is_empty() {
        let cause = "no beam returned a point: expected an object in the sensor's range and view";
        warn(py, &[cause])?;
    }
    columns(py, scan)
}

/// The columns of `scan` by their names in files.
fn columns(py: Python<'_>, mut scan: Scan) -> PyResult<Bound<'_, PyDict>> {
    let columns = PyDict::new(py);
    columns.set_item("origin", scan.origin)?;
    columns.set_item("pose", scan.pose.as_ref())?;
    for (key, texts) in OBJECT_TEXTS.iter().zip(&scan.object_texts) {
        columns.set_item(key, Some(texts).filter(|texts| !texts.is_empty()))?;
    }
    columns.set_item("positions", vectors(py, std::mem::take(&mut scan.positions))?)?;
    for attribute in Attribute::ALL {
        let column = match scan.slot(attribute) {
            ColumnSlot::F32(slot) => numbers(py, slot),
            ColumnSlot::U8(slot) => numbers(py, slot),
            ColumnSlot::U16(slot) => numbers(py, slot),
            ColumnSlot::U32(slot) => numbers(py, slot),
            ColumnSlot::Vector(slot) => slot.take().map(|taken| vectors(py, taken)).transpose()?,
        };
        if let Some(column) = column {
            columns.set_item(attribute.name(), column)?;
        }
    }
    Ok(columns)
}

/// The columns of the points in a file, which [`PointsReader::read`] reads.
#[pyfunction]
pub fn read_points<'py>(
    py: Python<'py>,
    path: PathBuf,
    format: Option<&str>,
    metadata: Option<PathBuf>,
    sender: Option<&str>,
) -> PyResult<Bound<'py, PyDict>> {
    let format = format.map(str::parse).transpose().map_err(raised)?;
    let from = sender.map(str::parse).transpose();
    let from =
        from.map_err(|_| raised(format!("sender: expected an address, found {sender:?}")))?;
    let read = py.detach(|| PointsReader { format, metadata, from }.read(&path));
    let (read, warnings) = read.map_err(raised)?;
    warn(py, &warnings)?;
    if read.is_empty() {
        warn(py, &[format!("{}: holds no points", path.display())])?;
    }
    columns(py, read)
}

/// A scan of the columns of [`columns`].
pub fn scan_of(columns: &Bound<'_, PyDict>) -> PyResult<Scan> {
    let mut scan = Scan::default();
    for (name, column) in columns {
        let name: String = name.extract()?;
        match name.as_str() {
            "origin" => scan.origin = column.extract()?,
            "pose" => scan.pose = Some(column.extract()?),
            "object_names" => scan.object_texts[0] = column.extract()?,
            "object_labels" => scan.object_texts[1] = column.extract()?,
            "positions" => scan.positions = points(&column.extract()?)?,
            name => match scan.slot(name.parse().map_err(raised)?) {
                ColumnSlot::F32(slot) => *slot = Some(list(name, &column)?),
                ColumnSlot::U8(slot) => *slot = Some(list(name, &column)?),
                ColumnSlot::U16(slot) => *slot = Some(list(name, &column)?),
                ColumnSlot::U32(slot) => *slot = Some(list(name, &column)?),
                ColumnSlot::Vector(slot) => *slot = Some(points(&column.extract()?)?),
            },
        }
    }
    Ok(scan)
}

/// Write the scan of these columns to a file of the format that its extension names.
#[pyfunction]
pub fn save_scan(path: PathBuf, columns: &Bound<'_, PyDict>) -> PyResult<()> {
    let format = ScanFormat::of_path(&path).map_err(raised)?;
    write_scan(&path, format, Hashing::None, &scan_of(columns)?).map_err(raised)?;
    Ok(())
}

fn list<T: Element + Copy>(name: &str, column: &Bound<'_, PyAny>) -> PyResult<Vec<T>> {
    match column.extract::<PyReadonlyArray1<'_, T>>() {
        Ok(column) => Ok(column.as_array().to_vec()),
        Err(_) => {
            let expected = numpy::dtype::<T>(column.py());
            let (found, shape) = (column.getattr("dtype")?, column.getattr("shape")?);
            let cause =
                format!("expected type {expected} and shape [n], found {found} and {shape}");
            Err(raised(format!("{name}: {cause}")))
        }
    }
}

/// `[n]`, where there are any.
fn numbers<'py, T: Element>(
    py: Python<'py>,
    slot: &mut Option<Vec<T>>,
) -> Option<Bound<'py, PyAny>> {
    slot.take().map(|taken| taken.into_pyarray(py).into_any())
}
