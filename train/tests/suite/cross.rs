//! Sets to learn from and to test on, crossed.

use std::path::Path;
use std::process::{Command, Output};

use formats::packed::PackedWriter;
use train::clouds::Clouds;

const DESIGN: &str = r#"
seeds = [0, 7]
steps = 150
[recipe]
points = 16
batch = 10
validation = 0.0
[recipe.network]
input_transform = false
feature_transform = false
trunk = [8, 16]
head = [12]
[[set]]
name = "plain"
path = "sets/plain"
matched = true
[[set]]
name = "few"
path = "sets/few"
matched = true
[[test]]
trained_on = "plain"
tested_on = "plain"
[[test]]
trained_on = "plain"
tested_on = "few"
[[test]]
trained_on = "few"
tested_on = "plain"
"#;

/// Two sets of the same shapes; `few` lacks the first three clouds of each half.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (split, clouds) in [("train", crate::clouds(60)), ("test", crate::test_clouds(30))] {
        let path = |set: &str| folder.path().join(format!("sets/{set}-{split}.npz"));
        write(&path("plain"), &clouds, 0);
        write(&path("few"), &clouds, 3);
    }
    std::fs::write(folder.path().join("design.toml"), DESIGN).unwrap();
    folder
}

fn write(path: &Path, clouds: &Clouds, from: usize) {
    let mut packed = PackedWriter::create(path, 32, clouds.classes.clone()).unwrap();
    for i in from..clouds.len() {
        packed.push(clouds.set.cloud(i), clouds.set.labels[i], &format!("m{i}_v0"), 32).unwrap();
    }
    packed.finish().unwrap();
}

fn cross(folder: &Path, design: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_edgepuck-train"))
        .args(["cross", "--design", design, "--out", "out"])
        .current_dir(folder)
        .output()
        .unwrap()
}

fn answers(folder: &Path) -> String {
    std::fs::read_to_string(folder.join("out/answers.csv")).unwrap()
}

#[test]
fn every_network_is_tested_as_designed_and_an_interrupted_run_ends_with_the_same_answers() {
    let folder = folder();
    let folder = folder.path();
    let ran = cross(folder, "design.toml");
    assert!(ran.status.success(), "{}", String::from_utf8_lossy(&ran.stderr));
    let found = answers(folder);
    let lines: Vec<Vec<&str>> = found.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(
        lines[0],
        ["trained_on", "tested_on", "seed", "correct", "n", "train_clouds", "epochs"]
    );
    let of = |line: &[&str]| line[..3].join(" ");
    let pairs: Vec<String> = lines[1..].iter().map(|line| of(line)).collect();
    assert_eq!(
        pairs,
        [
            "few plain 0",
            "plain few 0",
            "plain plain 0",
            "few plain 7",
            "plain few 7",
            "plain plain 7"
        ]
    );
    for line in &lines[1..] {
        // What one set lacks is left out of both; 150 steps of 10 of 57 clouds.
        assert_eq!(line[4..], ["27", "57", "30"], "{line:?}");
        let correct: usize = line[3].parse().unwrap();
        assert!(correct > 16, "{line:?}");
    }
    // The same clouds under two names make the same network.
    assert_eq!(lines[1][3], lines[3][3]);

    // As if it had been killed in its last training.
    std::fs::remove_file(folder.join("out/networks/plain-seed-7.safetensors")).unwrap();
    std::fs::remove_file(folder.join("out/answers.csv")).unwrap();
    assert!(cross(folder, "design.toml").status.success());
    assert_eq!(answers(folder), found);
}

#[test]
fn another_design_or_a_bad_one_is_refused() {
    let folder = folder();
    let folder = folder.path();
    let refused = |change: [&str; 2], expected: &str| {
        std::fs::write(folder.join("bad.toml"), DESIGN.replace(change[0], change[1])).unwrap();
        let ran = cross(folder, "bad.toml");
        let said = String::from_utf8_lossy(&ran.stderr).into_owned();
        assert!(!ran.status.success() && said.contains(expected), "{change:?}: {said}");
        assert!(!folder.join("out/answers.csv").exists());
    };
    refused(["[0, 7]", "[]"], "bad.toml: seeds: none");
    refused(["[0, 7]", "[7, 7]"], "seeds: one is there twice");
    refused(["tested_on = \"few\"", "tested_on = \"fwe\""], "there is no set \"fwe\"");
    refused(["name = \"few\"", "name = \"../few\""], "names no file");
    refused(["sets/few", "sets/nowhere"], "sets/nowhere");
    refused(["batch = 10", "batch = 1"], "`batch`: a batch norm");
    refused(["steps", "stairs"], "unknown field `stairs`");
    std::fs::create_dir_all(folder.join("out")).unwrap();
    std::fs::write(folder.join("out/terms.toml"), "version = \"another\"").unwrap();
    refused(["steps = 150", "steps = 10"], "an earlier run had another plan or other data");
}
