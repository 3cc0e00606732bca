//! That an effect does not reach positions.

use super::datasets::scan_files;
use anyhow::{bail, ensure};
use edgepuck_dataset::manifest::Manifest;
use formats::scan_file::read_scan;
use std::path::Path;

/// Compares all positions of two datasets of the same meshes and views, bit by
/// bit; how many scans there are.
///
/// # Errors
/// Names the first scan that differs, or that one dataset lacks.
pub fn compare(
    (with, with_folder): (&Manifest, &Path),
    (without, without_folder): (&Manifest, &Path),
) -> anyhow::Result<usize> {
    let pairs = [scan_files(with, with_folder), scan_files(without, without_folder)];
    ensure!(pairs[0].len() == pairs[1].len(), "{} and {} scans", pairs[0].len(), pairs[1].len());
    for (p, q) in pairs[0].iter().zip(&pairs[1]) {
        let names = [p.strip_prefix(with_folder)?, q.strip_prefix(without_folder)?];
        let [first, second] = [read_scan(p)?, read_scan(q)?];
        let bits = |positions: &[[f32; 3]]| -> Vec<u32> {
            positions.as_flattened().iter().map(|x| x.to_bits()).collect()
        };
        if names[0] != names[1] || bits(&first.positions) != bits(&second.positions) {
            bail!("{} and {}: positions differ", p.display(), q.display());
        }
    }
    Ok(pairs[0].len())
}
