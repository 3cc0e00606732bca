//! Rust's lists as NumPy arrays, without a copy, and arrays as lists.

use crate::error::raised;
use formats::Scan;
use glam::DMat4;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_gpu::pose::Pose;

/// `[n, 3]`.
pub fn vectors(py: Python<'_>, vectors: Vec<[f32; 3]>) -> PyResult<Bound<'_, PyAny>> {
    let n = vectors.len();
    let array = Array2::from_shape_vec((n, 3), vectors.into_flattened()).map_err(raised)?;
    Ok(array.into_pyarray(py).into_any())
}

/// The points of `array`.
pub fn points(array: &PyReadonlyArray2<'_, f32>) -> PyResult<Vec<[f32; 3]>> {
    if array.shape()[1] != 3 {
        return Err(raised(format!("expected points of shape [n, 3], found {:?}", array.shape())));
    }
    Ok(array.as_array().rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect())
}

/// From the sensor's frame to the world's, row by row.
pub fn matrix(pose: &Pose) -> Vec<f64> {
    let world_from_sensor =
        DMat4::from_rotation_translation(pose.world_from_sensor, pose.position_m);
    world_from_sensor.transpose().to_cols_array().to_vec()
}

/// The columns of `scan` by their names in files.
pub fn scan(py: Python<'_>, scan: Scan) -> PyResult<Bound<'_, PyDict>> {
    let columns = PyDict::new(py);
    columns.set_item("origin", scan.origin)?;
    columns.set_item("positions", vectors(py, scan.positions)?)?;
    let put = |name: &str, column: Option<Bound<'_, PyAny>>| match column {
        Some(column) => columns.set_item(name, column),
        None => Ok(()),
    };
    macro_rules! numbers {
        ($($name:literal: $column:expr),* $(,)?) => {
            $(put($name, $column.map(|column| column.into_pyarray(py).into_any()))?;)*
        };
    }
    numbers! {
        "range": scan.range_m,
        "beam": scan.beam,
        "ring": scan.ring,
        "time": scan.time_s,
        "triangle": scan.triangle,
        "object": scan.object,
        "intensity": scan.intensity,
        "power": scan.power,
        "reflectivity": scan.reflectivity,
        "return": scan.return_number,
        "medium": scan.medium,
    }
    for (name, column) in
        [("sensor", scan.sensor_m), ("attitude", scan.attitude_rad), ("normal", scan.normal)]
    {
        put(name, column.map(|column| vectors(py, column)).transpose()?)?;
    }
    Ok(columns)
}
