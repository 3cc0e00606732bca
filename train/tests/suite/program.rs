//! The program, as a user starts it.

use std::path::Path;
use std::process::{Command, Output};

use formats::packed::PackedWriter;

fn train(folder: &Path, words: &str) -> Output {
    let program = Command::new(env!("CARGO_BIN_EXE_edgepuck-train"))
        .args(words.split_whitespace())
        .current_dir(folder)
        .output();
    program.unwrap()
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A folder with `train.npz`, `test.npz` and a recipe for a small network.
pub fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (name, n) in [("train", 60), ("test", 30)] {
        write(&folder.path().join(format!("{name}.npz")), &crate::clouds(n));
    }
    let recipe = "points = 32\nbatch = 10\nepochs = 2\n\
         [network]\ntrunk = [8, 16]\nt_net = [8, 12]\nt_net_head = [8]\nhead = [12]\n";
    std::fs::write(folder.path().join("small.toml"), recipe).unwrap();
    folder
}

fn write(path: &Path, clouds: &train::clouds::Clouds) {
    let mut packed = PackedWriter::create(path, 32, clouds.classes.clone()).unwrap();
    for i in 0..clouds.len() {
        let name = format!("{}_{i:04}", clouds.classes[clouds.set.labels[i]]);
        packed.push(clouds.set.cloud(i), clouds.set.labels[i], &name, 32).unwrap();
    }
    packed.finish().unwrap();
}

#[test]
fn a_run_leaves_a_model_and_a_folder() {
    let folder = folder();
    let ran = train(folder.path(), "train --data . --recipe small.toml --out m.safetensors");
    assert!(ran.status.success(), "{}", said(&ran));
    let answer = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(answer.contains(" of 30 (") && answer.contains("95 % interval"), "{answer}");
    let run = folder.path().join("m.run");
    let metrics = std::fs::read_to_string(run.join("metrics.csv")).unwrap();
    assert_eq!(metrics.lines().count(), 3);
    assert!(std::fs::read_to_string(run.join("curve.svg")).unwrap().contains("<polyline"));
    assert!(run.join("recipe.toml").is_file());
    // The same again does nothing but read the test half once more.
    let again = train(folder.path(), "train --data . --recipe small.toml --out m.safetensors");
    assert!(said(&again).contains("going on after epoch 2 of 2"), "{}", said(&again));
    let csv = "eval --model m.safetensors --data test.npz --csv c.csv --svg c.svg";
    let measured = train(folder.path(), csv);
    assert!(measured.status.success(), "{}", said(&measured));
    assert_eq!(std::fs::read_to_string(folder.path().join("c.csv")).unwrap().lines().count(), 4);
}

#[test]
fn what_cannot_be_learnt_from_is_an_error_that_names_it() {
    let folder = folder();
    let npz = |name: &str, clouds: &train::clouds::Clouds| write(&folder.path().join(name), clouds);
    let mut broken = crate::clouds(12);
    broken.set.points[7 * 96 + 5] = f32::NAN;
    npz("nan.npz", &broken);
    let mut one = crate::clouds(12);
    one.set.labels.fill(0);
    npz("missing.npz", &one);
    one.classes.truncate(1);
    npz("one.npz", &one);
    npz("few.npz", &crate::clouds(9));
    std::fs::write(folder.path().join("bad.toml"), "epoch = 3").unwrap();
    std::fs::write(folder.path().join("zero.toml"), "epochs = 0").unwrap();
    for (words, expected) in [
        ("--data nan.npz", "point 1 of cloud 7 (disc_0007) is not finite"),
        ("--data missing.npz", "missing.npz: no cloud of class 1 (disc) to learn from"),
        ("--data one.npz", "one.npz: one class only"),
        ("--data few.npz", "fewer than a batch of 10"),
        ("--data nowhere", "nowhere: neither a packed NPZ"),
        ("--data . --points 33", "clouds of 32 points; the recipe wants 33"),
        ("--data . --recipe bad.toml", "unknown field `epoch`"),
        ("--data . --recipe zero.toml", "`epochs`: at least 1"),
        ("--data . --keep 9", "--front and --keep are for --arch cpl"),
        ("--data . --arch cpl --keep 33", "`cpl.keep`: between 1 and `points`"),
        ("--data . --arch cpl --front 64-128", "widths like 3-64-128-1024 are meant"),
    ] {
        let recipe = if words.contains("--recipe") { "" } else { "--recipe small.toml" };
        let ran = train(folder.path(), &format!("train {recipe} {words} --out m.safetensors"));
        assert!(!ran.status.success() && said(&ran).contains(expected), "{words}: {}", said(&ran));
        assert!(!folder.path().join("m.safetensors").exists());
    }
}
