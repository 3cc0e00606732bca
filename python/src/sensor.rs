use crate::error::raised;
use crate::process::LazyCaster;
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use sim_gpu::sensors::SensorProfile;

/// A sensor, its beams, and what casts them.
///
/// Its beams are made while Python's lock is held, so that no fork finds them half made.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Sensor {
    pub sensor: sim_gpu::Sensor,
    pub caster: LazyCaster,
}

#[pymethods]
impl Sensor {
    /// A built-in sensor by its name, or the profile in a file.
    #[new]
    fn new(name: &str, adapter: &str) -> PyResult<Self> {
        let sensor = SensorProfile::resolve(name).map_err(raised)?.into();
        Ok(Self { sensor, caster: LazyCaster::new(adapter) })
    }

    /// The sensor's name.
    #[getter]
    fn name(&self) -> &str {
        self.sensor.name()
    }

    /// Unit vectors of all beams in the sensor's frame, `[n_beams, 3]`.
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let directions = self.sensor.directions();
        let flat = directions.iter().flat_map(|d| d.to_array()).collect();
        let array = Array2::from_shape_vec((directions.len(), 3), flat).map_err(raised)?;
        Ok(array.into_pyarray(py))
    }

    /// The ring of each beam, counted from below, `[n_beams]`.
    #[getter]
    fn rings<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u16>> {
        self.sensor.rings().to_vec().into_pyarray(py)
    }

    /// Seconds from the start of the revolution to each beam, `[n_beams]`.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.sensor.times_s().to_vec().into_pyarray(py)
    }
}
