//! `classify`: its output and flags.

use formats::model_card::{ModelCard, Normalization};

use crate::program::{Folder, card, strip};
use crate::tiny_model;

#[test]
fn a_line_is_name_class_and_confidence() {
    let folder = Folder::new();
    folder.cloud("one cloud.xyz", &strip(50));
    let output = folder.command("classify --model m.safetensors").arg("one cloud.xyz").output();
    let line = String::from_utf8(output.unwrap().stdout).unwrap();
    let fields: Vec<_> = line.trim_end().split('\t').collect();
    assert_eq!(fields[0], "one cloud.xyz");
    assert!(["a", "b", "c", "d"].contains(&fields[1]), "{line}");
    let percent: f64 = fields[2].strip_suffix(" %").unwrap().parse().unwrap();
    assert!((25.0..=100.0).contains(&percent), "the best of four is not below a quarter: {line}");
}

#[test]
fn an_object_says_all_there_is_to_say() {
    let folder = Folder::with_cloud(50);
    let found = &folder.classify_json("--sampler fps --points 20 c.xyz")[0];
    assert_eq!(found["file"], "c.xyz");
    let class = found["class"].as_u64().unwrap() as usize;
    assert_eq!(found["label"], ["a", "b", "c", "d"][class]);
    let logits: Vec<f64> =
        found["logits"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert!(logits.iter().all(|&logit| logit <= logits[class]));
    let sum: f64 = logits.iter().map(|logit| (logit - logits[class]).exp()).sum();
    // Logits have 24 bits; the sum keeps 22 of them.
    assert!((found["confidence"].as_f64().unwrap() - 1.0 / sum).abs() < 1e-6);
    assert_eq!((&found["points"], &found["used"]), (&50.into(), &20.into()));
    assert_eq!((&found["dropped"], &found["clipped"]), (&0.into(), &0.into()));
    assert_eq!(found["precision"], "f32");
    assert!(found["ms"].as_f64().unwrap() > 0.0);
}

#[test]
fn unknown_is_printed_and_the_fine_class_stays_in_the_object() {
    let folder = Folder::with_cloud(50);
    let known = folder.classify_json("c.xyz")[0].clone();
    assert!(known.get("unknown").is_none(), "{known}");
    let label = known["label"].as_str().unwrap();
    let write = |card: &ModelCard| {
        tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), card);
    };
    write(&ModelCard { unknown_classes: vec![label.to_owned()], ..card() });
    assert!(folder.classify("c.xyz").out.starts_with("c.xyz\tunknown\t"));
    let found = folder.classify_json("c.xyz")[0].clone();
    assert_eq!(found["unknown"], true);
    for key in ["class", "label", "confidence", "logits"] {
        assert_eq!(found[key], known[key], "{key}");
    }
    let inspected = folder.run("inspect m.safetensors").out;
    assert!(inspected.contains(&format!("unknown         {label}\n")), "{inspected}");
    // Every cloud has a larger energy.
    write(&ModelCard { unknown_energy: Some(-1e9), temperature: 2.0, ..card() });
    let found = folder.classify_json("c.xyz")[0].clone();
    assert_eq!((&found["unknown"], &found["label"]), (&true.into(), &known["label"]));
    assert!(found["confidence"].as_f64() < known["confidence"].as_f64(), "{found}");
}

#[test]
fn a_network_of_metres_sees_how_large_an_object_is_and_not_where_it_is() {
    let folder = Folder::new();
    let card = ModelCard { normalization: Normalization::Metric, ..card() };
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), &card);
    // Eighths are exact in f64 at any offset.
    let cloud: Vec<_> = strip(50).iter().map(|p| p.map(|x| (x * 8.0).round() / 8.0)).collect();
    let moved = |point: &[f64; 3]| [point[0] + 32.0, point[1] - 8.0, point[2] - 2.0];
    folder.cloud("here.xyz", &cloud);
    folder.cloud("there.xyz", &cloud.iter().rev().map(moved).collect::<Vec<_>>());
    folder.cloud("large.xyz", &cloud.iter().map(|p| p.map(|x| 2.0 * x)).collect::<Vec<_>>());
    let found = folder.classify_json("here.xyz there.xyz large.xyz");
    assert_eq!(found[0]["logits"], found[1]["logits"]);
    assert_ne!(found[0]["logits"], found[2]["logits"]);
    let unit = folder.classify_json("--normalize unit-sphere here.xyz large.xyz");
    assert_eq!(unit[0]["logits"], unit[1]["logits"]);
    assert_ne!(unit[0]["logits"], found[0]["logits"]);
}

#[test]
fn every_format_of_a_cloud_gives_the_same_answer() {
    let folder = Folder::new();
    // Eighths are exact in all formats.
    let cloud: Vec<_> = strip(50).iter().map(|p| p.map(|x| (x * 8.0).round() / 8.0)).collect();
    let names = ["c.ply", "c.npz", "c.npy", "c.pcd", "c.xyz", "c.csv", "c.bin"];
    for name in names {
        formats::cloud_file::write_cloud(&folder.path(name), &cloud).unwrap();
    }
    let found = folder.classify_json(&names.join(" "));
    assert_eq!(found.len(), names.len());
    for (found, name) in found.iter().zip(names) {
        assert_eq!(found["file"], name);
        assert_eq!(found["logits"], folder.classify_json(names[0])[0]["logits"], "{name}");
    }
}

