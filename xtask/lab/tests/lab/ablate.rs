//! `ablate`, on shapes that take no time.

use crate::{LAB, exits, said, succeeds};
use std::collections::BTreeMap;
use std::path::Path;

const PLAN: &str = r#"
about = "a test"
most_per_class = [2, 1]
flags = "--sensor vlp32c --views 2 --points 64 --min-points 8 --attributes intensity"
seeds = [0, 1]
steps = 4
cost_rounds = 1
cost_meshes = 2
[recipe]
points = 16
batch = 10
validation = 0.0
[recipe.network]
input_transform = false
feature_transform = false
trunk = [8, 16]
head = [12]
[[row]]
name = "reference"
flags = "--noise 0.03 --quantise"
[[row]]
name = "grid"
flags = "--noise 0"
source = "even-grid"
[[row]]
name = "seen"
source = "seen"
[[row]]
name = "surface"
source = "surface"
beside = "seen"
"#;

/// The lines of a CSV file by heading.
fn lines(file: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(file).unwrap();
    let split = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
    let mut lines = text.lines().map(split);
    let heading = lines.next().unwrap();
    lines.map(|line| heading.iter().cloned().zip(line).collect()).collect()
}

#[test]
fn rows_are_compared_and_an_interrupted_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("plan.toml"), PLAN).unwrap();
    let ablate = || succeeds(Path::new(LAB), at, "ablate objects --plan plan.toml --out out");
    let ran = ablate();
    assert!(said(&ran).contains("gain"), "{}", said(&ran));
    let csv = at.join("out/ablations.csv");
    let found = lines(&csv);
    let of = |trained: &str, tested: &str| {
        let is_it = |line: &&BTreeMap<String, String>| {
            line["trained_on"] == trained && line["tested_on"] == tested
        };
        let found: Vec<_> = found.iter().filter(is_it).map(|line| line["of"].as_str()).collect();
        found
    };
    // 10 classes of a mesh from 2 sides, and 2 seeds.
    for (trained, tested) in [
        ("reference", "reference"),
        ("grid", "reference"),
        ("grid", "grid"),
        ("reference", "grid"),
        ("surface", "seen"),
        ("seen", "surface"),
        ("surface", "reference"),
    ] {
        let n = if tested == "surface" { "10" } else { "20" };
        assert_eq!(of(trained, tested), [n, n], "{trained}, {tested}");
    }
    assert!(of("surface", "grid").is_empty());

    // As if it had been killed in a dataset, in a training and in its tests.
    std::fs::remove_file(at.join("out/networks/reference-1.safetensors")).unwrap();
    std::fs::remove_file(at.join("out/answers/reference-1.json")).unwrap();
    std::fs::remove_dir_all(at.join("out/work/data/grid")).unwrap();
    std::fs::remove_file(&csv).unwrap();
    ablate();
    assert_eq!(lines(&csv), found);
}

#[test]
fn what_cannot_be_run_is_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = |name: &str, text: String| std::fs::write(at.join(name), text).unwrap();
    plan("typo.toml", PLAN.replace("steps", "strides"));
    plan("certain.toml", PLAN.replace("--quantise", "--dropout 1.5"));
    let refused = |code, words: &str, expected: &str| {
        let said = exits(code, Path::new(LAB), at, words);
        assert!(said.contains(expected), "{words}: {said}");
        assert!(!at.join("out").exists() && !at.join("data").exists(), "{words}");
    };
    refused(1, "ablate objects --plan typo.toml --out out", "unknown field `strides`");
    refused(2, "ablate objects --plan certain.toml --out out", "certain.toml: row \"reference\"");
    refused(1, "ablate objects --plan nowhere.toml --out out", "cannot read nowhere.toml");
    refused(
        2,
        "ablate objects --meshes nowhere --out out",
        "--meshes: expected a folder, found nowhere",
    );
    std::fs::create_dir(at.join("other")).unwrap();
    std::fs::write(at.join("other/terms.toml"), "version = \"another\"").unwrap();
    let said = exits(1, Path::new(LAB), at, "ablate objects --quick --out other");
    assert!(said.contains("an earlier run had another plan or other data"), "{said}");
}

#[test]
fn effects_of_streets_are_compared_on_simulated_and_on_real_objects() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let row = |name: &str, more: &str| format!("[[row]]\nname = \"{name}\"\n{more}\n");
    let plan = format!(
        "about = \"a test\"\nscenes = 20\nseeds = [0]\nmin_points = 40\nknown = [\"car\"]\n\
         cost_rounds = 1\ncost_scenes = 1\n\
         recipe = {{ epochs = 1, clouds_per_epoch = 128, network = {{ trunk = [8, 16], head = [8] }} }}\n{}{}{}",
        row("none", "sensors = [\"vlp16\"]\nobject.count = [0, 2]"),
        row(
            "driving",
            "sensors = [\"vlp16\"]\nobject.count = [0, 2]\nscene.mount = { speed_m_s = [9, 9] }"
        ),
        row(
            "unturned",
            "sensors = [\"vlp16\"]\nobject.count = [0, 2]\nrecipe = { normalization = \"metric\" }"
        ),
    );
    std::fs::write(at.join("plan.toml"), plan).unwrap();
    let words = "ablate streets --plan plan.toml --out out";
    succeeds(Path::new(LAB), at, words);
    // Simulated clusters stand in for real ones.
    let real = "out/street/scenes/none-0/test.npz";
    std::fs::copy(at.join(real), at.join("real.npz")).unwrap();
    std::fs::remove_dir_all(at.join("out")).unwrap();
    let words = format!("{words} --real real.npz");
    let ran = succeeds(Path::new(LAB), at, &words);
    assert!(said(&ran).contains("driving"), "{}", said(&ran));
    let found = lines(&at.join("out/street/street.csv"));
    let of = |trained: &str, tested: &str| -> Vec<String> {
        let is_it = |line: &&BTreeMap<String, String>| {
            line["trained_on"] == trained && line["tested_on"] == tested
        };
        found.iter().filter(is_it).map(|line| format!("{} {}", line["right"], line["of"])).collect()
    };
    // The stand-ins are the first row's own test scenes.
    for name in ["none", "driving", "unturned"] {
        assert_eq!(of(name, "none"), of(name, "real objects"), "{name}");
        assert_eq!(of(name, "real objects").len(), 2, "car and negatives");
    }
    assert!(!of("none", "driving").is_empty() && !of("driving", "driving").is_empty());
    assert!(!at.join("out/street/scenes/unturned-0").exists(), "the same scenes are made once");
    let table = std::fs::read_to_string(at.join("out/street/street.md")).unwrap();
    assert!(table.contains("| driving |"), "{table}");
    let refused = exits(1, Path::new(LAB), at, "ablate streets --plan plan.toml --out out");
    assert!(refused.contains("an earlier run had another plan or other data"));
}
