//! `--format pcap`: a VLP-32C's packets. `tests/peers` decodes them.

use crate::{assert_same_tree, exits, meshes, said, succeeds};
use formats::scan_file::read_scan;
use formats::vlp32c::count_returns;
use std::fs;
use std::path::Path;

const DATASET: &str =
    "gen-dataset meshes --sensor vlp32c --views 2 --format pcap --returns dual --adapter cpu";

fn scene(folder: &Path, profile: &str) {
    fs::write(folder.join("torus.off"), meshes::off(40, 0.3)).unwrap();
    let text = format!(
        "[[object]]\nmesh = \"torus.off\"\n[[sensor]]\nprofile = \"{profile}\"\n\
         position_m = [3, 0, 0.2]\nlook_at_m = [0, 0, 0]\n"
    );
    fs::write(folder.join("scene.toml"), text).unwrap();
}

#[test]
fn a_dataset_has_packets_beside_its_points_and_is_verified() {
    let folder = tempfile::tempdir().unwrap();
    meshes::write_tree(&folder.path().join("meshes"));
    succeeds(folder.path(), &format!("{DATASET} --out out"));
    succeeds(folder.path(), "gen-dataset --verify out");
    let stem = folder.path().join("out/rotational/noisy/donut/test/donut_0003_v1");
    let points = read_scan(&stem.with_extension("npz")).unwrap().len() as u64;
    assert!(points > 500);
    assert_eq!(count_returns(&stem.with_extension("pcap")).unwrap(), points);
    let manifest = fs::read_to_string(folder.path().join("out/manifest.json")).unwrap();
    for part in ["\"returns\": \"dual\"", "\"beam_crossing_m\": 0.0424"] {
        assert!(manifest.contains(part), "{part}: how the beams were cast is on record");
    }

    succeeds(folder.path(), &format!("{DATASET} --out shards/1 --shard 1/2"));
    succeeds(folder.path(), &format!("{DATASET} --out shards/2 --shard 2/2"));
    succeeds(folder.path(), "merge-dataset shards/1 shards/2 --out merged");
    assert_same_tree(&folder.path().join("out"), &folder.path().join("merged"));

    let capture = stem.with_extension("pcap");
    let whole = fs::read(&capture).unwrap();
    fs::write(&capture, &whole[..whole.len() - 1]).unwrap();
    let problems = exits(1, folder.path(), "gen-dataset --verify out");
    assert!(problems.contains("noisy/donut/test/donut_0003_v1.pcap"), "{problems}");
}

#[test]
fn a_scene_is_written_as_packets() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path(), "vlp32c");
    for returns in ["strongest", "last", "dual"] {
        let words = format!("scan scene.toml --out {returns}.pcap --returns {returns}");
        let output = succeeds(folder.path(), &words);
        let n = count_returns(&folder.path().join(format!("{returns}.pcap"))).unwrap();
        assert!(n > 500 && said(&output).contains(&format!("{n} points")), "{}", said(&output));
    }
}

#[test]
fn what_packets_cannot_tell_is_refused_before_it_is_cast() {
    let folder = tempfile::tempdir().unwrap();
    for profile in ["vlp16", "kinect-v2", "blainder-ultrapuck", "modelnet40c-lidar"] {
        scene(folder.path(), profile);
        let said = exits(1, folder.path(), "scan scene.toml --out scan.pcap");
        for part in ["scene.toml", "sensor[0]", profile, "VLP-32C alone"] {
            assert!(said.contains(part), "{part} in {said}");
        }
        assert!(!said.contains("Casting"), "{said}");
    }
    scene(folder.path(), "vlp32c");
    let said = exits(2, folder.path(), "scan scene.toml --out scan.npz --returns dual");
    assert!(said.contains("--returns applies to packets only"), "{said}");
    for name in ["scan.pcap", "scan.npz"] {
        assert!(!folder.path().join(name).exists());
    }
}
