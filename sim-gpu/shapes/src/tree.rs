use std::path::Path;

use rayon::prelude::*;

use super::class::ShapeClass;
use super::generate;
use super::write::write_off;
use formats::FormatError;

/// Writes shapes of all classes as `OUT/CLASS/{train,test}/CLASS_0001.off` and so on. As in
/// ModelNet, the numbers of the test shapes follow those of the training shapes; number `k` is
/// instance `k - 1` of `seed`. Existing files are replaced.
///
/// The bytes depend only on the arguments. All cores take part.
///
/// # Errors
/// The first file or folder, in the order of classes and numbers, that cannot be written. All other
/// files are still written.
pub fn write_tree(
    out: &Path,
    seed: u64,
    train_per_class: u32,
    test_per_class: u32,
) -> Result<(), FormatError> {
    let splits = [("train", 0, train_per_class), ("test", train_per_class, test_per_class)];
    let mut jobs = Vec::new();
    for class in ShapeClass::ALL {
        for (split, first, count) in splits {
            let folder = out.join(class.name()).join(split);
            for instance in first..first.saturating_add(count) {
                let name = format!("{class}_{:04}.off", u64::from(instance) + 1);
                jobs.push((class, instance, folder.join(name)));
            }
        }
    }
    let written: Vec<Result<(), FormatError>> = jobs
        .par_iter()
        .map(|(class, instance, path)| write_off(&generate(*class, seed, *instance), path))
        .collect();
    written.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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
        write_tree(parallel.path(), 4, 2, 1).unwrap();
        let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        one_thread.install(|| write_tree(serial.path(), 4, 2, 1)).unwrap();
        for split in ["vase/train", "vase/test", "chair/train", "airplane/test"] {
            assert_eq!(files(&parallel.path().join(split)), files(&serial.path().join(split)));
        }
        let names: Vec<_> =
            files(&parallel.path().join("vase/train")).into_iter().map(|f| f.0).collect();
        assert_eq!(names, ["vase_0001.off", "vase_0002.off"]);
        assert_eq!(files(&parallel.path().join("vase/test"))[0].0, "vase_0003.off");
    }
}
