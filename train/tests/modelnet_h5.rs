//! ModelNet40's HDF5 files as data to learn from.
#![cfg(feature = "hdf5")]

use formats::hash::Hashing;
use formats::modelnet_h5::ModelNetH5Writer;
use formats::split::Split;
use train::clouds::Clouds;

#[test]
fn a_folder_of_hdf5_files_is_read_and_normalised() {
    let folder = tempfile::tempdir().unwrap();
    let classes = vec!["bowl".to_owned(), "cup".to_owned()];
    let mut writer =
        ModelNetH5Writer::create(folder.path(), Split::Test, 2, classes.clone(), Hashing::None);
    for i in 0..3u8 {
        let x = f32::from(i) + 1.0;
        writer.push(&[[x, 0.0, 0.0], [x + 4.0, 0.0, 0.0]], usize::from(i % 2), "a").unwrap();
    }
    writer.finish().unwrap();
    let clouds = Clouds::read(folder.path(), Split::Test, 10).unwrap();
    assert_eq!((clouds.classes, clouds.set.labels.clone()), (classes, vec![0, 1, 0]));
    for i in 0..3 {
        assert_eq!(clouds.set.cloud(i), [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
    }
}
