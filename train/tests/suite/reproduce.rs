//! The paper's experiments on shapes that take no time.

use std::path::Path;
use std::process::{Command, Output};

use formats::packed::PackedWriter;

const PLAN: &str = r#"
about = "a test"
mesh_steps = 150
points = [16, 8]
tested_points = [64, 16]
kept = [8]
fronts = [[8, 16]]
mesh_points = 16
explained = 2
lime_samples = 30
draws = 20
[recipe]
epochs = 2
batch = 10
[recipe.network]
input_transform = false
feature_transform = false
trunk = [8, 16]
head = [12]
"#;

const SETS: [&str; 9] = [
    "surfaces/surface",
    "surfaces/seen",
    "lidar/packed/static-clean",
    "lidar/packed/static-noisy",
    "lidar/packed/rotational-clean",
    "lidar/packed/rotational-noisy",
    "noise-0.02/packed/rotational-noisy",
    "noise-0.05/packed/rotational-noisy",
    "noise-0.1/packed/rotational-noisy",
];

/// A folder with a plan, and every dataset: the same plain shapes.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for set in SETS {
        for (split, n) in [("train", 60), ("test", 30)] {
            let clouds = if split == "train" { crate::clouds(n) } else { crate::test_clouds(n) };
            let path = folder.path().join(format!("{set}-{split}.npz"));
            let mut packed = PackedWriter::create(&path, 32, clouds.classes.clone()).unwrap();
            for i in 0..n {
                let n_raw = 10 + 5 * i as u32;
                let label = clouds.set.labels[i];
                packed.push(clouds.set.cloud(i), label, &format!("m{i}_v0"), n_raw).unwrap();
            }
            packed.finish().unwrap();
        }
    }
    std::fs::write(folder.path().join("plan.toml"), PLAN).unwrap();
    folder
}

fn reproduce(folder: &Path, plan: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_edgepuck-train"))
        .args(["reproduce", "--clouds", "surfaces/surface", "--clouds-are", "shapes <of ours>"])
        .args(["--scans", ".", "--meshes-are", "shapes", "--command", "a test"])
        .args(["--plan", plan, "--out", "out"])
        .current_dir(folder)
        .output()
        .unwrap()
}

/// The report's numbers but for times.
fn numbers(folder: &Path) -> Vec<String> {
    let csv = std::fs::read_to_string(folder.join("out/report.csv")).unwrap();
    csv.lines().filter(|line| !line.contains("ms")).map(str::to_owned).collect()
}

#[test]
fn every_experiment_is_in_the_report_and_an_interrupted_run_ends_with_the_same_numbers() {
    let folder = folder();
    let folder = folder.path();
    let ran = reproduce(folder, "plan.toml");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let found = numbers(folder);
    for (table, least) in [
        ("1 trained at N", 6),
        ("1 tested at N", 4),
        ("2 instance", 25),
        ("2 class", 25),
        ("3 steps", 48),
        ("4 accuracy", 5),
        ("4 unique", 4),
        ("4 resize", 4),
        ("5 chamfer", 16),
        ("6 confusion", 9),
        ("6 threshold", 12),
        ("6 noise", 25),
    ] {
        let n = found.iter().filter(|line| line.starts_with(table)).count();
        assert!(n >= least, "{table}: {n} of {least}");
    }
    // These shapes are told apart in training and in tests, of one set.
    let on_itself =
        found.iter().find(|l| l.starts_with("2 instance,static clean,tested on static clean"));
    let accuracy: f64 = on_itself.unwrap().split(',').nth(3).unwrap().parse().unwrap();
    assert!(accuracy > 0.6, "{accuracy}");
    let page = std::fs::read_to_string(folder.join("out/report.html")).unwrap();
    assert!(page.contains("shapes &lt;of ours&gt;") && page.contains("<canvas"));

    // As if it had been killed in its fourth experiment.
    for gone in ["items/4-samplers.json", "items/5-lime.json", "models/cpl-3-8-16-8.safetensors"] {
        std::fs::remove_file(folder.join("out").join(gone)).unwrap();
    }
    std::fs::remove_file(folder.join("out/report.html")).unwrap();
    assert!(reproduce(folder, "plan.toml").status.success());
    assert_eq!(numbers(folder), found);
    assert!(folder.join("out/report.html").is_file());
}

#[test]
fn another_plan_or_a_bad_one_is_refused() {
    let folder = folder();
    let folder = folder.path();
    std::fs::write(folder.join("bad.toml"), PLAN.replace("kept = [8]", "kept = []")).unwrap();
    std::fs::write(folder.join("draws.toml"), PLAN.replace("draws = 20", "draws = 0")).unwrap();
    std::fs::write(folder.join("large.toml"), PLAN.replace("[16, 8]", "[33]")).unwrap();
    std::fs::write(folder.join("typo.toml"), PLAN.replace("draws", "drawings")).unwrap();
    std::fs::write(folder.join("other.toml"), PLAN.replace("draws = 20", "draws = 21")).unwrap();
    std::fs::create_dir(folder.join("out")).unwrap();
    let refused = |plan: &str, expected: &str| {
        let ran = reproduce(folder, plan);
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert!(!ran.status.success() && said.contains(expected), "{plan}: {said}");
    };
    refused("bad.toml", "bad.toml: no points to train at");
    refused("draws.toml", "0 steps or draws");
    refused("large.toml", "the plan wants 33 points, clouds have 32");
    refused("typo.toml", "unknown field `drawings`");
    refused("nowhere.toml", "cannot read nowhere.toml");
    std::fs::write(folder.join("out/terms.toml"), "version = \"another\"").unwrap();
    refused("other.toml", "an earlier run had another plan or other data");
}
