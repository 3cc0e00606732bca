//! Reads every real mesh of `../shared/data`, where that is present: none may
//! be refused and no face lost.

use std::path::Path;
use std::time::{Duration, Instant};

use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::tree::{MeshEntry, discover};
use sim_gpu::mesh::validate::triangle_stats;
use sim_gpu::mesh::{LoadedMesh, load};
use test_support::{need, shared_data};
use tests::shared_data::unpacked;

fn load_all(root: &Path) -> Vec<(MeshEntry, LoadedMesh)> {
    let entries = discover(root, 0).expect("the shared data can be listed");
    let read = |entry: MeshEntry| {
        let loaded = load(&entry.path).unwrap_or_else(|error| panic!("{error}"));
        (entry, loaded)
    };
    entries.into_iter().map(read).collect()
}

/// What is true of every mesh once it stands in the world.
fn check(entry: &MeshEntry, loaded: &LoadedMesh) {
    let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere);
    let radius = world.mesh.vertices.iter().map(|v| v.length()).fold(0.0, f64::max);
    // A quotient and a length, each of a few roundings of 2^-53.
    assert!((radius - 1.0).abs() < 1e-15, "{}: radius {radius}", entry.relative);
    let stats = triangle_stats(&world.mesh);
    let left_out = stats.defects.degenerate + stats.defects.duplicate;
    assert_eq!(stats.kept.len() + left_out, loaded.mesh.triangles.len());
    assert!(!stats.kept.is_empty(), "{}", entry.relative);
}

#[test]
fn modelnet_is_read_in_full_and_keeps_its_splits() {
    let root = need!(shared_data("meshes/modelnet"));
    let meshes = load_all(&root);
    assert_eq!(meshes.len(), 13);
    for (entry, loaded) in &meshes {
        check(entry, loaded);
        assert_eq!(loaded.dropped_faces, 0, "{}", entry.relative);
        let expected = format!("{}/{}/{}.off", entry.class, entry.split, entry.name);
        assert_eq!(entry.relative, expected);
    }
    let of = |name: &str| &meshes.iter().find(|(entry, _)| entry.name == name).unwrap().1.mesh;
    // Counts as in the files' headers: glued, CRLF, plain.
    for (name, n_vertices, n_triangles) in
        [("bathtub_0002", 700, 664), ("airplane_0002", 23322, 64290), ("guitar_0001", 8654, 11325)]
    {
        assert_eq!(of(name).vertices.len(), n_vertices, "{name}");
        assert_eq!(of(name).triangles.len(), n_triangles, "{name}");
    }
}

#[test]
fn princeton_meshes_are_read_in_full() {
    let folders = [("meshes/psb_infomr", 148), ("meshes/psb_segbench", 12)];
    let roots = need!(
        folders.map(|(folder, _)| shared_data(folder)).into_iter().collect::<Result<Vec<_>, _>>()
    );
    for ((_, n_meshes), root) in folders.into_iter().zip(roots) {
        let meshes = load_all(&root);
        assert_eq!(meshes.len(), n_meshes);
        for (entry, loaded) in &meshes {
            check(entry, loaded);
            assert_eq!(loaded.dropped_faces, 0, "{}", entry.relative);
        }
    }
}

#[test]
fn the_720_obj_meshes_are_read_in_full() {
    let folder = need!(unpacked("meshes20/meshes20.tar.xz"));
    let meshes = load_all(folder.path());
    assert_eq!(meshes.len(), 720);
    for (entry, loaded) in &meshes {
        check(entry, loaded);
        assert_eq!(loaded.dropped_faces, 0, "{}", entry.relative);
    }
}

/// Prints how long reading and surveying take; asserts nothing, since machines
/// differ.
#[test]
fn the_time_to_read_modelnet_is_shown() {
    let root = need!(shared_data("meshes/modelnet"));
    for entry in discover(&root, 0).unwrap() {
        let (mut reading, mut surveying, mut placing) =
            (Duration::MAX, Duration::MAX, Duration::MAX);
        let mut n_triangles = 0;
        for _ in 0..5 {
            let start = Instant::now();
            let loaded = load(&entry.path).unwrap();
            reading = reading.min(start.elapsed());
            let start = Instant::now();
            let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere);
            placing = placing.min(start.elapsed());
            let start = Instant::now();
            n_triangles = triangle_stats(&world.mesh).kept.len();
            surveying = surveying.min(start.elapsed());
        }
        let megabytes = entry.path.metadata().unwrap().len() as f64 / 1e6;
        println!(
            "{:18} {n_triangles:6} triangles kept, {megabytes:5.2} MB: read {:6.2} ms ({:4.0} MB/s), \
             place {:5.2} ms, stats {:5.2} ms",
            entry.name,
            reading.as_secs_f64() * 1e3,
            megabytes / reading.as_secs_f64(),
            placing.as_secs_f64() * 1e3,
            surveying.as_secs_f64() * 1e3,
        );
    }
}
