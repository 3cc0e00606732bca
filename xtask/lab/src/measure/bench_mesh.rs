//! The meshes that a run casts at.

use anyhow::{Result, bail};
use edgepuck_mesh::frame::{Normalize, to_world};
use edgepuck_mesh::{TriangleMesh, load, tree};
use glam::DVec3;
use harness::meshes::{cuboid, together};
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::target::{Surface, Target};
use std::path::Path;

/// A mesh in the world, in metres.
pub struct BenchMesh {
    pub name: String,
    pub mesh: TriangleMesh,
}

pub fn tori(sizes: &[usize]) -> Vec<BenchMesh> {
    let torus = |&n: &usize| BenchMesh { name: format!("torus {n}"), mesh: torus(n) };
    sizes.iter().map(torus).collect()
}

/// A bumpy torus of about `triangles` triangles.
pub fn torus(triangles: usize) -> TriangleMesh {
    harness::meshes::torus(((triangles as f64 / 2.0).sqrt().round() as u32).max(3))
}

/// `mesh` inside a closed cube of 16 m, so that every ray hits.
pub fn in_a_room(mesh: TriangleMesh) -> TriangleMesh {
    together(&[mesh, cuboid(DVec3::splat(-8.0), DVec3::splat(8.0))])
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

pub fn target(mesh: TriangleMesh) -> Target {
    Target::new(Surface::of_mesh(mesh), Builder::Sah)
}
