//! Bad input gives a clear error, the right exit code and no partial files.

use crate::Folder;
use std::fs;

#[test]
fn bad_meshes_are_named_and_the_others_go_on() {
    let folder = Folder::with_meshes();
    for (name, text) in [
        ("truncated.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n"),
        ("index.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n"),
        ("nan.off", "OFF\n3 1 0\n0 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n"),
        ("empty.off", ""),
        ("no_triangle.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"),
        ("picture.off", "\u{89}PNG\r\n"),
        ("nan.obj", "v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n"),
        ("short.ply", "ply\nformat ascii 1.0\nelement vertex 9\n"),
        ("short.stl", "solid x\nfacet normal 0 0 1\n"),
    ] {
        folder.write(&format!("meshes/bad/train/{name}"), text);
    }
    let said = folder.exits(3, "gen-dataset meshes --out out --adapter cpu");
    assert!(said.contains("9 meshes, 9 failed"), "{said}");
    let listed = folder.text("out/failures.jsonl");
    assert_eq!(listed.lines().count(), 9, "{listed}");
    for part in ["bad/train/index.off", "\"line\":6", "bad/train/nan.obj"] {
        assert!(listed.contains(part), "{part} in {listed}");
    }
    assert!(folder.at("out/rotational/clean/ring/train").exists());
    folder.succeeds("gen-dataset --verify out");
}

#[test]
fn each_command_has_the_same_names_of_models() {
    let folder = Folder::new();
    folder.write("c.xyz", "0 0 0\n1 0 0\n0 1 0\n0 0 1\n");
    let cause =
        "edge-65: name: expected a model file, or one of edge-64, set-64, street-128, shapes-ro";
    for words in [
        "classify c.xyz --model edge-65",
        "inspect edge-65",
        "bench --model edge-65",
        "sample c.xyz d.xyz --sampler cpl --model edge-65",
        "live --udp 0 --model edge-65",
        "detect c.xyz --out o.json --model edge-65",
        "eval --data c.xyz --model edge-65",
        "explain --cloud c.xyz --points 2 --model edge-65",
        "export-onnx edge-65 --out m.onnx",
    ] {
        folder.refuses(1, &[(words, cause)]);
    }
    assert!(folder.succeeds("inspect street-128").contains("two-wheeler"));
}

#[test]
fn a_mesh_without_area_is_a_bad_mesh() {
    let folder = Folder::with_meshes();
    folder.write("meshes/flat/a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n2 0 0\n3 0 1 2\n");
    let said = folder.exits(3, "gen-dataset meshes --out out --adapter cpu --views 1");
    assert!(said.contains("failed: flat/a.off: no triangle has an area, so that no"), "{said}");
    assert!(said.contains(", 1 failed; "), "{said}");
}

#[test]
fn a_dataset_without_clouds_and_a_sensor_inside_a_mesh_are_told() {
    let folder = Folder::with_meshes();
    let words = "gen-dataset meshes --adapter cpu --sensor vlp16 --points 64 --views 1";
    let said = folder.exits(3, &format!("{words} --out a --min-points 100000"));
    let cause = "-train.npz holds no cloud: expected scans of 100000 points, found";
    assert_eq!(said.matches(cause).count(), 2, "{said}");
    let said = folder.succeeds(&format!("{words} --out b --distance 0.5"));
    let cause = "a sensor stands inside its bounding box: expected a larger --distance\n";
    assert!(said.contains(cause), "{said}");
}

