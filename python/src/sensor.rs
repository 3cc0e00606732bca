//! A sensor, and its scan of one mesh.

use crate::arrays;
use crate::error::{raised, raised_with_causes};
use crate::mesh::Mesh;
use crate::process::{self, LazyCaster};
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet};
use glam::{DMat3, DQuat, DVec3};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_gpu::effects::{Effects, Footprint, Intensity};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{ScanRequest, scan};
use sim_gpu::internals::sensor::BeamPattern;
use std::sync::{Arc, Mutex, OnceLock};

/// A sensor and its beams.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Sensor {
    sensor: sim_gpu::internals::sensor::Sensor,
    pattern: OnceLock<Arc<BeamPattern>>,
    /// The rays of its beams for the footprint that was asked for last.
    widened: Mutex<Option<(Footprint, Arc<BeamPattern>)>>,
    caster: LazyCaster,
}

#[pymethods]
impl Sensor {
    /// A built-in sensor by its name, or the profile in a file.
    #[new]
    fn new(name: &str, adapter: &str) -> PyResult<Self> {
        let sensor = sim_gpu::internals::sensor::Sensor::resolve(name).map_err(raised)?;
        let (pattern, widened) = (OnceLock::new(), Mutex::new(None));
        Ok(Self { sensor, pattern, widened, caster: LazyCaster::new(adapter) })
    }

    /// The sensor's name.
    #[getter]
    fn name(&self) -> &str {
        &self.sensor.name
    }

    /// Unit vectors of all beams in the sensor's frame, `[n_beams, 3]`.
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let pattern = self.pattern(py)?;
        let flat = pattern.directions.iter().flat_map(|d| d.to_array()).collect();
        let array = Array2::from_shape_vec((pattern.len(), 3), flat).map_err(raised)?;
        Ok(array.into_pyarray(py))
    }

    /// The ring of each beam, counted from below, `[n_beams]`.
    #[getter]
    fn rings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<u16>>> {
        Ok(self.pattern(py)?.ring.clone().into_pyarray(py))
    }

    /// Seconds from the start of the revolution to each beam, `[n_beams]`.
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(self.pattern(py)?.time_s.clone().into_pyarray(py))
    }

    /// Scan a mesh from this place.
    fn scan<'py>(
        &self,
        py: Python<'py>,
        mesh: &Mesh,
        place: Place,
        effects: &str,
        attributes: Vec<String>,
        seed: u64,
    ) -> PyResult<Bound<'py, PyDict>> {
        let pose = place.pose()?;
        let mut effects: Effects =
            serde_json::from_str(effects).map_err(|error| raised(format!("effects: {error}")))?;
        let attributes = attributes.iter().map(|name| name.parse::<Attribute>());
        let attributes: AttributeSet = attributes.collect::<Result<_, _>>().map_err(raised)?;
        if attributes.contains(&Attribute::Intensity) {
            effects.intensity.get_or_insert(Intensity);
        }
        effects.validate().map_err(raised)?;
        effects.for_sensor(&self.sensor).map_err(raised)?;
        let (pattern, caster) = (self.rays(py, &effects)?, self.caster.open(&effects)?);
        let scanned = process::run(py, || {
            let mut request = ScanRequest::new(&self.sensor, &pattern, pose);
            request.attributes = attributes;
            request.stream = StreamKey::new(seed, "scan", 0);
            Ok(scan(&caster, &mesh.target, &request)?)
        })?;
        let told = arrays::scan(py, scanned.map_err(raised_with_causes)?)?;
        told.set_item("pose", arrays::matrix(&pose))?;
        Ok(told)
    }
}

impl Sensor {
    fn pattern(&self, py: Python<'_>) -> PyResult<Arc<BeamPattern>> {
        if let Some(pattern) = self.pattern.get() {
            return Ok(Arc::clone(pattern));
        }
        let made = process::run(py, || Arc::new(self.sensor.pattern()))?;
        Ok(Arc::clone(self.pattern.get_or_init(|| made)))
    }

    /// The rays that are cast for `effects`. Nothing of Python runs while the lock is held, so that no
    /// fork finds it locked.
    fn rays(&self, py: Python<'_>, effects: &Effects) -> PyResult<Arc<BeamPattern>> {
        let pattern = self.pattern(py)?;
        let Some(footprint) = effects.footprint else { return Ok(pattern) };
        if let Some((of, rays)) = &*process::lock(&self.widened)
            && *of == footprint
        {
            return Ok(Arc::clone(rays));
        }
        let made = process::run(py, || effects.widen((*pattern).clone(), &self.sensor))?;
        let rays = Arc::new(made.map_err(raised)?);
        *process::lock(&self.widened) = Some((footprint, Arc::clone(&rays)));
        Ok(rays)
    }
}

/// Where a sensor stands.
#[derive(FromPyObject)]
enum Place {
    /// Around the origin: distance in metres, elevation and azimuth in degrees.
    Around([f64; 3]),
    /// From the sensor's frame to the world's, row by row.
    Matrix([f64; 16]),
}

impl Place {
    fn pose(&self) -> PyResult<Pose> {
        let numbers = match self {
            Self::Around(numbers) => &numbers[..],
            Self::Matrix(numbers) => numbers,
        };
        if let Some(number) = numbers.iter().find(|number| !number.is_finite()) {
            return Err(raised(format!(
                "expected finite numbers as the sensor's place, found {number}"
            )));
        }
        match *self {
            Self::Around(around) => view(around),
            Self::Matrix(rows) => pose_of(&rows),
        }
    }
}

fn view([distance_m, elevation_deg, azimuth_deg]: [f64; 3]) -> PyResult<Pose> {
    if distance_m <= 0.0 {
        return Err(raised(format!("expected a distance above 0, found {distance_m}")));
    }
    let (elevation, azimuth) = (elevation_deg.to_radians(), azimuth_deg.to_radians());
    Ok(Pose::view(distance_m, elevation, azimuth, DVec3::ZERO))
}

/// The pose that a matrix of four rows tells.
fn pose_of(rows: &[f64; 16]) -> PyResult<Pose> {
    let [a, b, c, x, d, e, f, y, g, h, i, z, 0.0, 0.0, 0.0, 1.0] = *rows else {
        let cause = "pose: expected a matrix of shape [4, 4] whose last row is 0, 0, 0, 1";
        return Err(raised(cause));
    };
    let rotation = DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]);
    let is_rotation = (rotation * rotation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-6)
        && rotation.determinant() > 0.0;
    if !is_rotation {
        return Err(raised("pose: expected a rotation in the first three rows and columns"));
    }
    let rotation = DQuat::from_mat3(&rotation).normalize();
    Ok(Pose { position_m: DVec3::new(x, y, z), rotation })
}
