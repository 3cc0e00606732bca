//! Scenes that Python fills, and those that files describe.

use crate::arrays;
use crate::error::{raised, warn};
use crate::mesh::Mesh;
use crate::process::{self, LazyCaster, lock};
use crate::sensor::Sensor;
use formats::plausible::upside_down;
use formats::scan::Attribute;
use glam::{DMat3, DQuat, DVec3};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sim_gpu::scene_files::check_object;
use sim_gpu::{Batch, Effects, Import, Moves, Pose};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Mutex;

/// A scan's columns and the name of its sensor.
type NamedScan<'py> = (String, Bound<'py, PyDict>);

/// Meshes in the world, and the sensors of a scene's file.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Scene {
    /// A scan takes a copy, which shares the meshes: the lock is held for a moment, under Python's.
    scene: Mutex<sim_gpu::Scene>,
}

#[pymethods]
impl Scene {
    /// An empty scene.
    #[new]
    fn new() -> Self {
        Self { scene: Mutex::default() }
    }

    /// Read a scene's TOML file, a glTF file or a robot.
    #[staticmethod]
    fn read(
        py: Python<'_>,
        file: PathBuf,
        joints: BTreeMap<String, f64>,
        collision: bool,
        base_colours: bool,
    ) -> PyResult<Self> {
        let import = Import { joints, collision, base_colours };
        let scene = process::run(py, || {
            let mut scene = sim_gpu::Scene::new();
            if import == Import::default() {
                scene = sim_gpu::Scene::read(&file)?;
            } else {
                scene.add_file(&file, &import)?;
            }
            for instance in scene.instances() {
                let _ = instance.mesh.target();
            }
            Ok::<_, sim_gpu::Error>(scene)
        })?;
        let scene = scene.map_err(raised)?;
        warn(py, &scene.warnings())?;
        Ok(Self { scene: Mutex::new(scene) })
    }

    /// How many instances there are.
    fn __len__(&self) -> usize {
        lock(&self.scene).instances().len()
    }

    /// The names of the instances.
    fn names(&self) -> Vec<Option<String>> {
        lock(&self.scene).instances().iter().map(|instance| instance.name.clone()).collect()
    }

    /// The labels of the instances.
    fn labels(&self) -> Vec<Option<String>> {
        lock(&self.scene).instances().iter().map(|instance| instance.label.clone()).collect()
    }

    /// The bounding boxes of the instances.
    fn bounds(&self) -> Vec<[[f64; 3]; 2]> {
        let extents = lock(&self.scene).clone();
        let extents = extents.instances().iter().map(sim_gpu::Instance::extent);
        extents.map(|extent| [extent.low.to_array(), extent.high.to_array()]).collect()
    }

    /// Add a mesh at this pose, and give its number.
    #[expect(clippy::too_many_arguments, reason = "Python's side has names for them")]
    fn add(
        &self,
        py: Python<'_>,
        mesh: &Mesh,
        pose: PyReadonlyArray2<'_, f64>,
        scale: [f64; 3],
        name: Option<String>,
        label: Option<String>,
        reflectivity: f64,
        retroreflection: f64,
    ) -> PyResult<u32> {
        check_object(str::to_owned, scale, reflectivity, retroreflection).map_err(raised)?;
        let (poses, mut scene) = (poses_of(py, "the instance", &pose)?, lock(&self.scene));
        let id = scene.add(&mesh.mesh, poses[0]);
        let instance = &mut scene[id];
        (instance.scale, instance.name, instance.label) = (scale.into(), name, label);
        (instance.reflectivity, instance.retroreflection) = (reflectivity, retroreflection);
        Ok(id.number())
    }

    /// Move the instances of these numbers, all or none.
    fn move_all(
        &self,
        py: Python<'_>,
        numbers: Vec<usize>,
        poses: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<()> {
        let (poses, mut scene) = (poses_of(py, "the instance", &poses)?, lock(&self.scene));
        for (id, pose) in ids_of(&scene, &numbers)?.into_iter().zip(poses) {
            scene[id].pose = pose;
        }
        Ok(())
    }

    /// Scan it from this place.
    fn scan<'py>(
        &self,
        py: Python<'py>,
        sensor: &Sensor,
        place: PyReadonlyArray2<'py, f64>,
        effects: Option<&str>,
        attributes: Option<Vec<String>>,
        seed: Option<u64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let pose = pose_at(py, &place)?;
        let (caster, mut scene) = (sensor.caster.open()?, lock(&self.scene).clone());
        read_effects(effects, &mut scene.effects)?;
        if let Some(names) = attributes {
            scene.attributes = read_attributes(&names)?.into_iter().collect();
        }
        scene.seed = seed.unwrap_or(scene.seed);
        sensor.sensor.rays(&scene.effects).map_err(raised)?;
        let scan = process::run(py, || scene.scan(&sensor.sensor, pose).with(&caster).run())?;
        arrays::cast(py, named(scan.map_err(raised)?.points, &scene))
    }

