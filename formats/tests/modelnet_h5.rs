//! ModelNet40's HDF5 layout, read back.
#![cfg(feature = "hdf5")]
#![allow(clippy::unwrap_used, reason = "a test may fail where it stands")]

use std::fs;

use formats::Split;
use formats::modelnet_h5::{CLOUDS_PER_FILE, ModelNetH5Writer};

fn write(folder: &std::path::Path, m: usize) {
    let classes = vec!["bowl".to_owned(), "chair".to_owned()];
    let mut writer = ModelNetH5Writer::create(folder, Split::Train, 2, classes);
    for i in 0..m {
        writer.push(&[[i as f32, 0.0, 1.0], [0.5, 0.25, i as f32]], i % 2, "a").unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn clouds_are_spread_over_files_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), CLOUDS_PER_FILE + 3);
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(
        read("train_files.txt"),
        "data/modelnet40_ply_hdf5_2048/ply_data_train0.h5\n\
         data/modelnet40_ply_hdf5_2048/ply_data_train1.h5\n"
    );
    assert_eq!(read("shape_names.txt"), "bowl\nchair\n");
    let file = hdf5_pure::File::open(folder.path().join("ply_data_train1.h5")).unwrap();
    assert_eq!(file.dataset("data").unwrap().shape().unwrap(), [3, 2, 3]);
    assert_eq!(file.dataset("label").unwrap().shape().unwrap(), [3, 1]);
    let data = file.dataset("data").unwrap().read_f32().unwrap();
    assert_eq!(data[6..12], [2049.0, 0.0, 1.0, 0.5, 0.25, 2049.0]);
    assert_eq!(file.dataset("label").unwrap().read_u8().unwrap(), [0, 1, 0]);
}

#[test]
fn the_same_clouds_give_the_same_bytes_and_none_are_fine() {
    let [first, second] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    for m in [0, 5] {
        write(first.path(), m);
        write(second.path(), m);
        let [first, second] =
            [&first, &second].map(|at| fs::read(at.path().join("ply_data_train0.h5")).unwrap());
        assert_eq!(first, second);
    }
}

#[test]
fn a_label_beyond_the_classes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = ModelNetH5Writer::create(folder.path(), Split::Test, 1, vec!["a".into()]);
    assert!(writer.push(&[[0.0; 3]], 1, "b").is_err());
    assert!(writer.push(&[[0.0; 3]; 2], 0, "b").is_err());
}
