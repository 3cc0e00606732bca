//! The paper's experiments on shapes that take no time.

use super::context::{ExperimentContext, Plan};
use super::run_all;
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
[recipe]
epochs = 2
batch = 10
[recipe.network]
input_transform = false
feature_transform = false
trunk = [8, 16]
head = [12]
"#;

const SETS: [&str; 7] = [
    "surfaces/surface",
    "static/packed/static-clean",
    "static/packed/static-noisy",
    "blainder/packed/rotational-clean",
    "blainder/packed/rotational-noisy",
    "vlp32c/packed/rotational-clean",
    "vlp32c/packed/rotational-noisy",
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

fn reproduce(folder: &Path, plan: Plan) -> anyhow::Result<String> {
    let context = ExperimentContext {
        plan,
        clouds: folder.join("surfaces/surface"),
        scans: folder.to_owned(),
        out: folder.join("out"),
        read: RefCell::default(),
    };
    run_all(&context)?;
    Ok(std::fs::read_to_string(folder.join("out/report.md")).unwrap())
}

#[test]
fn every_experiment_is_in_the_report_and_an_interrupted_run_ends_with_the_same_numbers() {
    let folder = folder();
    let folder = folder.path();
    let found = reproduce(folder, Plan::parse(PLAN).unwrap()).unwrap();
    let tables: Vec<&str> = found.split("## ").skip(1).collect();
    // Each has two lines of heading; clouds of 32 points are not tested at 64.
    let rows = tables.iter().map(|table| table.matches("\n|").count() - 2);
    assert_eq!(rows.collect::<Vec<_>>(), [2, 1, 3, 7, 11], "{found}");
    // These shapes are told apart in training and in tests, of one set.
    let line = tables[3].lines().find(|line| line.starts_with("| static clean")).unwrap();
    let cell = line.split('|').nth(3).unwrap().trim();
    let accuracy: f64 = cell.split(' ').next().unwrap().parse().unwrap();
    assert!(accuracy > 60.0, "{line}");

    // As if it had been killed while it trained.
    let models = folder.join("out/models");
    std::fs::remove_file(models.join("cpl-3-8-16-8.safetensors")).unwrap();
    assert_eq!(reproduce(folder, Plan::parse(PLAN).unwrap()).unwrap(), found);
    // As if they had been trained elsewhere.
    assert!(found.contains("| random-8 | edgepuck train, seed 0 |"), "{found}");
    for elsewhere in ["random-8", "cpl-3-8-16-8"] {
        std::fs::remove_dir_all(models.join(format!("{elsewhere}.run"))).unwrap();
    }
    assert_eq!(reproduce(folder, Plan::parse(PLAN).unwrap()).unwrap(), found);

    let [one, other] = ["random-16", "random-8"].map(|n| models.join(format!("{n}.safetensors")));
    std::fs::copy(one, other).unwrap();
    let error = reproduce(folder, Plan::parse(PLAN).unwrap()).unwrap_err().to_string();
    let expected = "expected a training set, points and classes (Some(\"random-8\"), Some(8), ";
    assert!(error.contains(expected), "{error}");
}

#[test]
fn the_rate_falls_after_as_many_steps_whatever_the_epochs() {
    use super::experiments::stretched;
    use train::recipe::Schedule;
    let step = |every| Schedule::Step { every, factor: 0.7 };
    assert_eq!(stretched(step(20), 819.0 / 200.0), step(82));
    assert_eq!(stretched(step(20), 0.03), step(1));
    let cosine = |warm_up| Schedule::Cosine { warm_up, last: 0.01 };
    assert_eq!(stretched(cosine(2.0), 1.5), cosine(3.0));
}

#[test]
fn another_plan_or_a_bad_one_is_refused() {
    let invalid = |from: &str, to: &str, expected: &str| {
        let error = format!("{:#}", Plan::parse(&PLAN.replace(from, to)).unwrap_err());
        assert!(error.contains(expected), "{to}: {error}");
    };
    invalid("kept = [8]", "kept = []", "points, kept: expected one count or more");
    invalid("mesh_steps = 150", "mesh_steps = 0", "mesh_steps: expected 1 or more");
    invalid("kept", "keep", "unknown field `keep`");
    invalid("batch = 10", "batch = 1", "`batch`: expected 2 or more clouds");
    let folder = folder();
    let folder = folder.path();
    let refused = |text: &str, expected: &str| {
        let error = format!("{:#}", reproduce(folder, Plan::parse(text).unwrap()).unwrap_err());
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
