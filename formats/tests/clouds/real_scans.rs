//! Real scans and clouds, where a developer has them.

use std::fs;
use std::path::{Path, PathBuf};

use formats::cloud_file::read_cloud;
use formats::labelled::read_labelled;
use test_support::{need, shared_data};

fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path, extensions));
        } else if extensions.iter().any(|extension| path.extension() == Some(extension.as_ref())) {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn reach_m(points: &[[f64; 3]]) -> f64 {
    points.iter().map(|p| p.iter().map(|x| x * x).sum::<f64>().sqrt()).fold(0.0, f64::max)
}

#[test]
fn scans_of_cars_have_their_points() {
    let folder = need!(shared_data("real_scans"));
    for (name, n) in [
        ("kitti_hdl64e_000000.f32x4.bin", 115_384),
        ("kitti_hdl64e_000008_camfov.f32x4.bin", 17_238),
        ("nuscenes_hdl32e_frame.f32x5.bin", 34_688),
        ("objects/kitti_000000_pedestrian.npy", 376),
        ("objects/kitti_000001_truck.npy", 70),
    ] {
        let points = read_cloud(&folder.join(name)).unwrap();
        assert_eq!(points.len(), n, "{name}");
        // Both sensors see 120 m at most by their data sheets.
        assert!((2.0..125.0).contains(&reach_m(&points)), "{name}");
    }
    let packets = read_cloud(&folder.join("vlp16_packets_1206B.bin")).unwrap_err().to_string();
    assert!(packets.ends_with("found raw Velodyne packets: decode them first"), "{packets}");
}

#[test]
fn sampled_models_have_their_points() {
    let folder = need!(shared_data("points"));
    for (below, extension, n_files, n) in [
        ("paper_instances", "npy", 9, 1024),
        ("normal_resampled_txt", "txt", 5, 10_000),
        ("raw_scale_pcd", "pcd", 108, 1024),
    ] {
        let files = files(&folder.join(below), &[extension]);
        assert_eq!(files.len(), n_files, "{below}");
        for path in files {
            let points = read_cloud(&path).unwrap();
            assert_eq!(points.len(), n, "{}", path.display());
            assert!(points.as_flattened().iter().all(|x| x.is_finite()));
        }
    }
}

#[test]
fn the_first_line_of_a_sampled_model_is_its_first_point() {
    let path = need!(shared_data("points/normal_resampled_txt/airplane_0655.txt"));
    assert_eq!(read_cloud(&path).unwrap()[0], [0.081_140, -0.105_800, 0.299_000]);
}

#[test]
fn labelled_models_fill_the_unit_sphere() {
    let path = need!(shared_data("modelnet40-clouds/dev.npz"));
    let set = read_labelled(&path).unwrap();
    assert_eq!((set.len(), set.smallest_cloud()), (1234, 1024));
    let (names, classes) = (set.names.clone().unwrap(), set.classes.clone().unwrap());
    assert_eq!((names.len(), classes.len()), (1234, 40));
    for (i, name) in names.iter().enumerate() {
        assert!(name.starts_with(&classes[set.labels[i]]), "{name}");
        let cloud: Vec<_> = set.cloud(i).iter().map(|point| point.map(f64::from)).collect();
        // Each coordinate is rounded to 1/32767.
        assert!((reach_m(&cloud) - 1.0).abs() < 3f64.sqrt() / 32767.0, "{name}");
    }
}
