use crate::error::{raised, raised_with_causes, warn};
use crate::process::{self, LazyCaster};
use edgepuck_dataset::{self as dataset, Around, DatasetConfig, SetConfig};
use formats::Split;
use formats::plausible::Warning;
use formats::scan::Attribute;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray1, PyArray3};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Clouds, `[n, points, 3 + columns of attributes]`, and their classes, `[n]`.
type Batch<'py> = (Bound<'py, PyArray3<f32>>, Bound<'py, PyArray1<i64>>);

/// The clouds of a folder of meshes, scanned from viewpoints around each.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Clouds {
    clouds: dataset::Clouds,
    n_points: usize,
    attributes: Vec<Attribute>,
    caster: LazyCaster,
}

/// A number, or the bounds between which one is drawn.
type FromTo = (f64, Option<f64>);

/// The settings of a dataset, as `gen-dataset` has them.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Settings {
    sensor: String,
    points: u32,
    views: u32,
    distance: FromTo,
    elevation: FromTo,
    azimuth_jitter: f64,
    seed: u64,
    normalize: String,
    units: Option<String>,
    up: Option<String>,
    min_points: u32,
    effects: Option<PathBuf>,
    noise: f64,
    dropout: f64,
}

impl Settings {
    /// Points have these `attributes` besides their positions.
    fn config(self, attributes: &[Attribute]) -> Result<DatasetConfig, anyhow::Error> {
        let around = Around {
            count: Some(self.views),
            distance_m: Some(self.distance),
            elevation_deg: Some(self.elevation),
            azimuth_jitter_deg: Some(self.azimuth_jitter),
        };
        let sets = vec![SetConfig::of(&self.sensor)?.seen_from(around)?];
        let config = DatasetConfig {
            seed: self.seed,
            normalize: self.normalize.parse()?,
            units: self.units.map_or(Ok(dataset::Unit::Metre), |unit| unit.parse())?,
            up: self.up.map(|up| up.parse()).transpose()?,
            attributes: attributes.iter().copied().collect(),
            effects: match self.effects {
                Some(file) => dataset::read_effects(&file)?,
                None => dataset::noisy(self.noise, self.dropout)?,
            },
            packed_points: self.points,
            min_points: self.min_points,
            ..DatasetConfig::new(sets)
        };
        Ok(config.checked()?)
    }
}

#[pymethods]
impl Clouds {
    /// The clouds that `gen-dataset` makes with `settings` of the meshes in a folder, of one split or
    /// of both. Points have these attributes, in this order.
    #[new]
    fn new(
        py: Python<'_>,
        meshes: PathBuf,
        split: Option<&str>,
        settings: Settings,
        attributes: Vec<String>,
        cache_bytes: usize,
        adapter: &str,
    ) -> PyResult<Self> {
        let split: Option<Split> = split.map(str::parse).transpose().map_err(raised)?;
        let attributes = attributes.iter().map(|name| name.parse());
        let attributes: Vec<Attribute> = attributes.collect::<Result<_, _>>().map_err(raised)?;
        let config = settings.config(&attributes).map_err(raised_with_causes)?;
        let n_points = config.packed_points as usize;
        let clouds = process::run(py, || {
            let listed = dataset::discover(&meshes, config.seed)?;
            let warnings = edgepuck_mesh::tree::warnings(&meshes, &listed).into_iter();
            let warnings = warnings.map(|warning| warning.of(meshes.display())).collect();
            Ok((warnings, dataset::Clouds::new(config, &listed, split, cache_bytes)?))
        })?;
        let (warnings, clouds): (Vec<Warning>, _) = clouds.map_err(raised_with_causes)?;
        warn(py, &warnings)?;
        Ok(Self { clouds, n_points, attributes, caster: LazyCaster::new(adapter) })
    }

    fn __len__(&self) -> usize {
        self.clouds.len()
    }

    /// The classes' names, sorted.
    #[getter]
    fn classes(&self) -> Vec<&str> {
        self.clouds.classes().iter().map(String::as_str).collect()
    }

    /// The class of each cloud, `[len]`.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<i64>> {
        let labels = (0..self.clouds.len()).map(|index| self.clouds.label(index) as i64);
        labels.collect::<Vec<_>>().into_pyarray(py)
    }

    /// The mesh file of cloud `index`, from the folder of meshes.
    fn source(&self, index: usize) -> PyResult<&str> {
        self.check(index)?;
        Ok(&self.clouds.mesh(index).relative)
    }

    /// The clouds at `indices`, and their classes.
    fn draw<'py>(&self, py: Python<'py>, seed: u64, indices: Vec<usize>) -> PyResult<Batch<'py>> {
        indices.iter().try_for_each(|&index| self.check(index))?;
        let caster = self.caster.open()?;
        let draw = || self.clouds.draw(&caster, seed, &indices, &self.attributes);
        let rows = process::run(py, draw)?;
        let warnings = self.clouds.warnings();
        // Flags are arguments here.
        let argument = |told: &String| told.trim_start_matches("warning: ").replace(" --", " ");
        let warnings = warnings.iter().map(argument);
        warn(py, &warnings.collect::<Vec<_>>())?;
        let rows = rows.map_err(raised)?;
        let labels = indices.iter().map(|&index| self.clouds.label(index) as i64);
        let labels: Vec<i64> = labels.collect();
        let width = self.attributes.iter().map(|attribute| match attribute {
            Attribute::Sensor | Attribute::Attitude | Attribute::Normal => 3,
            _ => 1,
        });
        let shape = (rows.len(), self.n_points, 3 + width.sum::<usize>());
        let points = Array3::from_shape_vec(shape, rows.concat()).map_err(raised)?;
        Ok((points.into_pyarray(py), labels.into_pyarray(py)))
    }
}

impl Clouds {
    fn check(&self, index: usize) -> PyResult<()> {
        let n = self.clouds.len();
        if index < n {
            return Ok(());
        }
        let cause = format!("expected a number below {n}, that of the clouds, found {index}");
        Err(pyo3::exceptions::PyIndexError::new_err(cause))
    }
}

/// The seed of an epoch of a dataset with `seed`; each epoch has other views.
#[pyfunction]
pub fn seed_of_epoch(seed: u64, epoch: u32) -> u64 {
    dataset::seed_of_epoch(seed, epoch)
}
