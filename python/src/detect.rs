use crate::arrays::sweep;
use crate::error::{raised, raised_with_causes};
use edgepuck_program::detect::{Detector, Object};
use edgepuck_segment::OrientedBox;
use formats::Scan;
use infer_cpu::Options;
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
    let ring = rings.map(|rings| rings.as_array().to_vec());
    let scan = Scan { positions: sweep(py, &cloud)?, ring, ..Scan::default() };
    let found = py.detach(|| {
        let mut detector = Detector::open(Path::new(model), &options, min_points)?;
        detector.min_confidence = min_confidence;
        detector.detect(&scan)
    });
    let found = found.map_err(raised_with_causes)?;
    let mut indices = vec![Vec::new(); found.objects.len()];
    for (&label, point) in found.labels.iter().zip(0u32..) {
        if let Some(object) = found.object(label) {
            indices[object].push(point);
        }
    }
    found.objects.iter().zip(indices).map(|(object, indices)| told(py, object, indices)).collect()
}

fn told<'py>(py: Python<'py>, object: &Object, indices: Vec<u32>) -> PyResult<Bound<'py, PyDict>> {
    let told = PyDict::new(py);
    told.set_item("label", &object.class)?;
    told.set_item("confidence", object.confidence)?;
    told.set_item("points", object.n_points)?;
    told.set_item("indices", indices.into_pyarray(py))?;
    for (prefix, of) in [("", object.place), ("whole_", object.whole)] {
        let OrientedBox { centre_m, size_m, yaw_rad } = of;
        told.set_item(format!("{prefix}centre"), centre_m)?;
        told.set_item(format!("{prefix}size"), size_m)?;
        told.set_item(format!("{prefix}yaw_deg"), yaw_rad.to_degrees())?;
    }
    Ok(told)
}
