use crate::error::{raised, warn};
use crate::process;
use edgepuck_mesh::frame::{Normalize, Unit, Up};
use formats::plausible::mesh_size;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A mesh in the world's frame, with its tree.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Mesh {
    pub mesh: sim_gpu::Mesh,
}

#[pymethods]
impl Mesh {
    /// Read a mesh file.
    #[staticmethod]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        up: Option<&str>,
        units: &str,
        normalize: &str,
    ) -> PyResult<Self> {
        let up: Option<Up> = up.map(str::parse).transpose().map_err(raised)?;
        let unit: Unit = units.parse().map_err(raised)?;
        let normalize: Normalize = normalize.parse().map_err(raised)?;
        let read = || Ok(Self::new(&sim_gpu::Mesh::read_in(&path, up, unit)?, normalize));
        let mesh = process::run(py, read)?.map_err(|error: sim_gpu::Error| raised(error))?;
        warn(py, mesh.mesh.warnings())?;
        Ok(mesh)
    }

    /// Take vertices, `[n, 3]`, and triangles, `[m, 3]`.
    #[staticmethod]
    fn of_arrays(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
        up: &str,
        units: &str,
        normalize: &str,
    ) -> PyResult<Self> {
        for (name, shape) in [("vertices", vertices.shape()), ("faces", faces.shape())] {
            if shape[1] != 3 {
                return Err(raised(format!("expected {name} of shape [n, 3], found {shape:?}")));
            }
        }
        let up: Up = up.parse().map_err(raised)?;
        let unit: Unit = units.parse().map_err(raised)?;
        let normalize: Normalize = normalize.parse().map_err(raised)?;
        let rows = vertices.as_array();
        let vertices = rows.rows().into_iter().map(|row| [row[0], row[1], row[2]]);
        let index = |&index: &i64| {
            u32::try_from(index).map_err(|_| {
                let n = rows.nrows();
                raised(format!("faces: expected indices of {n} vertices, found {index}"))
            })
        };
        let mut triangles = Vec::with_capacity(faces.shape()[0]);
        for row in faces.as_array().rows() {
            triangles.push([index(&row[0])?, index(&row[1])?, index(&row[2])?]);
        }
        let vertices = vertices.collect();
        let (mesh, warnings) = process::run(py, || {
            let mesh = sim_gpu::Mesh::from_triangles_in(vertices, triangles, up, unit);
            let mesh = mesh.map_err(raised)?;
            let warnings = mesh.warnings().to_vec();
            Ok::<_, PyErr>((Self::new(&mesh, normalize), warnings))
        })??;
        warn(py, &warnings)?;
        Ok(mesh)
    }

    /// Metres for each unit of length of the source.
    #[getter]
    fn scale(&self) -> f64 {
        self.mesh.scale()
    }

    /// Why its source's unit is probably not `units`, if its size says so.
    fn odd_size(&self, units: &str) -> PyResult<Option<String>> {
        let unit = units.parse().map_err(raised)?;
        let warning = mesh_size(self.mesh.extent().size_m(), unit, "`units` names another unit");
        Ok(warning.map(|warning| warning.to_string()))
    }

    /// What became the origin, in the source's units.
    #[getter]
    fn centre(&self) -> [f64; 3] {
        self.mesh.centre()
    }

    /// How many triangles there are.
    fn __len__(&self) -> usize {
        self.mesh.triangles().len()
    }

    /// The vertices in the world's frame, metres, `[n, 3]`.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let vertices = self.mesh.vertices();
        let numbers: Vec<f64> = vertices.iter().flat_map(|vertex| vertex.to_array()).collect();
        numbers.into_pyarray(py).reshape([vertices.len(), 3])
    }

    /// The triangles as indices of vertices, `[m, 3]`.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let triangles = self.mesh.triangles();
        let indices = triangles.as_flattened().iter().copied().map(i64::from);
        indices.collect::<Vec<_>>().into_pyarray(py).reshape([triangles.len(), 3])
    }
}

impl Mesh {
    /// The mesh with its tree, which is built before others see it, so that no fork finds it half
    /// built.
    fn new(mesh: &sim_gpu::Mesh, normalize: Normalize) -> Self {
        let mesh = mesh.normalized(normalize);
        let _ = mesh.target();
        Self { mesh }
    }
}
