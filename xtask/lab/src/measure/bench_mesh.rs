//! The meshes that a run casts at.

use super::scenes;
use anyhow::{Result, bail};
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::mesh::frame::{Normalize, to_world};
use sim_gpu::internals::mesh::{TriangleMesh, load, tree};
use sim_gpu::internals::target::{Surface, Target};
use std::path::Path;

/// A mesh in the world, in metres.
pub struct BenchMesh {
    /// Its name in tables.
    pub name: String,
    /// The mesh, about as large as the unit sphere.
    pub mesh: TriangleMesh,
}

/// Tori of each of these sizes.
pub fn tori(sizes: &[usize]) -> Vec<BenchMesh> {
    let torus = |&n: &usize| BenchMesh { name: format!("torus {n}"), mesh: scenes::torus(n) };
    sizes.iter().map(torus).collect()
}

/// At least one and at most `limit` of the mesh files under `root`, spread evenly over
/// their list.
pub fn some_of(root: &Path, limit: usize) -> Result<Vec<tree::MeshEntry>> {
    let entries = tree::discover(root, 0)?;
    let taken = limit.clamp(1, entries.len());
    Ok((0..taken).map(|k| entries[k * entries.len() / taken].clone()).collect())
}

/// The meshes of [`some_of`], each scaled to the unit sphere. A file that cannot be read
/// is named and skipped; one at least must be readable.
pub fn real(root: &Path, limit: usize) -> Result<Vec<BenchMesh>> {
    let mut bench_meshes = Vec::new();
    for entry in some_of(root, limit)? {
        match load(&entry.path) {
            Ok(loaded) => {
                let up = loaded.format.default_up();
                let mesh = to_world(&loaded.mesh, up, Normalize::UnitSphere).mesh;
                bench_meshes.push(BenchMesh { name: entry.name, mesh });
            }
            Err(error) => eprintln!("skipped: {error}"),
        }
    }
    if bench_meshes.is_empty() {
        bail!("{}: expected a mesh that can be read", root.display());
    }
    Ok(bench_meshes)
}

/// The target of casters for `mesh`.
pub fn target(mesh: TriangleMesh, builder: Builder) -> Target {
    Target::new(Surface::of_mesh(mesh), builder)
}
