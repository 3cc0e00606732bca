//! The paper's experiments on shapes that take no time.

use super::context::{ExperimentContext, Plan};
use super::experiments;
use crate::study::plan::Plan as _;
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use formats::rng::StreamKey;
use std::cell::RefCell;
use std::path::Path;

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

/// A folder with every dataset: the same plain shapes.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for set in SETS {
        for (split, seed, n) in [("train", 5, 60), ("test", 6, 30)] {
            let path = folder.path().join(format!("{set}-{split}.npz"));
            write_clouds(&path, seed, 0, n);
        }
    }
    folder
}

fn plan(text: &str) -> anyhow::Result<Plan> {
    let plan: Plan = toml::from_str(text)?;
    plan.check()?;
    Ok(plan)
}

fn reproduce(folder: &Path, plan: Plan) -> anyhow::Result<()> {
    experiments(&ExperimentContext {
        plan,
        clouds: folder.join("surfaces/surface"),
        clouds_are: "shapes <of ours>".to_owned(),
        scans: folder.to_owned(),
        meshes_are: "shapes".to_owned(),
        out: folder.join("out"),
        read: RefCell::default(),
    })
}

fn numbers(folder: &Path) -> Vec<String> {
    let csv = std::fs::read_to_string(folder.join("out/report.csv")).unwrap();
    csv.lines().filter(|line| !line.contains("ms")).map(str::to_owned).collect()
}

#[test]
fn every_experiment_is_in_the_report_and_an_interrupted_run_ends_with_the_same_numbers() {
    let folder = folder();
    let folder = folder.path();
    reproduce(folder, plan(PLAN).unwrap()).unwrap();
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
    reproduce(folder, plan(PLAN).unwrap()).unwrap();
    assert_eq!(numbers(folder), found);
    assert!(folder.join("out/report.html").is_file());
}

#[test]
fn another_plan_or_a_bad_one_is_refused() {
    let invalid = |from: &str, to: &str, expected: &str| {
        let error = format!("{:#}", plan(&PLAN.replace(from, to)).unwrap_err());
        assert!(error.contains(expected), "{to}: {error}");
    };
    invalid("kept = [8]", "kept = []", "points, kept: expected one count or more");
    invalid("draws = 20", "draws = 0", "mesh_steps, draws: expected 1 or more");
    invalid("draws", "drawings", "unknown field `drawings`");
    invalid("batch = 10", "batch = 1", "`batch`: expected 2 or more clouds");
    let folder = folder();
    let folder = folder.path();
    let refused = |text: &str, expected: &str| {
        let error = format!("{:#}", reproduce(folder, plan(text).unwrap()).unwrap_err());
        assert!(error.contains(expected), "{error}");
    };
    refused(&PLAN.replace("[16, 8]", "[33]"), "expected clouds of 33 points or more, found 32");
    std::fs::create_dir(folder.join("out")).unwrap();
    std::fs::write(folder.join("out/terms.toml"), "version = \"another\"").unwrap();
    refused(PLAN, "an earlier run had another plan or other data");
}

/// Points of a cloud.
const POINTS: usize = 32;

/// Writes a packed set to `path`: clouds `first` to `n` of a ball, a disc and a
/// rod in turns, called `m0_v0`, `m1_v0` and so on. Another seed gives other
/// clouds of the same classes.
fn write_clouds(path: &Path, seed: u64, first: usize, n: usize) {
    let classes = ["ball", "disc", "rod"].map(str::to_owned).to_vec();
    let mut packed = PackedWriter::create(path, POINTS, classes).unwrap();
    for i in first..n {
        let n_raw = 10 + 5 * i as u32;
        packed.push(&cloud(seed, i), i % 3, &format!("m{i}_v0"), n_raw).unwrap();
    }
    packed.finish(Hashing::None).unwrap();
}

fn cloud(seed: u64, i: usize) -> Vec<[f32; 3]> {
    let key = StreamKey::new(seed, "clouds", i as u32);
    let flat = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.05], [1.0, 0.05, 0.05]][i % 3];
    let unit = |n: usize| (2.0 * key.unit(n as u64) - 1.0) as f32;
    (0..POINTS).map(|point| [0, 1, 2].map(|axis| unit(3 * point + axis) * flat[axis])).collect()
}
