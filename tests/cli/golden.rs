//! The bytes that the programs write: `tests/golden/bytes.toml` has their hashes. Its sister tests
//! say what is right; this one says that nothing has changed.
//!
//! `UPDATE_GOLDEN=1 cargo test -p edgepuck --test cli golden` rewrites the file after a change that
//! is meant.

use crate::{Folder, in_repository};
use formats::cloud_file::read_cloud;
use formats::hash::{of_bytes, of_parts};
use infer_cpu::kernel::KernelName;
use infer_cpu::live::{Arrival, LiveOptions, Pipeline, Recorder, Trajectory};
use infer_cpu::{Classifier, Options};
use std::collections::BTreeMap;
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use tests::tree::files;

/// The file of hashes, by name.
const GOLDEN: &str = "tests/golden/bytes.toml";

/// Compares `found` with the golden hashes of the same names, or rewrites those if so asked.
fn check(found: &[(&str, String)]) {
    // Tests run side by side, and each rewrites its own names.
    static FILE: std::sync::Mutex<()> = std::sync::Mutex::new(());
    let _held = FILE.lock();
    let path = in_repository(GOLDEN);
    let text = fs::read_to_string(&path).unwrap_or_default();
    let mut golden: BTreeMap<String, String> = toml::from_str(&text).unwrap();
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        golden.extend(found.iter().map(|(name, hash)| ((*name).to_owned(), hash.clone())));
        fs::write(&path, toml::to_string(&golden).unwrap()).unwrap();
    }
    for (name, hash) in found {
        assert_eq!(golden.get(*name), Some(hash), "{name} differs; UPDATE_GOLDEN=1 rewrites it");
    }
}

fn tree(folder: &Path) -> String {
    let files = files(folder);
    assert!(!files.is_empty(), "{} has no file", folder.display());
    of_parts(files.iter().flat_map(|(path, bytes)| {
        let name = path.to_string_lossy().replace('\\', "/");
        [name.into_bytes(), of_bytes(bytes).into_bytes()]
    }))
}

fn with_shapes() -> Folder {
    let folder = Folder::new();
    folder.succeeds("gen-dataset --save-meshes shapes --seed 5 --train 1 --test 1");
    for class in ["airplane", "bowl", "lamp", "monitor", "table", "vase"] {
        let _ = fs::remove_dir_all(folder.at("shapes").join(class));
    }
    folder
}

const DATASET: &str = "gen-dataset shapes --adapter cpu --sensor vlp32c --noise 0.01";

#[test]
fn datasets_and_tars_keep_their_bytes() {
    let folder = with_shapes();
    folder.succeeds("gen-dataset shapes --adapter cpu --noise 0.01 --views 3 --out files");
    folder.succeeds(&format!("{DATASET} --views 3 --layout webdataset --tar-clouds 10 --out tars"));
    folder.succeeds(&format!("{DATASET} --views 2 --format pcap --returns dual --out packets"));
    // How a picture is drawn and compressed is not part of a data set.
    for out in ["files", "packets"] {
        fs::remove_file(folder.at(out).join("example.png")).unwrap();
    }
    check(&[
        ("data set of two sets, manifest included", tree(&folder.at("files"))),
        ("run of tars", tree(&folder.at("tars"))),
        ("data set of packets", tree(&folder.at("packets"))),
    ]);
}

#[test]
fn scans_of_a_scene_keep_their_bytes() {
    let folder = Folder::new();
    folder.write("torus.off", crate::meshes::off(40, 0.3));
    let scene = include_str!("inputs/torus.toml");
    folder.write("scene.toml", scene);
    for file in ["out/scan.npz", "out/scan.ply", "out/scan.csv", "out/scan.pcap"] {
        folder.succeeds(&format!("scan scene.toml --adapter cpu --out {file}"));
    }
    check(&[("scans of a scene: NPZ, PLY, CSV, packets", tree(&folder.at("out")))]);
}

#[test]
fn street_scenes_and_their_clusters_keep_their_bytes() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes street --sweeps 3 --save 2 --seed 3 --adapter cpu --out street");
    // How a picture is compressed is not ours.
    fs::remove_file(folder.at("street/preview.png")).unwrap();
    check(&[("street scenes with clusters", tree(&folder.at("street")))]);
}

