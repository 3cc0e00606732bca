//! The meshes that a run casts at.

use super::scenes;
use anyhow::{Result, bail};
use sim_gpu::bvh::Builder;
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::{Mesh, load, tree, validate};
use sim_gpu::target::{Surface, Target};
use std::path::Path;

/// A mesh in the world, in metres.
pub struct BenchMesh {
    /// Its name in tables.
    pub name: String,
    /// The mesh, about as large as the unit sphere.
    pub mesh: Mesh,
}

/// Tori of each of these sizes.
pub fn tori(sizes: &[usize]) -> Vec<BenchMesh> {
    let torus = |&n: &usize| BenchMesh { name: format!("torus {n}"), mesh: scenes::torus(n) };
    sizes.iter().map(torus).collect()
}

/// At most `limit` of the meshes under `root`, spread evenly over its list,
/// each scaled to the unit sphere. A file that cannot be read is named and skipped.
///
/// # Errors
/// If there is no mesh that can be read.
pub fn real(root: &Path, limit: usize) -> Result<Vec<BenchMesh>> {
    let entries = tree::discover(root, 0)?;
    let taken = limit.clamp(1, entries.len());
    let mut bench_meshes = Vec::with_capacity(taken);
    for k in 0..taken {
        let entry = &entries[k * entries.len() / taken];
        match load(&entry.path) {
            Ok(loaded) => bench_meshes.push(BenchMesh {
                name: entry.name.clone(),
                mesh: to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere)
                    .mesh,
            }),
            Err(error) => eprintln!("skipped: {error}"),
        }
    }
    if bench_meshes.is_empty() {
        bail!("{}: expected a mesh that can be read", root.display());
    }
    Ok(bench_meshes)
}

/// The target of casters for `mesh`.
pub fn target(mesh: Mesh, builder: Builder) -> Target {
    let kept = validate::triangle_stats(&mesh).kept;
    Target::new(Surface::new(mesh, kept), builder)
}
