use crate::error::{raised, warn};
use crate::process;
use crate::{arrays, segment};
use edgepuck_scenes::{LabelledScene, Recipe, SceneError, Stage};
use edgepuck_segment::Settings;
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::path::PathBuf;

/// The scenes of a recipe.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Scenes {
    stage: Stage,
}

#[pymethods]
impl Scenes {
    /// A built-in recipe by its name, or one in a file. The CPU casts.
    #[new]
    fn new(
        py: Python<'_>,
        recipe: PathBuf,
        sensors: Vec<String>,
        meshes: Option<PathBuf>,
        seed: u64,
    ) -> PyResult<Self> {
        let stage = process::run(py, || {
            let mut scenes = Recipe::resolve(&recipe)?;
            scenes.use_sensors(&sensors);
            Stage::new(scenes, &recipe, meshes.as_deref(), seed)
        })?;
        let stage = stage.map_err(|error: SceneError| raised(error))?;
        warn(py, stage.warnings())?;
        Ok(Self { stage })
    }

    /// The classes' names, sorted.
    #[getter]
    fn classes(&self) -> Vec<&str> {
        self.stage.classes().iter().map(String::as_str).collect()
    }

    /// Scene number `number`: its scan, the cluster of each point, and what clusters and objects
    /// are.
    fn draw<'py>(&self, py: Python<'py>, number: u32) -> PyResult<Bound<'py, PyDict>> {
        let settings = Settings::default();
        let drawn = process::run(py, || LabelledScene::new(&self.stage, number, &settings))?;
        let LabelledScene { scene, sweep, labels, clusters } = drawn.map_err(raised)?;
        let found = PyDict::new(py);
        found.set_item("sensor", self.stage.sensor(&scene).name())?;
        found.set_item("cluster", segment::numbers(&labels).into_pyarray(py))?;
        let of_clusters = |of: &dyn Fn(&edgepuck_scenes::LabelledCluster) -> f32| {
            clusters.iter().map(of).collect::<Vec<_>>().into_pyarray(py)
        };
        let classes: Vec<i64> = clusters.iter().map(|cluster| cluster.label as i64).collect();
        found.set_item("cluster_class", classes.into_pyarray(py))?;
        found.set_item("cluster_truth_share", of_clusters(&|cluster| cluster.truth_share))?;
        found.set_item("cluster_height", of_clusters(&|cluster| cluster.height_m))?;
        let objects = PyList::empty(py);
        for (i, object) in scene.objects.iter().enumerate() {
            let of_object = PyDict::new(py);
            of_object.set_item("class", &self.stage.recipe().object[object.entry].class)?;
            of_object.set_item("position", object.position.to_array())?;
            of_object.set_item("size", self.stage.size_m(&scene, i).to_array())?;
            of_object.set_item("yaw_deg", object.yaw_rad.to_degrees())?;
            objects.append(of_object)?;
        }
        found.set_item("objects", objects)?;
        found.set_item("scan", arrays::cast(py, sweep.scan)?)?;
        Ok(found)
    }
}
