use std::fs;
use std::path::Path;

use formats::hash::{FileHash, Hashing};
use formats::labelled::{LabelledSet, read_labelled};
use formats::packed::{ClusterWriter, PackedWriter, Remarks};

const REMARKS: Remarks<'_> = Remarks {
    name: "car_v3",
    id: "000012#7",
    sensor: "vlp32c",
    range_m: 12.5,
    truth_share: 0.9,
    height_m: f32::NAN,
};

fn classes() -> Vec<String> {
    ["bowl", "chaise longue", "étagère"].map(str::to_owned).to_vec()
}

fn write(path: &Path, m: usize, n_points: usize) -> Option<FileHash> {
    let mut writer = PackedWriter::create(path, n_points, classes()).unwrap();
    for i in 0..m {
        let cloud: Vec<_> = (0..n_points).map(|j| [i as f32, j as f32, 0.5]).collect();
        writer.push(&cloud, i % 3, &format!("mesh_{i}_v0"), 10 + i as u32).unwrap();
    }
    writer.finish(Hashing::Sha256).unwrap()
}

#[test]
fn a_set_comes_back_from_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("packed/rotational-clean-train.npz");
    write(&path, 4, 2);
    let set = read_labelled(&path).unwrap();
    assert_eq!(set.len(), 4);
    assert_eq!(set.cloud(3), [[3.0, 0.0, 0.5], [3.0, 1.0, 0.5]]);
    assert_eq!(set.labels, [0, 1, 2, 0]);
    assert_eq!(
        set.names.as_ref().unwrap()[..],
        ["mesh_0_v0", "mesh_1_v0", "mesh_2_v0", "mesh_3_v0"]
    );
    assert_eq!(set.n_raw.as_ref().unwrap()[..], [10, 11, 12, 13]);
    assert_eq!(set.classes, Some(classes()));
    let some = set.select(&[3, 1]);
    assert_eq!(some.cloud(0), set.cloud(3));
    assert_eq!((some.labels, some.n_raw), (vec![0, 1], Some(vec![13, 11])));
    assert_eq!(some.names.unwrap(), ["mesh_3_v0", "mesh_1_v0"]);
}

#[test]
fn a_set_may_be_empty() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.npz");
    write(&path, 0, 1024);
    let set = read_labelled(&path).unwrap();
    let none = LabelledSet {
        names: Some(vec![]),
        n_raw: Some(vec![]),
        classes: Some(classes()),
        ..LabelledSet::default()
    };
    assert_eq!(set, none);
}

/// 2000 clouds of 2048 points are 49 MB; 32 MiB wait in memory.
#[test]
fn a_set_beyond_memory_comes_back_with_the_hash_it_was_written_with() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.npz");
    let hash = write(&path, 2000, 2048);
    assert_eq!(hash, Hashing::Sha256.of_file(&path).unwrap());
    let set = read_labelled(&path).unwrap();
    assert_eq!((set.len(), set.cloud(1999)[2047]), (2000, [1999.0, 2047.0, 0.5]));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
}

#[test]
fn an_unfinished_set_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let mut writer = PackedWriter::create(&path, 1, classes()).unwrap();
    writer.push(&[[0.0; 3]], 0, "a", 1).unwrap();
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn clouds_that_do_not_fit_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let mut writer = PackedWriter::create(&path, 2, classes()).unwrap();
    let size = writer.push(&[[0.0; 3]], 0, "a_v1", 1).unwrap_err().to_string();
    assert_eq!(size, "instance `a_v1`: expected 2 points, found 1");
    let label = writer.push(&[[0.0; 3]; 2], 3, "a_v1", 1).unwrap_err().to_string();
    assert_eq!(label, "instance `a_v1`: expected a label below 3, found 3");
    writer.finish(Hashing::None).unwrap();
    assert_eq!(read_labelled(&path).unwrap().len(), 0);
}

#[test]
fn clusters_come_back_from_their_file_with_their_remarks() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("street/train.npz");
    let mut writer = ClusterWriter::create(&path, classes()).unwrap();
    writer.push(&[[1.0, 2.0, 3.0]], 1, &REMARKS).unwrap();
    writer.push(&[[4.0; 3], [5.0; 3]], 0, &Remarks { range_m: 3.0, ..REMARKS }).unwrap();
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
fn a_set_of_clusters_may_be_empty_and_an_unfinished_one_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("set.npz");
    let mut writer = ClusterWriter::create(&path, classes()).unwrap();
    let none = writer.push(&[], 0, &REMARKS).unwrap_err().to_string();
    assert_eq!(none, "instance `car_v3`: expected points, found none");
    writer.push(&[[0.0; 3]], 0, &REMARKS).unwrap();
    drop(writer);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    ClusterWriter::create(&path, classes()).unwrap().finish().unwrap();
    let set = read_labelled(&path).unwrap();
    assert_eq!((set.len(), set.offsets.as_slice()), (0, &[0][..]));
}

#[test]
fn no_damaged_byte_makes_the_reader_panic() {
    let folder = tempfile::tempdir().unwrap();
    let [packed, clusters] = ["packed.npz", "clusters.npz"].map(|name| folder.path().join(name));
    write(&packed, 2, 2);
    let mut writer = ClusterWriter::create(&clusters, classes()).unwrap();
    writer.push(&[[1.0, 2.0, 3.0]], 1, &REMARKS).unwrap();
    writer.finish().unwrap();
    for path in [packed, clusters] {
        let whole = fs::read(&path).unwrap();
        for at in (0..whole.len()).step_by(5) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0x15;
            fs::write(&path, &bytes).unwrap();
            let _ = read_labelled(&path);
            fs::write(&path, &whole[..at]).unwrap();
            assert!(read_labelled(&path).is_err(), "cut at {at}");
        }
    }
}
