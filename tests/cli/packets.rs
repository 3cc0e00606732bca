//! `--format pcap`: a VLP-32C's packets. `tests/peers` decodes them.

use crate::{Folder, meshes};
use formats::velodyne::count_returns;

const DATASET: &str = "gen-dataset meshes --sensor vlp32c --noise 0.01 --views 2 --format pcap --returns dual --adapter cpu";

#[test]
fn a_dataset_has_packets_beside_its_points_and_is_verified() {
    let folder = Folder::with_meshes();
    folder.succeeds(&format!("{DATASET} --out out"));
    folder.succeeds("gen-dataset --verify out");
    let stem = "out/rotational/noisy/donut/test/donut_0003_v1";
    let points = folder.scan(&format!("{stem}.npz")).len() as u64;
    assert!(points > 500);
    let capture = format!("{stem}.pcap");
    assert_eq!(count_returns(&folder.at(&capture)).unwrap(), points);
    let manifest = folder.text("out/manifest.json");
    for part in ["\"returns\": \"dual\"", "\"beam_crossing_m\": 0.0424"] {
        assert!(manifest.contains(part), "{part}: how the beams were cast is on record");
    }

    folder.succeeds(&format!("{DATASET} --out shards/1 --shard 1/2"));
    folder.succeeds(&format!("{DATASET} --out shards/2 --shard 2/2"));
    folder.succeeds("merge-dataset shards/2/manifest.json shards/1 --out merged");
    folder.assert_same_tree("out", "merged");

    let whole = folder.bytes(&capture);
    folder.write(&capture, &whole[..whole.len() - 1]);
    folder.refuses(1, &[("gen-dataset --verify out", "noisy/donut/test/donut_0003_v1.pcap")]);
    // Without hashes, more returns than points tell that it is another capture: its frames twice.
    folder.succeeds(&format!("{DATASET} --out bare --hash none"));
    folder.write(&capture.replace("out/", "bare/"), [&whole[..], &whole[24..]].concat());
    let problem = format!("donut_0003_v1.pcap: holds {} returns of {points} points", 2 * points);
    folder.refuses(1, &[("gen-dataset --verify bare", &problem)]);
}

#[test]
fn a_scene_is_written_as_packets() {
    let folder = Folder::new();
    folder.write("torus.off", meshes::off(40, 0.3));
    let text = "[[object]]\nmesh = \"torus.off\"\n[[sensor]]\nprofile = \"vlp32c\"\n\
                position_m = [3, 0, 0.2]\nlook_at_m = [0, 0, 0]\n";
    folder.write("scene.toml", text);
    for returns in ["strongest", "last", "dual"] {
        let file = format!("{returns}.pcap");
        let said = folder.succeeds(&format!("scan scene.toml --out {file} --returns {returns}"));
        let n = count_returns(&folder.at(&file)).unwrap();
        assert!(n > 500 && said.contains(&format!("{n} points")), "{said}");
    }
}
