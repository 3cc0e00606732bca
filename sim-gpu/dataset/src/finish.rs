//! From scans to a finished dataset: packed files, failures and the manifest.

use crate::error::DatasetError;
use crate::folder::DatasetFolder;
use crate::manifest::{self, Manifest, TOOL};
use crate::pack::Scans;
use crate::plan::Terms;
use crate::record::{MeshFailure, MeshRecord};

/// Finishes the dataset in `folder`, whose scans are all there: packs them, lists the failures,
/// writes the manifest and then removes the journal.
///
/// If it is killed at any moment and called again with the same arguments, it ends with the same
/// bytes. All files that a manifest names exist as long as the manifest does. Nothing else may
/// write to `folder`.
pub fn finish(
    folder: DatasetFolder,
    terms: &Terms,
    records: Vec<MeshRecord>,
    failures: Vec<MeshFailure>,
) -> Result<Manifest, DatasetError> {
    complete(
        folder,
        Manifest {
            tool: TOOL.into(),
            version: terms.version.clone(),
            adapters: vec![terms.adapter.clone()],
            shard: terms.shard,
            config: terms.config.clone(),
            poses: Vec::new(),
            packed: Vec::new(),
            layout_files: [],
            failures,
            meshes: records,
        },
    )
}

/// As [`finish`]; replaces the manifest's poses and packed files.
pub(crate) fn complete(
    folder: DatasetFolder,
    mut manifest: Manifest,
) -> Result<Manifest, DatasetError> {
    manifest.meshes.sort_by(|p, q| p.entry.cmp(&q.entry));
    manifest.failures.sort_by(|p, q| (&p.entry, &p.source).cmp(&(&q.entry, &q.source)));
    folder.reopen(&manifest.failures)?;
    let classes = manifest.classes();
    let (config, records) = (&manifest.config, &manifest.meshes[..]);
    let packed = Scans { folder, config, records, classes: &classes }.pack()?;
    manifest.poses = manifest::poses(config, records);
    manifest.packed = packed;
    let scans = manifest.meshes.iter_mut().flat_map(|mesh| &mut mesh.scans);
    scans.flat_map(|scan| &mut scan.variants).for_each(|written| written.cloud = None);
    folder.close(&manifest)?;
    Ok(manifest)
}
