//! Embree, through Open3D in a subprocess.

use crate::measure::clock::Cost;
use crate::measure::ray_set::RaySet;
use crate::measure::subprocess::Subprocess;
use anyhow::{Context, Result};
use ndarray::{Array1, Array2};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sim_gpu::mesh::Mesh;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use xtask::venv;

/// A running `peers/embree.py`.
pub struct Embree {
    process: Subprocess,
    files: TempDir,
    /// Versions of the packages.
    pub versions: Value,
}

impl Embree {
    /// Starts the program with `python`.
    ///
    /// # Errors
    /// If it does not start, which includes packages that do not load here.
    pub fn start(python: &Path) -> Result<Self> {
        let mut command = Command::new(python);
        let process = Subprocess::start(command.arg(venv::programs().join("embree.py")))?;
        let mut peer = Self { process, files: tempfile::tempdir()?, versions: Value::Null };
        peer.versions = peer.answer()?;
        Ok(peer)
    }

    /// Builds a scene of `mesh`; what the build cost.
    ///
    /// # Errors
    /// If the program ends.
    pub fn load(&mut self, mesh: &Mesh) -> Result<Cost> {
        let vertices = mesh.vertices.iter().flat_map(|v| v.as_vec3().to_array()).collect();
        let triangles = mesh.triangles.iter().flatten().copied().collect();
        let files = [self.files.path().join("vertices.npy"), self.files.path().join("corners.npy")];
        write(&files[0], vertices, 3)?;
        write::<u32>(&files[1], triangles, 3)?;
        self.ask(&json!({ "mesh": files }))
    }

    /// Prepares to cast the rays of `ray_set`, `copies` times over, as `key`.
    ///
    /// # Errors
    /// If the program ends.
    pub fn aim(&mut self, key: &str, ray_set: &RaySet, copies: usize) -> Result<()> {
        let rays = ray_set
            .in_world()
            .flat_map(|(origin, direction)| [origin.as_vec3(), direction.as_vec3()])
            .flat_map(|v| v.to_array())
            .collect();
        let file = self.files.path().join("rays.npy");
        write(&file, rays, 6)?;
        self.ask::<Cost>(&json!({ "rays": file, "copies": copies, "as": key }))?;
        Ok(())
    }

    /// Casts the rays of `key` once; what it cost.
    ///
    /// # Errors
    /// If the program ends.
    pub fn cast(&mut self, key: &str) -> Result<Cost> {
        self.ask(&json!({ "cast": key }))
    }

    /// The ranges of one copy of the rays of `key`, metres; infinite where nothing is hit.
    ///
    /// # Errors
    /// If the program ends.
    pub fn ranges(&mut self, key: &str) -> Result<Vec<f32>> {
        let file = self.files.path().join("ranges.npy");
        self.ask::<Cost>(&json!({ "answers": file, "of": key }))?;
        let ranges: Array1<f32> = ndarray_npy::read_npy(&file)?;
        Ok(ranges.to_vec())
    }

    fn ask<T: DeserializeOwned>(&mut self, request: &Value) -> Result<T> {
        self.process.send(&request.to_string())?;
        self.answer()
    }

    fn answer<T: DeserializeOwned>(&mut self) -> Result<T> {
        let line = self.process.receive()?;
        serde_json::from_str(&line).with_context(|| format!("expected JSON, found {line}"))
    }
}

fn write<T: ndarray_npy::WritableElement>(
    file: &Path,
    numbers: Vec<T>,
    columns: usize,
) -> Result<()> {
    let rows = numbers.len() / columns;
    let array = Array2::from_shape_vec((rows, columns), numbers)?;
    ndarray_npy::write_npy(file, &array).with_context(|| format!("writing {}", file.display()))
}
