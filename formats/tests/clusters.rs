//! Sets of clusters survive their files.

use std::fs;

use formats::clusters::{ClusterWriter, Remarks};
use formats::labelled::read_labelled;

const REMARKS: Remarks<'_> = Remarks {
    name: "car_v3",
    id: "000012#7",
    sensor: "vlp32c",
    range_m: 12.5,
    truth_share: 0.9,
    height_m: f32::NAN,
};

fn classes() -> Vec<String> {
    ["car", "tree"].map(str::to_owned).to_vec()
}

#[test]
fn clusters_come_back_from_their_file_with_their_remarks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("street/train.npz");
    let mut writer = ClusterWriter::create(&path, classes()).unwrap();
    writer.push(&[[1.0, 2.0, 3.0]], 1, &REMARKS).unwrap();
    writer.push(&[[4.0; 3], [5.0; 3]], 0, &Remarks { range_m: 3.0, ..REMARKS }).unwrap();
    assert_eq!(writer.len(), 2);
    writer.finish().unwrap();
    let set = read_labelled(&path).unwrap();
    assert_eq!(set.cloud(0), [[1.0, 2.0, 3.0]]);
    assert_eq!(set.cloud(1), [[4.0; 3], [5.0; 3]]);
    assert_eq!((set.labels, set.classes), (vec![1, 0], Some(classes())));
    assert_eq!(set.names.unwrap(), ["car_v3", "car_v3"]);
    assert_eq!(set.ids.unwrap(), ["000012#7", "000012#7"]);
    assert_eq!(set.sensor.unwrap(), ["vlp32c", "vlp32c"]);
    assert_eq!(set.range_m.unwrap(), [12.5, 3.0]);
}

#[test]
fn a_set_may_be_empty_and_an_unfinished_one_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let mut writer = ClusterWriter::create(&path, classes()).unwrap();
    writer.push(&[[0.0; 3]], 0, &REMARKS).unwrap();
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    ClusterWriter::create(&path, classes()).unwrap().finish().unwrap();
    let set = read_labelled(&path).unwrap();
    assert_eq!((set.len(), set.offsets.as_slice()), (0, &[0][..]));
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = ClusterWriter::create(&folder.path().join("set.npz"), classes()).unwrap();
    let none = writer.push(&[], 0, &REMARKS).unwrap_err().to_string();
    assert_eq!(none, "instance `car_v3`: expected points, found none");
    let label = writer.push(&[[0.0; 3]], 2, &REMARKS).unwrap_err().to_string();
    assert_eq!(label, "instance `car_v3`: expected a label below 2, found 2");
    assert!(writer.is_empty());
}

#[test]
fn no_damaged_byte_makes_the_reader_panic() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let mut writer = ClusterWriter::create(&path, classes()).unwrap();
    writer.push(&[[1.0, 2.0, 3.0]], 1, &REMARKS).unwrap();
    writer.finish().unwrap();
    let whole = fs::read(&path).unwrap();
    for at in (0..whole.len()).step_by(7) {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x15;
        fs::write(&path, &bytes).unwrap();
        let _ = read_labelled(&path);
        fs::write(&path, &whole[..at]).unwrap();
        assert!(read_labelled(&path).is_err(), "cut at {at}");
    }
}
