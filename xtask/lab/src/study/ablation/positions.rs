//! Checks that an effect does not reach positions.

use super::datasets::Made;
use anyhow::{bail, ensure};
use formats::scan_file::read_scan;
use std::path::Path;

/// Compares all positions of two datasets of the same meshes and views, bit by
/// bit; how many scans there are.
pub fn compare(with: &Made, without: &Made) -> anyhow::Result<usize> {
    let (n, other) = (with.scans.len(), without.scans.len());
    ensure!(n == other, "expected as many scans in both, found {n} and {other}");
    let bits = |path: &Path| -> anyhow::Result<Vec<u32>> {
        Ok(read_scan(path)?.positions.as_flattened().iter().map(|x| x.to_bits()).collect())
    };
    for (p, q) in with.scans.iter().zip(&without.scans) {
        let names = [p.strip_prefix(&with.folder)?, q.strip_prefix(&without.folder)?];
        if names[0] != names[1] || bits(p)? != bits(q)? {
            bail!("{} and {}: positions differ", p.display(), q.display());
        }
    }
    Ok(n)
}
