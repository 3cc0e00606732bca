//! The meshes of a study.

use anyhow::Context;
use edgepuck_shapes as shapes;
use formats::split::Split;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The folder that was asked for, or else `folder`, to which built-in shapes are
/// written: so many of each class to train on and to test with.
pub fn folder(
    asked: Option<&Path>,
    folder: &Path,
    [train, test]: [u32; 2],
) -> anyhow::Result<PathBuf> {
    if let Some(asked) = asked {
        return Ok(asked.to_owned());
    }
    shapes::write_tree(folder, 0, train, test).context("cannot write the shapes")?;
    Ok(folder.to_owned())
}

/// Keeps the first meshes of each class, at most so many to train on and to test
/// with.
pub fn keep_at_most([train, test]: [u32; 2], meshes: &mut Vec<MeshEntry>) {
    let mut seen = BTreeMap::new();
    meshes.retain(|mesh| {
        let most = if mesh.split == Split::Train { train } else { test };
        let n = seen.entry((mesh.class.clone(), mesh.split)).or_insert(0);
        *n += 1;
        *n <= most
    });
}
