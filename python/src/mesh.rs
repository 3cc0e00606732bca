//! Meshes, ready to be scanned.

use crate::error::raised;
use crate::process;
use glam::DVec3;
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::mesh::frame::{Normalize, Up, to_world};
use sim_gpu::internals::mesh::{self, LoadedMesh};
use sim_gpu::internals::target::{Surface, Target};
use std::path::PathBuf;

/// A mesh in the world's frame, with its tree.
#[pyclass(module = "edgepuck._edgepuck", frozen)]
pub struct Mesh {
    pub target: Target,
    #[pyo3(get)]
    scale: f64,
    #[pyo3(get)]
    centre: [f64; 3],
}

#[pymethods]
impl Mesh {
    /// Read a mesh file.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, up: Option<&str>, normalize: &str) -> PyResult<Self> {
        let up: Option<Up> = up.map(str::parse).transpose().map_err(raised)?;
        let normalize: Normalize = normalize.parse().map_err(raised)?;
        process::run(py, || {
            let LoadedMesh { mesh, format, .. } = mesh::load(&path).map_err(raised)?;
            Ok(Self::new(&mesh, up.unwrap_or(format.default_up()), normalize))
        })?
    }

    /// Take vertices, `[n, 3]`, and triangles, `[m, 3]`.
    #[staticmethod]
    fn of_arrays(
        py: Python<'_>,
        vertices: PyReadonlyArray2<'_, f64>,
        faces: PyReadonlyArray2<'_, i64>,
        up: &str,
        normalize: &str,
    ) -> PyResult<Self> {
        for (name, shape) in [("vertices", vertices.shape()), ("faces", faces.shape())] {
            if shape[1] != 3 {
                return Err(raised(format!("expected {name} of shape [n, 3], found {shape:?}")));
            }
        }
        let up: Up = up.parse().map_err(raised)?;
        let normalize: Normalize = normalize.parse().map_err(raised)?;
        let rows = vertices.as_array();
        let vertices = rows.rows().into_iter().map(|row| DVec3::new(row[0], row[1], row[2]));
        let index = |&index: &i64| {
            u32::try_from(index).map_err(|_| {
                let n = rows.nrows();
                raised(format!("faces: expected indices of {n} vertices, found {index}"))
            })
        };
        let mut triangles = Vec::new();
        for row in faces.as_array().rows() {
            triangles.push([index(&row[0])?, index(&row[1])?, index(&row[2])?]);
        }
        let mesh = mesh::Mesh { vertices: vertices.collect(), triangles };
        process::run(py, || {
            mesh::check(&mesh).map_err(raised)?;
            Ok(Self::new(&mesh, up, normalize))
        })?
    }

    /// How many triangles there are.
    fn __len__(&self) -> usize {
        self.target.surface.triangles().len()
    }

    /// The vertices in the world's frame, metres, `[n, 3]`.
    #[getter]
    fn vertices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let vertices = self.target.surface.vertices();
        let numbers: Vec<f64> = vertices.iter().flat_map(|vertex| vertex.to_array()).collect();
        numbers.into_pyarray(py).reshape([vertices.len(), 3])
    }

    /// The triangles as indices of vertices, `[m, 3]`.
    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let triangles = self.target.surface.triangles();
        let indices = triangles.as_flattened().iter().copied().map(i64::from);
        indices.collect::<Vec<_>>().into_pyarray(py).reshape([triangles.len(), 3])
    }
}

impl Mesh {
    fn new(mesh: &mesh::Mesh, up: Up, normalize: Normalize) -> Self {
        let world = to_world(mesh, up, normalize);
        let (scale, centre) = (world.scale, world.centre.to_array());
        let target = Target::new(Surface::of_mesh(world.mesh), Builder::Sah);
        Self { target, scale, centre }
    }
}
