use std::ffi::OsString;
use std::fs;
use std::path::Path;

use formats::Split;
use formats::hash::Hashing;
use formats::modelnet_h5::{self, CLOUDS_PER_FILE, ModelNetH5Writer};
use formats::modelnet_h5_list;

fn write(folder: &Path, m: usize) {
    let classes = vec!["bowl".to_owned(), "chair".to_owned()];
    let mut writer = ModelNetH5Writer::create(folder, Split::Train, 2, classes, Hashing::None);
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
    let mut writer =
        ModelNetH5Writer::create(folder.path(), Split::Test, 1, vec!["a".into()], Hashing::None);
    assert!(writer.push(&[[0.0; 3]], 1, "b").is_err());
    assert!(writer.push(&[[0.0; 3]; 2], 0, "b").is_err());
}

#[test]
fn what_is_written_is_read_as_a_labelled_set() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), CLOUDS_PER_FILE + 3);
    assert!(modelnet_h5::is_one(folder.path()));
    let named = |path: &Path| -> [OsString; 2] {
        ["train".into(), format!("--data={}", path.display()).into()]
    };
    assert!(modelnet_h5_list::is_among(&named(folder.path())));
    assert!(!modelnet_h5_list::is_among(&named(&folder.path().join("elsewhere"))));
    let set = modelnet_h5::read(folder.path(), Split::Train).unwrap();
    assert_eq!((set.len(), set.smallest_cloud()), (CLOUDS_PER_FILE + 3, 2));
    assert_eq!(set.cloud(2049), [[2049.0, 0.0, 1.0], [0.5, 0.25, 2049.0]]);
    assert_eq!(set.labels[2047..], [1, 0, 1, 0]);
    assert_eq!(set.classes.unwrap(), ["bowl", "chair"]);
}

/// As the original: gzip, chunks, labels [m, 1].
#[test]
fn compressed_files_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let points: Vec<f32> = (0..5 * 7 * 3).map(|i| i as f32 / 8.0).collect();
    let mut file = hdf5_pure::FileBuilder::new();
    let data = file.create_dataset("data").with_f32_data(&points).with_shape(&[5, 7, 3]);
    data.with_chunks(&[2, 7, 3]).with_deflate(4);
    file.create_dataset("label").with_u8_data(&[3, 1, 4, 1, 5]).with_shape(&[5, 1]);
    fs::write(folder.path().join("ply_data_test0.h5"), file.finish().unwrap()).unwrap();
    fs::write(folder.path().join("test_files.txt"), "data/elsewhere/ply_data_test0.h5\n").unwrap();
    let set = modelnet_h5::read(folder.path(), Split::Test).unwrap();
    assert_eq!((set.points, set.labels), (points, vec![3, 1, 4, 1, 5]));
    assert_eq!(set.classes, None);
}

#[test]
fn a_bad_file_is_named_with_its_cause() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let failed = |expected: [&str; 2]| {
        let error = modelnet_h5::read(at, Split::Train).unwrap_err().to_string();
        assert!(expected.iter().all(|part| error.contains(part)), "{error}");
    };
    failed(["train_files.txt", "No such file"]);
    fs::write(at.join("train_files.txt"), "x/a.h5\n").unwrap();
    failed(["a.h5", "No such file"]);
    fs::write(at.join("a.h5"), "no HDF5").unwrap();
    failed(["a.h5", "HDF5"]);
    let with = |shape: &[u64], labels: &[u8]| {
        let n = shape.iter().product::<u64>() as usize;
        let mut file = hdf5_pure::FileBuilder::new();
        file.create_dataset("data").with_f32_data(&vec![0.0; n]).with_shape(shape);
        file.create_dataset("label").with_u8_data(labels).with_shape(&[labels.len() as u64, 1]);
        fs::write(at.join("a.h5"), file.finish().unwrap()).unwrap();
    };
    with(&[2, 4], &[0, 0]);
    failed(["dataset `data`", "expected shape [m, n, 3], found [2, 4]"]);
    with(&[2, 4, 3], &[0]);
    failed(["dataset `label`", "expected 2 labels, one for each cloud, found shape [1, 1]"]);
    with(&[2, 4, 3], &[0, 9]);
    fs::write(at.join("shape_names.txt"), "bowl\nchair\n\n").unwrap();
    failed(["a.h5", "cloud 1: expected a label below 2, found 9"]);
}
