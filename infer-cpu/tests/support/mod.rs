//! What several tests of infer-cpu need.

use std::path::{Path, PathBuf};

use formats::weights::Tensor;

/// Folder `name` of the developers' data, which users don't have.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = root.join(name);
    if !folder.exists() {
        eprintln!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

/// The points of a tensor `[1, 3, n]`.
pub fn channels_first(tensor: &Tensor) -> Vec<[f32; 3]> {
    let n = tensor.shape[2];
    (0..n).map(|i| [0, 1, 2].map(|axis| tensor.values[axis * n + i])).collect()
}