#[test]
fn standard_input_holds_one_cloud() {
    let folder = Folder::with_cloud(50);
    let text = std::fs::read(folder.path("c.xyz")).unwrap();
    let ran = folder.run_with("classify --json --model m.safetensors -", &text);
    assert_eq!(ran.code, 0, "{}", ran.err);
    assert_eq!(ran.json()[0]["logits"], folder.classify_json("c.xyz")[0]["logits"]);
    let ran = folder.run_with("classify --model m.safetensors --format ply -", &text);
    ran.assert_refused(1, "error: standard input: ");
    let twice = folder.classify("- -");
    twice.assert_refused(2, "error: expected `-` once");
}

#[test]
fn threads_and_kernels_do_not_change_the_class() {
    let folder = Folder::with_cloud(200);
    let one = folder.run("classify --json --model m.safetensors --threads 1 c.xyz").json();
    for threads in [2, 3, 4] {
        let line = format!("classify --json --model m.safetensors --threads {threads} c.xyz");
        assert_eq!(folder.run(&line).json()[0]["logits"], one[0]["logits"], "{threads}");
    }
    let scalar = folder.classify_json("--kernel scalar c.xyz");
    assert_eq!(scalar[0]["class"], one[0]["class"]);
}

#[test]
fn the_sampler_is_the_model_s_own_but_for_what_flags_say() {
    let folder = Folder::new();
    let mut trained = card();
    (trained.sampler, trained.points) = (Some("fps".to_owned()), Some(24));
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), &trained);
    folder.cloud("c.xyz", &strip(100));
    let used = |flags: &str| folder.classify_json(&format!("{flags} c.xyz"))[0]["used"].clone();
    assert_eq!(used(""), 24);
    assert_eq!(used("--points 48"), 48);
    assert_eq!(used("--sampler all"), 100);
    assert_eq!(used("--sampler random"), 24);
    let flags = "--sampler all --points 3 c.xyz";
    folder.classify(flags).assert_refused(2, "error: --points does not apply to the sampler all");
}

#[test]
fn every_sampler_and_precision_classifies() {
    let folder = Folder::with_cloud(100);
    for sampler in ["all", "first", "random", "fps", "voxel", "cpl"] {
        for precision in ["f32", "f32-fc16", "f16", "i8"] {
            let points = if sampler == "all" { "" } else { "--points 40" };
            let line = format!("--sampler {sampler} {points} --precision {precision} c.xyz");
            let found = &folder.classify_json(&line)[0];
            assert_eq!(found["precision"], precision, "{line}: {found}");
        }
    }
    assert_eq!(folder.classify("--sampler cpl --points 40 --front stn c.xyz").code, 0);
}

#[test]
fn votes_are_seeded_and_need_a_sampler_that_draws() {
    let folder = Folder::with_cloud(100);
    let votes = |seed: u32| {
        let line = format!("--sampler random --points 30 --votes 5 --seed {seed} c.xyz");
        folder.classify_json(&line)[0]["logits"].clone()
    };
    assert_eq!(votes(1), votes(1));
    assert_ne!(votes(1), votes(2));
    folder
        .classify("--votes 5 c.xyz")
        .assert_refused(2, "error: expected the sampler random or rotations");
    assert_eq!(folder.classify("--votes 5 --vote-rotations --up y c.xyz").code, 0);
    // Requesting more points than the cloud has keeps all of them.
    let most = "--sampler random --points 2000000000000000000 c.xyz";
    assert_eq!(folder.classify(most).code, 0);
}

#[test]
fn what_makes_no_sense_is_a_usage_error() {
    let folder = Folder::with_cloud(9);
    for (flags, start) in [
        ("", "error: the following required arguments"),
        (
            "--up y c.xyz",
            "error: the following required arguments were not provided:\n  --vote-rot",
        ),
        ("--sampler fsp c.xyz", "error: invalid value 'fsp' for '--sampler"),
        ("--precision f8 c.xyz", "error: invalid value 'f8' for '--precision"),
        ("--sampler fps --points 0 c.xyz", "error: expected a sampler that keeps 1 point"),
        ("--sampler voxel --voxel-size=-1 c.xyz", "error: expected a voxel size above 0, found -1"),
        (
            "--sampler cpl --front own c.xyz",
            "error: the sampler cpl cannot use the front end `own`",
        ),
        (
            "--sampler cpl --front trunk c.xyz",
            "error: the sampler cpl cannot use the front end `trunk`",
        ),
        ("--threads 0 c.xyz", "error: "),
        ("--threads 5000 c.xyz", "error: invalid value '5000' for '--threads"),
        ("--files-from list c.xyz", "error: the argument"),
    ] {
        let ran = folder.run(&format!("classify --model m.safetensors {flags}"));
        ran.assert_refused(2, start);
    }
}

/// A reader such as `head` that ends after a line is not an error.
#[cfg(unix)]
#[test]
fn a_reader_that_leaves_is_no_failure() {
    use std::process::Stdio;
    let folder = Folder::with_cloud(9);
    let files = "c.xyz ".repeat(2000);
    let mut child = folder
        .command(&format!("classify --json --model m.safetensors {files}"))
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // The remaining output exceeds the buffer of a pipe.
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
}

#[test]
fn outliers_are_dropped_where_the_card_or_the_flag_says_so() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &[strip(50), vec![[40.0, 40.0, 40.0]]].concat());
    assert!(folder.classify_json("c.xyz")[0].get("outliers").is_none());
    assert_eq!(folder.classify_json("--outlier-filter true c.xyz")[0]["outliers"], 1);
    let card = ModelCard { outlier_filter: true, ..card() };
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), &card);
    assert_eq!(folder.classify_json("c.xyz")[0]["outliers"], 1);
    assert!(folder.classify_json("--outlier-filter false c.xyz")[0].get("outliers").is_none());
}