#[test]
fn commands_that_cannot_be_are_usage_errors() {
    let folder = Folder::with_meshes();
    folder.write("file", "");
    #[cfg(target_os = "linux")]
    folder.refuses(2, &[("gen-shapes --out /sys", "no file can be made in the folder /sys: ")]);
    folder.refuses(
        2,
        &[
            ("gen-dataset meshes --views 0", "--views"),
            ("gen-dataset meshes --noise -1", "error: --noise: expected a number within 0..="),
            ("gen-dataset meshes --noise=nan", "--noise: expected"),
            ("gen-dataset meshes --dropout 2", "error: --dropout: expected a number within 0..=1"),
            ("gen-dataset meshes --distance 0", "distance"),
            ("gen-dataset meshes --distance -3", "--distance: expected a number above 0, found -3"),
            (
                "gen-dataset meshes --distance 10,2",
                "--distance: expected a number of at least 10, f",
            ),
            ("gen-dataset meshes --views -3", "'-3' for '--views <N>'"),
            ("gen-dataset meshes --azimuth-jitter -3", "error: --azimuth-jitter: expected"),
            ("scan --distance -3 --out x.npz", "expected a finite number above 0"),
            (
                "detect x.npy --out x.json --min-points -3",
                "invalid value '-3' for '--min-points <N>': expected a whole number, 0 or more",
            ),
            ("segment x.npy --out x --radius wide", "'wide' for '--radius <M>': expected a number"),
            ("gen-dataset meshes --views 1.5", "'1.5' for '--views <N>': expected a whole number"),
            ("train --data x --epochs 9999999999", "9999999999 is not in"),
            ("train --data x --epochs -3", "'-3' for '--epochs"),
            ("live --udp -3", "'-3' for '--udp"),
            ("gen-dataset meshes --elevation 91", "error: --elevation: expected"),
            ("gen-dataset meshes --shard 4/3", "--shard"),
            ("gen-dataset meshes --up x", "--up"),
            ("gen-dataset meshes --attributes colour", "colour"),
            ("gen-dataset meshes --format stl", "stl"),
            ("gen-dataset meshes --points 0", "--points"),
            ("gen-dataset meshes --hash md5", "sha256, blake3, none"),
            ("gen-dataset meshes --reflectivity 1.5", "<R>': expected a number from 0 to 1"),
            ("gen-dataset meshes --effects a.toml --noise 0.02", "--effects"),
            ("gen-dataset meshes --format pcap", "sensor \"generic-static\": rotating: missing"),
            ("gen-dataset meshes --sensor vlp16 --format pcap", "VLP-32C only"),
            ("gen-dataset meshes --sensor vlp32c --format pcap --noise-model xyz", "noise.model"),
            ("gen-dataset meshes --returns dual", "add --format pcap"),
            ("gen-dataset meshes --returns both", "strongest, last, dual"),
            ("gen-dataset meshes --sensor kinect-v2 --quantise", "kinect-v2"),
            ("gen-dataset meshes --out meshes", "--out: meshes is the folder of the meshes"),
            (
                "gen-dataset meshes --tar-clouds 9",
                "--tar-clouds applies to tars only: add --layout",
            ),
            ("gen-shapes --train 0 --test 0", "--train and --test: expected a number above 0"),
            (
                "scan --distance 5 --out n.npz",
                "--distance applies to scans of meshes: data/default-",
            ),
            ("bench --threads 0", "'0' for '--threads"),
            ("no-such-command", "no-such-command"),
            ("gen-dataset meshes --out file", "expected a folder, found the file file"),
            ("gen-shapes --out file", "expected a folder, found the file file"),
            ("gen-scenes --sweeps 1 --out file/a", "expected a folder, found the file file"),
            ("gen-drive --out file/a.pcap", "file/a.pcap: expected a folder, found the file file"),
            (
                "scan meshes/ring/train/ring_0001.off --out file/a.npz",
                "file/a.npz: expected a folder, found the file file",
            ),
            ("train --data x.npz --out file/a.safetensors", "expected a folder, found the file"),
        ],
    );
    assert!(!folder.at("data").exists(), "nothing was written");
}

