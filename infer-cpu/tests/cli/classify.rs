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
fn json_has_all_fields_of_a_prediction() {
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
    write(&ModelCard { unknown_classes: vec![label.to_owned()], temperature: 2.0, ..card() });
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
    for name in &names[..6] {
        formats::cloud_file::write_cloud(&folder.path(name), &cloud).unwrap();
    }
    let rows = cloud.iter().flat_map(|&[x, y, z]| [x, y, z, 0.0].map(|x| (x as f32).to_le_bytes()));
    std::fs::write(folder.path("c.bin"), rows.flatten().collect::<Vec<u8>>()).unwrap();
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
    let ran = folder.run_with("classify --model m.safetensors --input-format ply -", &text);
    ran.assert_refused(1, "error: standard input: ");
}

#[test]
fn flags_override_the_sampler_of_the_model() {
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
}

#[test]
fn every_sampler_and_precision_classifies() {
    let folder = Folder::with_cloud(100);
    for sampler in ["all", "first", "random", "fps", "cpl"] {
        for precision in ["f32", "i8"] {
            let points = if sampler == "all" { "" } else { "--points 40" };
            let line = format!("--sampler {sampler} {points} --precision {precision} c.xyz");
            let found = &folder.classify_json(&line)[0];
            assert_eq!(found["precision"], precision, "{line}: {found}");
        }
    }
    let flags = "--sampler cpl --points 40 --front stn --kernel scalar --threads 3";
    assert_eq!(folder.run(&format!("classify --model m.safetensors {flags} c.xyz")).code, 0);
}

#[test]
fn random_points_are_seeded_and_at_most_all() {
    let folder = Folder::with_cloud(100);
    let drawn = |seed: u32| {
        let line = format!("--sampler random --points 30 --seed {seed} c.xyz");
        folder.classify_json(&line)[0]["logits"].clone()
    };
    assert_eq!(drawn(1), drawn(1));
    assert_ne!(drawn(1), drawn(2));
    let most = "--sampler random --points 2000000000000000000 c.xyz";
    assert_eq!(folder.classify(most).code, 0);
}

#[cfg(unix)]
#[test]
fn a_closed_pipe_is_success() {
    let files = "c.xyz ".repeat(2000);
    let line = format!("classify --json --model m.safetensors {files}");
    Folder::with_cloud(9).assert_closed_pipe_is_success(&line);
}

#[test]
fn a_bad_file_is_one_line_and_the_others_go_on() {
    let folder = Folder::with_cloud(30);
    folder.write("text.xyz", "1 2 3\n4 five 6\n");
    folder.write("cut.npy", b"\x93NUMPY\x01\x00");
    folder.write("cut.ply", "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n");
    folder.write("none.xyz", "");
    folder.write("nan.xyz", "0 0 nan\n");
    folder.write("mesh.off", "OFF\n");
    std::fs::create_dir(folder.path("folder")).unwrap();
    let bad =
        ["text.xyz", "cut.npy", "cut.ply", "none.xyz", "nan.xyz", "mesh.off", "folder", "gone.npz"];
    let files = bad.map(|name| format!("{name} c.xyz ")).concat();
    let ran = folder.classify(&format!("--json {files}"));
    assert_eq!((ran.code, ran.err.as_str()), (1, ""));
    let answers = ran.json();
    assert_eq!(answers.len(), 2 * bad.len());
    for (answers, bad) in answers.chunks(2).zip(bad) {
        let error = answers[0]["error"].as_str().unwrap();
        assert_eq!(answers[0]["file"], bad);
        assert!(error.starts_with(bad), "{error}");
        assert!(answers[1].get("error").is_none(), "{}", answers[1]);
    }
    // Without --json, errors are on standard error, and only there.
    let ran = folder.classify(&files);
    assert_eq!((ran.code, ran.out.lines().count(), ran.err.lines().count()), (1, 8, 8));
}
