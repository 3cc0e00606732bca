//! `train`, `eval` and `explain`.

mod clusters;
#[cfg(unix)]
mod killed;

use formats::cloud::normalize_unit_sphere;
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use formats::rng::StreamKey;
use std::path::Path;
use std::process::{Command, Output};

const CLASSES: [&str; 3] = ["ball", "disc", "rod"];

/// The points of a cloud, and its class.
type Labelled = (Vec<[f32; 3]>, usize);

pub fn train(folder: &Path, words: &str) -> Output {
    let program = Command::new(env!("CARGO_BIN_EXE_edgepuck"))
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
        write(&folder.path().join(format!("{name}.npz")), &clouds(n), &CLASSES);
    }
    let recipe = "points = 32\nbatch = 10\nepochs = 2\n\
         [network]\ntrunk = [8, 16]\nhead = [12]\n";
    std::fs::write(folder.path().join("small.toml"), recipe).unwrap();
    folder
}

/// `n` clouds of 32 points: balls, discs and rods.
fn clouds(n: usize) -> Vec<Labelled> {
    let cloud = |number: usize| {
        let key = StreamKey::new(5, "clouds", number as u32);
        let flat = [[1.0, 1.0, 1.0], [1.0, 1.0, 0.05], [1.0, 0.05, 0.05]][number % 3];
        let unit = |point: usize, axis: usize| 2.0 * key.unit((3 * point + axis) as u64) - 1.0;
        let point = |point| [0, 1, 2].map(|axis| unit(point, axis) as f32 * flat[axis]);
        ((0..32).map(point).collect(), number % 3)
    };
    (0..n).map(cloud).collect()
}

fn write(path: &Path, clouds: &[Labelled], classes: &[&str]) {
    let classes: Vec<String> = classes.iter().map(|&class| class.to_owned()).collect();
    let mut packed = PackedWriter::create(path, 32, classes).unwrap();
    for (i, (points, class)) in clouds.iter().enumerate() {
        packed.push(points, *class, &format!("{}_{i:04}", CLASSES[i % 3]), 32).unwrap();
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
    assert!(run.join("recipe.toml").is_file());
    // The same command again only reads the test part once more.
    let again = train(folder.path(), "train --data . --recipe small.toml --out m.safetensors");
    assert!(stderr(&again).contains("resuming after epoch 2 of 2"), "{}", stderr(&again));
    let checkpoint = || std::fs::read(run.join("checkpoint.safetensors")).unwrap();
    let finished = checkpoint();
    for wrong in ["--data nowhere", "--data . --points 33", "--data . --init nowhere"] {
        let words = format!("train {wrong} --recipe small.toml --out m.safetensors --overwrite");
        assert!(!train(folder.path(), &words).status.success(), "{wrong}");
        assert!(checkpoint() == finished, "{wrong}");
    }
    let words = "train --data . --recipe small.toml --out m.safetensors --overwrite";
    let again = train(folder.path(), words);
    assert!(again.status.success() && !stderr(&again).contains("resuming"), "{}", stderr(&again));
    let csv = "eval --model m.safetensors --data test.npz --csv c.csv";
    let measured = train(folder.path(), csv);
    assert!(measured.status.success(), "{}", stderr(&measured));
    assert_eq!(std::fs::read_to_string(folder.path().join("c.csv")).unwrap().lines().count(), 4);
    // Classes in another order are those of their names.
    let mut turned = CLASSES.to_vec();
    turned.reverse();
    let uneven = || clouds(30).split_off(1);
    let mut of_names = uneven();
    of_names.iter_mut().for_each(|(_, label)| *label = CLASSES.len() - 1 - *label);
    write(&folder.path().join("turned.npz"), &of_names, &turned);
    write(&folder.path().join("same.npz"), &uneven(), &CLASSES);
    let [of_turned, of_same] = ["turned", "same"].map(|name| {
        let words = format!("eval --model m.safetensors --data {name}.npz --csv {name}.csv");
        let ran = train(folder.path(), &words);
        let csv = std::fs::read_to_string(folder.path().join(format!("{name}.csv"))).unwrap();
        String::from_utf8_lossy(&ran.stdout).replace(name, "") + &csv
    });
    assert_eq!(of_turned, of_same);
    // Data without names may lack the last classes.
    let mut without_last = clouds(30);
    without_last.retain(|(_, label)| *label < 2);
    write(&folder.path().join("unnamed.npz"), &without_last, &["class 0", "class 1"]);
    let ran = train(folder.path(), "eval --model m.safetensors --data unnamed.npz");
    let found = String::from_utf8_lossy(&ran.stdout);
    assert!(found.contains(" of 20 ("), "{found}{}", stderr(&ran));
}

#[test]
fn unsuited_data_and_recipes_are_errors_that_name_them() {
    let folder = folder();
    let npz = |name: &str, clouds: &[Labelled], classes: &[&str]| {
        write(&folder.path().join(name), clouds, classes);
    };
    let mut broken = clouds(12);
    broken[7].0[1][2] = f32::NAN;
    npz("nan.npz", &broken, &CLASSES);
    let mut in_one_place = clouds(12);
    in_one_place[8].0 = vec![[1.0, 2.0, 3.0]; 32];
    npz("place.npz", &in_one_place, &CLASSES);
    let mut on_a_map = clouds(12);
    on_a_map[3].0.iter_mut().for_each(|point| point[1] += 4.4e6);
    npz("map.npz", &on_a_map, &CLASSES);
    let of_one = clouds(12).into_iter().map(|(points, _)| (points, 0)).collect::<Vec<_>>();
    npz("missing.npz", &of_one, &CLASSES);
    npz("one.npz", &of_one, &CLASSES[..1]);
    npz("few.npz", &clouds(9), &CLASSES);
    npz("empty.npz", &[], &CLASSES);
    npz("twice.npz", &clouds(12), &["ball", "disc", "ball"]);
    let mut in_sphere = clouds(12);
    in_sphere.iter_mut().for_each(|(points, _)| normalize_unit_sphere(points));
    npz("sphere.npz", &in_sphere, &CLASSES);
    std::fs::create_dir_all(folder.path().join("set/packed")).unwrap();
    npz("set/packed/a-train.npz", &clouds(9), &CLASSES);
    npz("set/packed/b-train.npz", &clouds(9), &CLASSES);
    let table = crate::in_repository("tests/cli/training/refused.txt");
    test_support::said::play(&table, folder.path(), |code, words, parts| {
        let ran = train(folder.path(), words);
        assert_eq!(ran.status.code(), Some(code), "{words}: {}", stderr(&ran));
        test_support::said::assert_parts(words, &stderr(&ran), parts);
    });
}

#[test]
fn a_second_run_in_a_folder_is_refused() {
    let folder = folder();
    let words = "train --data . --recipe small.toml --out m.safetensors --overwrite";
    std::fs::create_dir(folder.path().join("m.run")).unwrap();
    let lock = std::fs::File::create(folder.path().join("m.run/lock")).unwrap();
    lock.lock().unwrap();
    let ran = train(folder.path(), words);
    let expected = "m.run: expected the folder of a run that no other process trains";
    assert!(!ran.status.success() && stderr(&ran).contains(expected), "{}", stderr(&ran));
    assert_eq!(std::fs::read_dir(folder.path().join("m.run")).unwrap().count(), 1);
    drop(lock);
    let ran = train(folder.path(), words);
    assert!(ran.status.success(), "{}", stderr(&ran));
}
