//! From scans to a finished dataset: packed files, layouts, failures and the manifest.

use crate::clouds::{Part, Scans};
use crate::error::DatasetError;
use crate::export_layouts::write_layouts;
use crate::journal::{Journal, Terms};
use crate::layout;
use crate::manifest::{self, Manifest, PackedRecord, TOOL};
use crate::record::{MeshFailure, MeshRecord};
use formats::packed::PackedWriter;
use formats::{Split, atomic};
use rayon::prelude::*;
use std::path::Path;

/// Finishes the dataset in `out`, whose scans are all there: packs them, lists the failures,
/// writes the manifest and then removes the journal.
///
/// If it is killed at any moment and called again with the same arguments, it ends with the same
/// bytes. All files that a manifest names exist as long as the manifest does. Nothing else may
/// write to `out`.
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

/// As [`finish`]; replaces the manifest's poses, packed files and layouts.
pub(crate) fn complete(out: &Path, mut manifest: Manifest) -> Result<Manifest, DatasetError> {
    manifest.meshes.sort_by(|p, q| p.entry.cmp(&q.entry));
    manifest.failures.sort_by(|p, q| (&p.entry, &p.source).cmp(&(&q.entry, &q.source)));
    layout::remove(&layout::manifest(out))?;
    layout::remove(&layout::packed_root(out))?;
    layout::remove(&layout::export_root(out))?;
    atomic::sweep_leftovers(out)?;

    match &manifest.failures[..] {
        [] => layout::remove(&layout::failures(out))?,
        failures => atomic::write_bytes(&layout::failures(out), failure_lines(failures))?,
    }
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
    Journal::at(out).remove()?;
    Ok(manifest)
}

/// The bytes of `failures.jsonl`, which has a line for each failure.
pub(crate) fn failure_lines(failures: &[MeshFailure]) -> String {
    let line = |failure| {
        let json = serde_json::to_string(failure);
        json.expect("invariant: a `MeshFailure` holds text and numbers") + "\n"
    };
    failures.iter().map(line).collect()
}

/// Writes the packed files: one for each set, variant and split, even if it holds no cloud.
fn pack(scans: &Scans) -> Result<Vec<PackedRecord>, DatasetError> {
    let mut parts = Vec::new();
    for set in &scans.config.sets {
        for &variant in &scans.config.variants {
            parts.extend(Split::ALL.map(|split| Part { set, variant, split }));
        }
    }
    parts.par_iter().map(|part| pack_part(scans, part)).collect()
}

fn pack_part<'a>(scans: &Scans<'a>, part: &Part<'a>) -> Result<PackedRecord, DatasetError> {
    let place = |out: &Path| layout::packed(out, part.set, part.variant, part.split);
    let n_points = scans.config.packed_points as usize;
    let mut writer = PackedWriter::create(&place(scans.out), n_points, scans.classes.to_vec())?;
    let left_out = scans.for_each_cloud(part, |packed| {
        Ok(writer.push(&packed.cloud.points, packed.label, &packed.name, packed.n_raw)?)
    })?;
    let clouds = writer.n_clouds() as u64;
    let file = layout::slashed(&place(Path::new("")));
    let hash = writer.finish(scans.config.hash)?;
    Ok(PackedRecord { file, hash, clouds, left_out })
}
