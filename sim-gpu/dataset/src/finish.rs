//! From scans to a finished dataset: packed files, failures, manifest.

use super::clouds::Scans;
use super::error::DatasetError;
use super::export_layouts::write_layouts;
use super::journal::{Journal, Terms};
use super::layout;
use super::manifest::{self, Manifest, TOOL};
use super::pack::pack;
use super::record::{MeshFailure, MeshRecord};
use formats::atomic;
use std::io::{self, Write};
use std::path::Path;

/// Finishes the dataset in `out`, whose scans are all there: packs them, lists
/// the failures, writes the manifest and then removes the journal.
///
/// Killed at any moment and called again with the same arguments, it ends with
/// the same bytes. While there is a manifest, everything it names is there.
/// Nothing else may write to `out`.
///
/// # Errors
/// A scan that cannot be read or is not as recorded; a file that cannot be
/// written or removed. The journal is there still.
pub fn finish(
    out: &Path,
    terms: &Terms,
    records: Vec<MeshRecord>,
    failures: Vec<MeshFailure>,
) -> Result<Manifest, DatasetError> {
    complete(
        out,
        Manifest {
            tool: TOOL.into(),
            version: terms.version.clone(),
            adapters: vec![terms.adapter.clone()],
            shard: terms.shard,
            config: terms.config.clone(),
            poses: Vec::new(),
            packed: Vec::new(),
            layout_files: Vec::new(),
            failures,
            meshes: records,
        },
    )
}

/// As [`finish`]; what the manifest says of poses, packed files and layouts is
/// replaced.
pub(super) fn complete(out: &Path, mut manifest: Manifest) -> Result<Manifest, DatasetError> {
    manifest.meshes.sort_by(|p, q| p.entry.cmp(&q.entry));
    manifest.failures.sort_by(|p, q| (&p.entry, &p.source).cmp(&(&q.entry, &q.source)));
    layout::remove(&layout::manifest(out))?;
    layout::remove(&layout::packed_root(out))?;
    layout::remove(&layout::export_root(out))?;
    atomic::sweep_leftovers(out)?;

    write_failures(out, &manifest.failures)?;
    let classes = manifest.classes();
    let (config, records) = (&manifest.config, &manifest.meshes[..]);
    let scans = Scans { out, config, records, classes: &classes };
    let packed = pack(&scans)?;
    let layout_files = write_layouts(&scans)?;
    manifest.poses = manifest::poses(config, records);
    (manifest.packed, manifest.layout_files) = (packed, layout_files);
    let scans = manifest.meshes.iter_mut().flat_map(|mesh| &mut mesh.scans);
    scans.flat_map(|scan| &mut scan.variants).for_each(|written| written.cloud = None);
    manifest.write(&layout::manifest(out))?;
    Journal::of(out).remove()?;
    Ok(manifest)
}

/// One failure a line; no file if there is none.
fn write_failures(out: &Path, failures: &[MeshFailure]) -> Result<(), DatasetError> {
    let path = layout::failures(out);
    if failures.is_empty() {
        return layout::remove(&path);
    }
    Ok(atomic::write(&path, |file| file.write_all(&failure_lines(failures)?))?)
}

/// The bytes of `failures.jsonl`.
pub(super) fn failure_lines(failures: &[MeshFailure]) -> io::Result<Vec<u8>> {
    let mut lines = Vec::new();
    for failure in failures {
        serde_json::to_writer(&mut lines, failure)?;
        lines.push(b'\n');
    }
    Ok(lines)
}
