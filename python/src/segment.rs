use crate::arrays::{points, sweep};
use crate::error::raised;
use edgepuck_segment::{Label, Segmenter, Settings, Sweep};
use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

/// The number of each point's cluster, from 0; -1 of ground, -2 of what is in no cluster, -3 of a
/// point that is not finite.
pub fn numbers(labels: &[Label]) -> Vec<i32> {
    let number = |label: &Label| match *label {
        Label::Cluster(number) => number as i32,
        Label::Ground => -1,
        Label::Small => -2,
        Label::Invalid => -3,
    };
    labels.iter().map(number).collect()
}

/// Cut a sweep, `[n, 3]` from the sensor, of which the rings may be known. With a radius, connected
/// components take the place of both.
#[pyfunction]
pub fn segment<'py>(
    py: Python<'py>,
    cloud: PyReadonlyArray2<'py, f32>,
    rings: Option<PyReadonlyArray1<'py, u16>>,
    radius: Option<f32>,
    min_points: Option<usize>,
) -> PyResult<Bound<'py, PyArray1<i32>>> {
    // Connected components need no sweep.
    let cloud = if radius.is_some() { points(&cloud)? } else { sweep(py, &cloud)? };
    let rings = rings.map(|rings| rings.as_array().to_vec());
    let mut settings = radius.map_or_else(Settings::default, Settings::of_components);
    if let Some(min_points) = min_points {
        settings.min_points = min_points;
    }
    let found = py.detach(|| {
        let mut segmenter = Segmenter::new(settings).map_err(raised)?;
        let sweep = Sweep { points: &cloud, rings: rings.as_deref() };
        Ok::<_, PyErr>(numbers(segmenter.segment(&sweep).map_err(raised)?.labels()))
    })?;
    Ok(found.into_pyarray(py))
}
