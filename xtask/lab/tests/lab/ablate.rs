//! `ablate`: what each effect is worth, on shapes that take no time.

use crate::{LAB, exits, run, said};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::Output;

const PLAN: &str = r#"
about = "a test"
most_per_class = [2, 1]
views = 2
dropout = 0.1
packed_points = 64
min_points = 8
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
"#;

fn ablate(folder: &Path) -> Output {
    run(Path::new(LAB), folder, "ablate --plan plan.toml --out out")
}

/// The lines of a CSV file by heading.
fn lines(file: &Path) -> Vec<BTreeMap<String, String>> {
    let text = std::fs::read_to_string(file).unwrap();
    let split = |line: &str| -> Vec<String> { line.split(',').map(str::to_owned).collect() };
    let mut lines = text.lines().map(split);
    let heading = lines.next().unwrap();
    lines.map(|line| heading.iter().cloned().zip(line).collect()).collect()
}

/// All but what the clock says.
fn timeless(file: &Path) -> Vec<BTreeMap<String, String>> {
    let mut lines = lines(file);
    lines.iter_mut().for_each(|line| line.retain(|key, _| !key.starts_with("scan_seconds")));
    lines
}

#[test]
fn every_effect_has_its_lines_and_an_interrupted_run_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("plan.toml"), PLAN).unwrap();
    let ran = ablate(at);
    assert!(ran.status.success(), "{}", said(&ran));
    let csv = at.join("out/ablations.csv");
    let found = lines(&csv);
    for (effect, expected) in [
        ("noise", 8),
        ("noise-model", 8),
        ("dropout", 8),
        ("quantum", 8),
        ("beams", 8),
        ("all-of-these", 8),
        // Tested on the reference's scans besides.
        ("occlusion", 12),
        ("intensity", 2),
        ("time", 2),
    ] {
        let n = found.iter().filter(|line| line["effect"] == effect).count();
        assert_eq!(n, expected, "{effect}");
    }
    let number = |line: &BTreeMap<String, String>, key: &str| line[key].parse::<f64>().unwrap();
    for line in &found {
        assert!(number(line, "scan_seconds_cpu") > 0.0 && number(line, "n") > 0.0, "{line:?}");
        if line["judged_by"] == "networks" {
            let [low, high] = ["accuracy_low", "accuracy_high"].map(|key| number(line, key));
            let accuracy = number(line, "accuracy");
            assert!(0.0 <= low && low <= accuracy && accuracy <= high && high <= 1.0, "{line:?}");
        } else {
            // 10 classes of 3 meshes, from 2 sides: no position differs.
            assert_eq!((line["n"].as_str(), line["accuracy"].as_str()), ("60", ""), "{line:?}");
        }
    }
    // An attribute of 4 bytes a point is paid for, and nothing else.
    let bytes = |effect: &str, trained_on: &str| {
        let is_it = |l: &&BTreeMap<_, _>| l["effect"] == effect && l["trained_on"] == trained_on;
        number(found.iter().find(is_it).unwrap(), "bytes_per_cloud")
    };
    assert!(bytes("intensity", "with") > bytes("intensity", "without"));
    assert_eq!(bytes("noise", "with"), bytes("noise", "without"));
    assert!(said(&ran).contains("gain"), "{}", said(&ran));

    // As if it had been killed before the end, in a dataset and in a training.
    let networks = at.join("out/work/trained/networks");
    std::fs::remove_file(networks.join("reference-seed-1.safetensors")).unwrap();
    std::fs::remove_dir_all(at.join("out/work/data/grid")).unwrap();
    let first = timeless(&csv);
    std::fs::remove_file(&csv).unwrap();
    let again = ablate(at);
    assert!(again.status.success(), "{}", said(&again));
    assert_eq!(timeless(&csv), first);
}

#[test]
fn what_cannot_be_run_is_refused_before_anything_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let plan = |name: &str, text: String| std::fs::write(at.join(name), text).unwrap();
    plan("typo.toml", PLAN.replace("views", "sides"));
    plan("certain.toml", PLAN.replace("dropout = 0.1", "dropout = 1.0"));
    let refused = |code, words: &str, expected: &str| {
        let said = exits(code, Path::new(LAB), at, words);
        assert!(said.contains(expected), "{words}: {said}");
        assert!(!at.join("out").exists() && !at.join("data").exists(), "{words}");
    };
    refused(1, "ablate --plan typo.toml --out out", "unknown field `sides`");
    refused(1, "ablate --plan certain.toml --out out", "certain.toml: dropout");
    refused(1, "ablate --plan nowhere.toml --out out", "cannot read nowhere.toml");
    refused(2, "ablate --meshes nowhere --out out", "--meshes: expected a folder, found nowhere");
    std::fs::create_dir(at.join("other")).unwrap();
    std::fs::write(at.join("other/terms.toml"), "version = \"another\"").unwrap();
    let said = exits(1, Path::new(LAB), at, "ablate --quick --out other");
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
    let words = "ablate --street --plan plan.toml --out out";
    let ran = run(Path::new(LAB), at, words);
    assert!(ran.status.success(), "{}", said(&ran));
    // Simulated clusters stand in for real ones.
    let real = "out/street/scenes/none-0/test.npz";
    std::fs::copy(at.join(real), at.join("real.npz")).unwrap();
    std::fs::remove_dir_all(at.join("out")).unwrap();
    let words = format!("{words} --real real.npz");
    let ran = run(Path::new(LAB), at, &words);
    assert!(ran.status.success() && said(&ran).contains("driving"), "{}", said(&ran));
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
    let again = run(Path::new(LAB), at, "ablate --street --plan plan.toml --out out");
    assert!(said(&again).contains("an earlier run had another plan or other data"));
}
