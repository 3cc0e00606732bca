use std::path::Path;
use std::process::{Command, Output};

use formats::hash::Hashing;
use formats::packed::PackedWriter;

pub fn train(folder: &Path, words: &str) -> Output {
    let program = Command::new(env!("CARGO_BIN_EXE_edgepuck-train"))
        .args(words.split_whitespace())
        .current_dir(folder)
        .output();
    program.unwrap()
}

pub fn stderr(output: &Output) -> String {
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
    packed.finish(Hashing::None).unwrap();
}

#[test]
fn a_run_leaves_a_model_and_a_folder() {
    let folder = folder();
    let ran = train(folder.path(), "train --data . --recipe small.toml --out m.safetensors");
    assert!(ran.status.success(), "{}", stderr(&ran));
    let answer = String::from_utf8_lossy(&ran.stdout).into_owned();
    assert!(answer.contains(" of 30 (") && answer.contains("95 % interval"), "{answer}");
    let run = folder.path().join("m.run");
    let metrics = std::fs::read_to_string(run.join("metrics.csv")).unwrap();
    assert_eq!(metrics.lines().count(), 3);
    assert!(std::fs::read_to_string(run.join("curve.svg")).unwrap().contains("<polyline"));
    assert!(run.join("recipe.toml").is_file());
    // The same again does nothing but read the test half once more.
    let again = train(folder.path(), "train --data . --recipe small.toml --out m.safetensors");
    assert!(stderr(&again).contains("resuming after epoch 2 of 2"), "{}", stderr(&again));
    let csv = "eval --model m.safetensors --data test.npz --csv c.csv --svg c.svg";
    let measured = train(folder.path(), csv);
    assert!(measured.status.success(), "{}", stderr(&measured));
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
        (
            "--data missing.npz",
            "missing.npz: expected clouds of every class, found none of 1 (disc)",
        ),
        ("--data one.npz", "one.npz: expected two classes or more, found one"),
        ("--data few.npz", "few.npz: expected a batch of 10 clouds to learn from, found 9"),
        ("--data nowhere", "nowhere: expected a packed NPZ"),
        ("--data . --points 33", ".: expected clouds of 33 points or more, found 32"),
        ("--data . --recipe bad.toml", "unknown field `epoch`"),
        ("--data . --recipe zero.toml", "`epochs`: expected 1 or more"),
        ("--data . --keep 9", "--front and --keep need --arch cpl"),
        ("--data . --arch cpl --keep 33", "`cpl.keep`: expected 1 to `points`"),
        ("--data . --arch cpl --front 64-128", "expected widths such as 3-64-128-1024"),
    ] {
        let recipe = if words.contains("--recipe") { "" } else { "--recipe small.toml" };
        let ran = train(folder.path(), &format!("train {recipe} {words} --out m.safetensors"));
        assert!(
            !ran.status.success() && stderr(&ran).contains(expected),
            "{words}: {}",
            stderr(&ran)
        );
        assert!(!folder.path().join("m.safetensors").exists());
    }
}

#[test]
fn a_wrong_command_line_gives_2_and_a_failure_1() {
    let folder = folder();
    for (words, code) in [
        ("train --recipe small.toml --data . --keep 9 --out m.safetensors", 2),
        ("train --recipe small.toml --data . --arch dgcnn --out m.safetensors", 2),
        ("train --recipe small.toml --data nowhere --out m.safetensors", 1),
        ("explain --model m.safetensors --cloud c.xyz --points 0", 2),
        ("explain --model m.safetensors --cloud nowhere.xyz", 1),
        ("compare-points nowhere.xyz nowhere.xyz", 1),
        ("--version", 0),
    ] {
        let ran = train(folder.path(), words);
        assert_eq!(ran.status.code(), Some(code), "{words}: {}", stderr(&ran));
    }
    let version = train(folder.path(), "--version").stdout;
    let expected = concat!("edgepuck-train ", env!("CARGO_PKG_VERSION"), "\n");
    assert_eq!(String::from_utf8(version).unwrap(), expected);
}
