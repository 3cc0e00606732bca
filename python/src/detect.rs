use crate::arrays::sweep;
use crate::error::{raised, raised_with_causes};
use infer_cpu::Options;
use infer_cpu::detect::{Detector, Object, OrientedBox, Sweep};
use numpy::{IntoPyArray, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::Path;

/// Find the objects of known classes in a sweep, `[n, 3]` from the sensor.
#[pyfunction]
pub fn detect<'py>(
    py: Python<'py>,
    cloud: PyReadonlyArray2<'py, f32>,
    rings: Option<PyReadonlyArray1<'py, u16>>,
    model: &str,
    precision: &str,
    min_points: usize,
    min_confidence: f64,
) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let options = Options { precision: precision.parse().map_err(raised)?, ..Options::default() };
    let rings = rings.map(|rings| rings.as_array().to_vec());
    let points = sweep(py, &cloud)?;
    let opened = py.detach(|| Detector::open(Path::new(model), &options, min_points));
    let mut detector = opened.map_err(|error| raised_with_causes(error.into()))?;
    detector.min_confidence = min_confidence;
    let sweep = Sweep { points: &points, rings: rings.as_deref() };
    let found = py.detach(|| detector.detect(&sweep));
    let found = found.map_err(|error| raised_with_causes(error.into()))?;
    let mut indices = vec![Vec::new(); found.objects.len()];
    for (&label, point) in found.labels.iter().zip(0u32..) {
        if let Some(object) = found.object(label) {
            indices[object].push(point);
        }
    }
    found
        .objects
        .iter()
        .zip(indices)
        .map(|(object, indices)| described(py, object, indices))
        .collect()
}

fn described<'py>(
    py: Python<'py>,
    object: &Object,
    indices: Vec<u32>,
) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    found.set_item("label", &object.class)?;
    found.set_item("confidence", object.confidence)?;
    found.set_item("points", object.n_points)?;
    found.set_item("indices", indices.into_pyarray(py))?;
    for (prefix, of) in [("", object.place), ("whole_", object.whole)] {
        let OrientedBox { centre_m, size_m, yaw_rad } = of;
        found.set_item(format!("{prefix}centre"), centre_m)?;
        found.set_item(format!("{prefix}size"), size_m)?;
        found.set_item(format!("{prefix}yaw_deg"), yaw_rad.to_degrees())?;
    }
    Ok(found)
}
