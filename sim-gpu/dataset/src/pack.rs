//! Packed files: all clouds of one set, variant and split in one NPZ.

use super::clouds::{Part, Scans};
use super::error::DatasetError;
use super::layout;
use super::manifest::PackedRecord;
use formats::Split;
use formats::packed::PackedWriter;
use rayon::prelude::*;
use std::path::Path;

/// Writes the packed files: by set, variant and split, each of which has one
/// even if no cloud is in it.
///
/// # Errors
/// A scan that cannot be read or is not as recorded; a file that cannot be
/// written.
pub(super) fn pack(scans: &Scans) -> Result<Vec<PackedRecord>, DatasetError> {
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
    let path = place(scans.out);
    let n_points = scans.config.packed_points as usize;
    let mut writer = PackedWriter::create(&path, n_points, scans.classes.to_vec())?;
    let left_out = scans.for_each_cloud(part, |packed| {
        Ok(writer.push(&packed.cloud.points, packed.label, &packed.name, packed.n_raw)?)
    })?;
    let clouds = writer.len() as u64;
    let file = layout::slashed(&place(Path::new("")));
    let hash = writer.finish(scans.config.hash)?;
    Ok(PackedRecord { file, hash, clouds, left_out })
}