#[test]
fn what_is_not_there_is_named() {
    let folder = Folder::new();
    fs::create_dir(folder.at("empty")).unwrap();
    folder.write("bad.toml", "name = \"x\"\n");
    folder.write("bad.npz", "PK\u{3}\u{4}");
    folder.write("meshes.obj", "v 0 0 0\n");
    folder.write("latin.toml", b"# A scene\nname = \"M\xFCller\"\n");
    folder.write("utf16.toml", b"\xFF\xFEn\0a\0");
    folder.refuses(
        1,
        &[
            ("gen-dataset nowhere", "nowhere"),
            ("gen-dataset empty --effects bad.toml", "bad.toml"),
            ("gen-dataset empty --effects none.toml", "none.toml"),
            ("gen-dataset empty", "empty"),
            ("gen-dataset empty --sensor vlp99", "vlp32c"),
            ("profile VLP32C", "found \"VLP32C\"; did you mean \"vlp32c\"?"),
            ("gen-dataset empty --sensor ./bad.toml", "bad.toml"),
            ("gen-dataset empty --adapter no-such-adapter", "no"),
            ("gen-dataset --verify nowhere", "nowhere"),
            ("merge-dataset nowhere --out x", "nowhere"),
            ("profile meshes.obj", "meshes.obj: expected a TOML file, found .obj"),
            ("live --pcap -", "-: name: expected a file, found standard input"),
            ("scan nowhere.toml --out x.npz", "nowhere.toml"),
            ("scan bad.toml --out x.npz", "bad.toml"),
            ("scan latin.toml --out x.npz", "in UTF-8, found the byte 0xFC in line 2: save it"),
            ("profile utf16.toml", "expected text in UTF-8, found text in UTF-16: save it"),
            ("scan bad.toml --out x.las", "x.las"),
            ("preview nowhere.npz", "nowhere.npz"),
            ("gen-scenes --meshes nosuch --out x", "nosuch: no object of this recipe is of kind"),
            (
                "gen-drive --meshes nosuch --out x.pcap",
                "nosuch: no object of this recipe is of kind",
            ),
            ("preview bad.npz", "bad.npz"),
        ],
    );
    assert!(!folder.at("x.npz").exists());
}

#[test]
fn a_dataset_inside_the_folder_of_its_meshes_does_not_count() {
    let folder = Folder::with_meshes();
    let words = "gen-dataset meshes --out meshes/scans --adapter cpu --format ply --sensor vlp32c";
    let said = folder.succeeds(words);
    assert!(said.contains("9 meshes, 0 failed"), "{said}");
    let said = folder.succeeds(&format!("{words} --overwrite"));
    assert!(said.contains("9 meshes, 0 failed"), "{said}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_name_that_is_not_unicode_does_not_stop_the_others() {
    use std::os::unix::ffi::OsStrExt;
    let folder = Folder::with_meshes();
    let name = std::ffi::OsStr::from_bytes(b"ring_\xE9.off");
    fs::write(folder.at("meshes/ring/train").join(name), crate::meshes::off(8, 0.1)).unwrap();
    let said = folder.exits(3, "gen-dataset meshes --out out --adapter cpu --sensor vlp32c");
    assert!(said.contains("9 meshes, 1 failed"), "{said}");
    assert!(said.contains(r"failed: ring/train/ring_\xE9.off: "), "{said}");
    assert!(said.contains("the path is not Unicode; rename it"), "{said}");
}

#[test]
fn what_is_doubtful_about_meshes_is_told_once() {
    let folder = Folder::new();
    // A square with a triangle out of it, and a bow tie.
    let obj = "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 2 1 0\nv 0 4 0\nf 1 2 3 4 5\nf 1 3 2 5\n";
    folder.write("meshes/tie/a.obj", obj);
    let warning = "a.obj: 1 of 2 faces cross themselves, so that their surface is a guess; the \
                   first is face 2";
    let said = folder.succeeds("gen-dataset meshes --out out --adapter cpu --up z --sensor vlp32c");
    assert_eq!(said.matches(&format!("warning: tie/{warning}")).count(), 1, "{said}");
    assert_eq!(said.matches("split; another seed").count(), 1, "{said}");
    let object = "[[object]]\nname = \"one\"\nmesh = \"meshes/tie/a.obj\"\nup = \"z\"\n";
    let sensor = "[[sensor]]\nprofile = \"vlp32c\"\nposition_m = [1, 0.5, 9]\npitch_deg = 90\n";
    folder.write("scene.toml", object.to_owned() + &object.replace("one", "two") + sensor);
    let said = folder.succeeds("scan scene.toml --out scan.npz --adapter cpu");
    assert_eq!(said.matches(warning).count(), 1, "{said}");
}
