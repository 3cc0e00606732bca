//! Writes a whole dataset of shapes in ModelNet's layout.

use std::fs;
use std::path::Path;

use rayon::prelude::*;

use super::class::ShapeClass;
use super::generate;
use super::write::write_off;
use formats::FormatError;

/// What [`write_tree`] has written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TreeSummary {
    /// Files.
    pub meshes: u64,
    /// Triangles in all of them.
    pub triangles: u64,
}

/// Writes `OUT/CLASS/{train,test}/CLASS_0001.off` and so on, the numbers going
/// on from train to test as ModelNet's do; number `k` is instance `k - 1` of
/// `seed`. Files that are there already are replaced.
///
/// The bytes depend on nothing but the arguments; all cores take part.
///
/// # Errors
/// The first file or folder, in the order of classes and numbers, that could
/// not be written. The others are written all the same.
pub fn write_tree(
    out: &Path,
    seed: u64,
    train_per_class: u32,
    test_per_class: u32,
) -> Result<TreeSummary, FormatError> {
    let splits = [("train", 0, train_per_class), ("test", train_per_class, test_per_class)];
    let mut jobs = Vec::new();
    for class in ShapeClass::ALL {
        for (split, first, count) in splits {
            let folder = out.join(class.name()).join(split);
            fs::create_dir_all(&folder).map_err(|source| FormatError::io(&folder, source))?;
            for instance in first..first.saturating_add(count) {
                let name = format!("{class}_{:04}.off", u64::from(instance) + 1);
                jobs.push((class, instance, folder.join(name)));
            }
        }
    }
    let written: Vec<Result<u64, FormatError>> = jobs
        .par_iter()
        .map(|(class, instance, path)| {
            let mesh = generate(*class, seed, *instance);
            write_off(&mesh, path).map(|()| mesh.triangles.len() as u64)
        })
        .collect();
    let mut summary = TreeSummary::default();
    for triangles in written {
        summary.triangles += triangles?;
        summary.meshes += 1;
    }
    Ok(summary)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
        let mut files: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap())
            .map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap()))
            .collect();
        files.sort();
        files
    }

    #[test]
    fn numbers_go_on_from_train_to_test_and_threads_change_nothing() {
        let [parallel, serial] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let summary = write_tree(parallel.path(), 4, 2, 1).unwrap();
        assert_eq!(summary.meshes, 30);
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        let again = one_thread.install(|| write_tree(serial.path(), 4, 2, 1)).unwrap();
        assert_eq!(summary, again);
        for split in ["vase/train", "vase/test", "chair/train", "airplane/test"] {
            assert_eq!(files(&parallel.path().join(split)), files(&serial.path().join(split)));
        }
        let names: Vec<_> =
            files(&parallel.path().join("vase/train")).into_iter().map(|f| f.0).collect();
        assert_eq!(names, ["vase_0001.off", "vase_0002.off"]);
        assert_eq!(files(&parallel.path().join("vase/test"))[0].0, "vase_0003.off");
    }
}