#[test]
fn corruptions_and_weather_keep_their_bytes() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes street --sweeps 1 --save 1 --seed 3 --adapter cpu --out street");
    let sweep = "street/sweeps/000000.npz";
    folder.succeeds(&format!("corrupt {sweep} --out sweeps"));
    folder.succeeds(&format!("corrupt {sweep} --rain 40 --seed 2 --out rain.npz"));
    check(&[
        ("corrupted sweeps", tree(&folder.at("sweeps"))),
        ("a sweep in rain", of_bytes(&folder.bytes("rain.npz"))),
    ]);
}

/// The scalar kernels are the same on every processor.
fn on_scalar_kernels() -> Options {
    Options { kernel: Some(KernelName::Scalar), threads: 1, ..Options::default() }
}

#[test]
fn a_drive_its_objects_and_its_recording_keep_their_bytes() {
    let folder = Folder::new();
    folder.succeeds("gen-scenes street --drive 0.3 --speed 8 --seed 2 --out drive.pcap");
    let model = in_repository("assets/weights/street-bev.safetensors");
    let mut options = LiveOptions::default();
    options.ego_motion = Some(Trajectory::load(&folder.at("drive.tum")).unwrap());
    let mut pipeline = Pipeline::open(&model, &on_scalar_kernels(), &options).unwrap();
    let mut recorder = Recorder::create(&folder.at("drive.mcap")).unwrap();
    let mut lines = Vec::new();
    let mut answer = |pipeline: &mut Pipeline, recorder: &mut Recorder| {
        pipeline.answer(|object| {
            lines.push(serde_json::to_string(object).unwrap());
            recorder.object(object);
        });
        recorder.packet(pipeline).unwrap();
    };
    formats::pcap::read(&folder.at("drive.pcap"), |packet| {
        let arrival = Arrival { time_s: packet.time_s.unwrap(), moment: None };
        pipeline.take(&packet.payload, arrival);
        answer(&mut pipeline, &mut recorder);
        ControlFlow::Continue(())
    })
    .unwrap();
    pipeline.end();
    answer(&mut pipeline, &mut recorder);
    recorder.finish(&pipeline).unwrap();
    assert!(lines.len() > 10, "{} lines", lines.len());
    check(&[
        ("packets of a drive", of_bytes(&folder.bytes("drive.pcap"))),
        ("truth of a drive", of_bytes(&folder.bytes("drive.truth.jsonl"))),
        ("JSON lines of a drive", of_parts(&lines)),
        ("MCAP messages of a drive", of_bytes(&folder.bytes("drive.mcap"))),
    ]);
}

#[test]
fn logits_of_bundled_models_keep_their_bits() {
    let folder = with_shapes();
    folder.succeeds("gen-dataset shapes --adapter cpu --noise 0.01 --views 1 --out scans");
    let clouds = files(&folder.at("scans/rotational/noisy"));
    let clouds: Vec<_> = clouds
        .keys()
        .filter(|path| path.extension().is_some_and(|extension| extension == "npz"))
        .map(|path| read_cloud(&folder.at("scans/rotational/noisy").join(path)).unwrap())
        .collect();
    assert_eq!(clouds.len(), 8);
    let weights = in_repository("assets/weights");
    let mut found = Vec::new();
    // What sees whole sweeps is in the objects of the drive.
    let is_classifier = |file: &&PathBuf| {
        file.extension().unwrap() == "safetensors" && !file.starts_with("street-bev.safetensors")
    };
    for file in files(&weights).keys().filter(is_classifier) {
        let mut classifier = Classifier::load(&weights.join(file), &on_scalar_kernels()).unwrap();
        let logits = clouds.iter().flat_map(|cloud| {
            let prediction = classifier.classify_f64(cloud).unwrap();
            prediction.logits.iter().map(|logit| logit.to_le_bytes()).collect::<Vec<_>>()
        });
        found.push((format!("logits of {}", file.display()), of_parts(logits)));
    }
    assert!(found.len() >= 6);
    check(&found.iter().map(|(name, hash)| (&**name, hash.clone())).collect::<Vec<_>>());
}

/// The products of training are summed by the widest instructions of the machine.
#[test]
fn a_model_trained_for_two_epochs_keeps_its_bytes() {
    let folder = with_shapes();
    if KernelName::Avx512.kernels().is_none() {
        return test_support::skip("the golden model was trained on a machine with AVX-512");
    }
    folder.succeeds(&format!("{DATASET} --views 12 --out scans"));
    let recipe = in_repository("assets/recipes/edge-64.toml");
    let words = format!(
        "train --data scans/packed/rotational-noisy --recipe {} --epochs 2 --out m.safetensors",
        recipe.display()
    );
    folder.succeeds(&words);
    check(&[("model trained for two epochs", of_bytes(&folder.bytes("m.safetensors")))]);
}
