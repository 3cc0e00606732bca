//! The meshes that a run casts at.

use super::scenes;
use anyhow::{Result, bail};
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::{Mesh, load, tree};
use std::path::Path;

/// A mesh in the world, in metres.
pub struct Subject {
    /// What it is called in tables.
    pub name: String,
    /// The mesh, about as large as the unit sphere.
    pub mesh: Mesh,
}

/// Tori of each of these sizes.
pub fn tori(sizes: &[usize]) -> Vec<Subject> {
    let torus = |&n: &usize| Subject { name: format!("torus {n}"), mesh: scenes::torus(n) };
    sizes.iter().map(torus).collect()
}

/// At most `limit` of the meshes under `root`, spread evenly over its list,
/// each scaled to the unit sphere. A bad file is named and passed over.
///
/// # Errors
/// If there is no mesh that can be read.
pub fn real(root: &Path, limit: usize) -> Result<Vec<Subject>> {
    let entries = tree::discover(root, 0)?;
    let taken = limit.clamp(1, entries.len());
    let mut subjects = Vec::with_capacity(taken);
    for k in 0..taken {
        let entry = &entries[k * entries.len() / taken];
        match load(&entry.path) {
            Ok(loaded) => subjects.push(Subject {
                name: entry.name.clone(),
                mesh: to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere)
                    .mesh,
            }),
            Err(error) => eprintln!("passed over: {error}"),
        }
    }
    if subjects.is_empty() {
        bail!("{}: none of the meshes can be read", root.display());
    }
    Ok(subjects)
}
