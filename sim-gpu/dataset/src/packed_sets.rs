//! Writes packed sets of many meshes, whose clouds are drawn on all cores.

use crate::error::DatasetError;
use crate::record::MeshFailure;
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use rayon::prelude::*;
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Meshes whose clouds wait in memory until they are written.
const MESHES_AT_ONCE: usize = 64;

/// A cloud of one of the sets.
pub(crate) struct Drawn {
    pub set: usize,
    /// `CLASS/NAME` or `CLASS/NAME_vK`.
    pub name: String,
    pub points: Vec<[f32; 3]>,
    /// Points before they were resampled.
    pub n_raw: u32,
}

/// The classes of `meshes`, sorted.
pub(crate) fn classes(meshes: &[MeshEntry]) -> Vec<String> {
    let classes: BTreeSet<&String> = meshes.iter().map(|mesh| &mesh.class).collect();
    classes.into_iter().cloned().collect()
}

/// Writes the sets at `paths`, of clouds of `n_points` points that `draw` makes of each of
/// `meshes`. Returns the number of clouds of each set and the meshes that `draw` could not use.
pub(crate) fn write_packed_sets(
    paths: &[PathBuf],
    n_points: usize,
    classes: &[String],
    meshes: &[&MeshEntry],
    draw: impl Fn(&MeshEntry) -> Result<Vec<Drawn>, DatasetError> + Sync,
) -> Result<(Vec<usize>, Vec<MeshFailure>), DatasetError> {
    let create = |path: &PathBuf| PackedWriter::create(path, n_points, classes.to_vec());
    let mut writers = paths.iter().map(create).collect::<Result<Vec<_>, _>>()?;
    let mut failures = Vec::new();
    for some in meshes.chunks(MESHES_AT_ONCE) {
        let drawn: Vec<_> = some.par_iter().map(|mesh| draw(mesh)).collect();
        for (mesh, drawn) in some.iter().zip(drawn) {
            let label = classes.partition_point(|class| *class < mesh.class);
            match drawn {
                Err(DatasetError::Mesh(failure)) => failures.push(failure),
                Err(other) => return Err(other),
                Ok(clouds) => {
                    for Drawn { set, name, points, n_raw } in clouds {
                        writers[set].push(&points, label, &name, n_raw)?;
                    }
                }
            }
        }
    }
    let counts = writers.iter().map(PackedWriter::n_clouds).collect();
    for writer in writers {
        writer.finish(Hashing::None)?;
    }
    Ok((counts, failures))
}