    /// The columns of a batch, `[n, n_beams]`, and the seed of each row; `moved` has the poses of the
    /// instances of these `numbers` for each pose.
    #[expect(clippy::too_many_arguments, reason = "Python's side has names for them")]
    fn cast<'py>(
        &self,
        py: Python<'py>,
        sensor: &Sensor,
        poses: PyReadonlyArray2<'py, f64>,
        numbers: Vec<usize>,
        moved: PyReadonlyArray2<'py, f64>,
        effects: Option<&str>,
        attributes: Vec<String>,
        seed: Option<u64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (caster, mut scene) = (sensor.caster.open()?, lock(&self.scene).clone());
        scene.seed = seed.unwrap_or(scene.seed);
        read_effects(effects, &mut scene.effects)?;
        let instances = ids_of(&scene, &numbers)?;
        let poses = poses_of(py, "the sensor", &poses)?;
        let moved = poses_of(py, "the instance", &moved)?;
        sensor.sensor.rays(&scene.effects).map_err(raised)?;
        let moves = Moves { instances: &instances, poses: &moved };
        let attributes = read_attributes(&attributes)?;
        let batch = process::run(py, || {
            let batch = scene.batch(&sensor.sensor, &poses).moving(moves).with(&caster);
            batch.attributes(attributes).run()
        })?;
        let shape = (poses.len(), sensor.sensor.directions().len());
        columns(py, shape, batch.map_err(raised)?)
    }

    /// Scan it by each of the sensors of its file.
    fn scan_all<'py>(&self, py: Python<'py>, adapter: &str) -> PyResult<Vec<NamedScan<'py>>> {
        let (caster, scene) = (LazyCaster::new(adapter).open()?, lock(&self.scene).clone());
        let scans = process::run(py, || scene.scan_all(&caster))?.map_err(raised)?;
        let columns = scans.into_iter().zip(&scene.sensors).map(|(scan, mounted)| {
            Ok((mounted.name.clone(), arrays::cast(py, named(scan.points, &scene))?))
        });
        columns.collect()
    }
}

/// The points with the names of the objects, if they know theirs.
fn named(points: formats::Scan, scene: &sim_gpu::Scene) -> formats::Scan {
    let object_texts = points.object.is_some().then(|| scene.object_texts());
    formats::Scan { object_texts: object_texts.unwrap_or_default(), ..points }
}

/// Takes `effects`, in JSON, in place of a scene's.
fn read_effects(effects: Option<&str>, to: &mut Effects) -> PyResult<()> {
    let Some(effects) = effects else { return Ok(()) };
    *to = serde_json::from_str(effects).map_err(|error| {
        // The place in the text of JSON says nothing to the user.
        let place = format!(" at line {} column {}", error.line(), error.column());
        raised(format!("effects: {}", error.to_string().replace(&place, "")))
    })?;
    Ok(())
}

fn read_attributes(names: &[String]) -> PyResult<Vec<Attribute>> {
    names.iter().map(|name| name.parse::<Attribute>()).collect::<Result<_, _>>().map_err(raised)
}

/// The columns of `batch` that there are, as arrays of this shape.
fn columns(py: Python<'_>, shape: (usize, usize), batch: Batch) -> PyResult<Bound<'_, PyDict>> {
    let Batch { range_m, object, second_range_m, intensity, power, seeds, .. } = batch;
    let arrays = PyDict::new(py);
    arrays.set_item("ranges", array(py, shape, range_m)?)?;
    arrays.set_item("object", array(py, shape, object)?)?;
    arrays.set_item("seeds", seeds.into_pyarray(py))?;
    let asked = [("second_ranges", second_range_m), ("intensity", intensity), ("power", power)];
    for (name, column) in asked {
        if !column.is_empty() {
            arrays.set_item(name, array(py, shape, column)?)?;
        }
    }
    Ok(arrays)
}

fn array<T: numpy::Element>(
    py: Python<'_>,
    shape: (usize, usize),
    numbers: Vec<T>,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    Ok(Array2::from_shape_vec(shape, numbers).map_err(raised)?.into_pyarray(py))
}

/// The handles of the instances of these numbers.
fn ids_of(scene: &sim_gpu::Scene, numbers: &[usize]) -> PyResult<Vec<sim_gpu::InstanceId>> {
    let id = |&number: &usize| {
        let n = scene.instances().len();
        let missing = || format!("expected the number of one of {n} instances, found {number}");
        let found = u32::try_from(number).ok().and_then(|number| scene.id(number));
        found.ok_or_else(|| raised(missing()))
    };
    numbers.iter().map(id).collect()
}

/// The pose of a sensor in a row of [`poses_of`], or of its distance in metres from the origin, at which it
/// looks, its elevation and its azimuth in degrees.
fn pose_at(py: Python<'_>, place: &PyReadonlyArray2<'_, f64>) -> PyResult<Pose> {
    match *place.as_slice()? {
        [distance_m, elevation_deg, azimuth_deg] => {
            Ok(Pose::looking_at_origin_deg(distance_m, elevation_deg, azimuth_deg))
        }
        _ => Ok(poses_of(py, "the sensor", place)?[0]),
    }
}

/// The poses of `what` in rows of matrices, of 16 numbers, or of positions and quaternions x, y, z, w, of
/// 7, which Python's side has checked. Quaternions that turn it over are warned of.
fn poses_of(py: Python<'_>, what: &str, rows: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<Pose>> {
    let pose = |row: &[f64]| match *row {
        [x, y, z, qx, qy, qz, qw] => Pose::rigid([x, y, z], [qx, qy, qz, qw]).map_err(raised),
        [a, b, c, x, d, e, f, y, g, h, i, z, ..] => {
            let rotation = DMat3::from_cols_array(&[a, d, g, b, e, h, c, f, i]);
            let rotation = DQuat::from_mat3(&rotation).normalize();
            Ok(Pose { position_m: DVec3::new(x, y, z), rotation })
        }
        _ => Err(raised(format!("expected rows of 7 or 16 numbers, found {}", row.len()))),
    };
    let width = rows.shape()[1];
    let poses: Vec<Pose> = rows.as_slice()?.chunks(width).map(pose).collect::<PyResult<_>>()?;
    let warning = (width == 7).then(|| upside_down(what, &poses)).flatten();
    warn(py, warning.as_slice())?;
    Ok(poses)
}
