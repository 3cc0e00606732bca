//! Embree, through Open3D and through embreex in a subprocess.

use crate::measure::clock::Cost;
use crate::measure::ray_set::RaySet;
use anyhow::{Context, Result, bail};
use edgepuck_mesh::TriangleMesh;
use glam::DVec3;
use ndarray::{Array1, Array2};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use tempfile::TempDir;
use xtask::venv;

/// Embree with one thread, called directly, and with all threads, through Open3D.
pub const RIVALS: [&str; 2] = ["embreex", "open3d"];

/// A running `peers/embree.py`, which answers each line of JSON with another, and ends when its input
/// is closed. Every method fails if the program ends.
pub struct Embree {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    files: TempDir,
    pub versions: Value,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Message<T> {
    Failed { error: String },
    Answered(T),
}

impl Embree {
    /// Starts the program with `python`, which fails where its packages do not load.
    pub fn start(python: &Path) -> Result<Self> {
        let mut command = Command::new(python);
        command.arg(venv::programs().join("embree.py"));
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = piped.spawn().with_context(|| format!("starting {}", python.display()))?;
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().context("it has no output")?);
        let (files, versions) = (tempfile::tempdir()?, Value::Null);
        let mut embree = Self { child, input, output, files, versions };
        embree.versions = embree.answer()?;
        Ok(embree)
    }

    fn ask<T: DeserializeOwned>(&mut self, request: Value) -> Result<T> {
        let input = self.input.as_mut().context("it has ended")?;
        writeln!(input, "{request}").context("it has ended")?;
        self.answer()
    }

    fn answer<T: DeserializeOwned>(&mut self) -> Result<T> {
        let mut line = String::new();
        if self.output.read_line(&mut line)? == 0 {
            bail!("it has ended");
        }
        match serde_json::from_str(&line) {
            Ok(Message::Answered(answer)) => Ok(answer),
            Ok(Message::Failed { error }) => bail!("{error}"),
            Err(_) => bail!("expected JSON, found {line}"),
        }
    }

    /// Builds a scene of `mesh`; returns the cost.
    pub fn load(&mut self, mesh: &TriangleMesh) -> Result<Cost> {
        let vertices = mesh.vertices.iter().flat_map(in_f32).collect();
        let triangles: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
        let files = ["vertices.npy", "corners.npy"].map(|name| self.files.path().join(name));
        write(&files[0], vertices, 3)?;
        write(&files[1], triangles, 3)?;
        self.ask(json!({ "mesh": files }))
    }

    /// Prepares to cast the rays of `ray_set`, `copies` times over.
    pub fn aim(&mut self, ray_set: &RaySet, copies: usize) -> Result<()> {
        let rays = ray_set.in_world().flat_map(|(origin, direction)| [origin, direction]);
        let file = self.files.path().join("rays.npy");
        write(&file, rays.flat_map(|v| in_f32(&v)).collect(), 6)?;
        self.ask::<Cost>(json!({ "rays": file, "copies": copies }))?;
        Ok(())
    }

    /// Casts all rays once by `rival`, one of [`RIVALS`]; returns the cost.
    pub fn cast(&mut self, rival: &str) -> Result<Cost> {
        self.ask(json!({ "cast": rival }))
    }

    /// The ranges of one copy of the rays by `rival`, metres; infinite where nothing is hit.
    pub fn ranges(&mut self, rival: &str) -> Result<Vec<f32>> {
        let file = self.files.path().join("ranges.npy");
        self.ask::<Cost>(json!({ "answers": file, "of": rival }))?;
        let ranges: Array1<f32> = ndarray_npy::read_npy(&file)?;
        Ok(ranges.to_vec())
    }
}

impl Drop for Embree {
    fn drop(&mut self) {
        self.input = None;
        // Closing its input ends the process; its exit status does not matter.
        let _ = self.child.wait();
    }
}

fn in_f32(v: &DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
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
