//! Networks trained on some sets and tested on others.

use super::crossing;
use super::design::{Design, Set};
use super::rows::Answer;
use super::rows::Test;
use crate::study::test_clouds;
use std::path::Path;

/// Two sets of the same shapes; `few` lacks the first three clouds of each half.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (split, seed, n) in [("train", 5, 60), ("test", 6, 30)] {
        for (set, first) in [("plain", 0), ("few", 3)] {
            let path = folder.path().join(format!("sets/{set}-{split}.npz"));
            test_clouds::write(&path, seed, first, n);
        }
    }
    folder
}

fn design() -> Design {
    let recipe = "points = 16\nbatch = 10\nvalidation = 0.0\n[network]\n\
         input_transform = false\nfeature_transform = false\ntrunk = [8, 16]\nhead = [12]\n";
    let set = |name| Set { name, path: Path::new("sets").join(name), matched: true };
    let test = |(trained_on, tested_on)| Test { trained_on, tested_on };
    Design {
        seeds: vec![0, 7],
        steps: 150,
        recipe: toml::from_str(recipe).unwrap(),
        sets: ["plain", "few"].map(set).to_vec(),
        tests: [("plain", "plain"), ("plain", "few"), ("few", "plain")].map(test).to_vec(),
    }
}

#[test]
fn every_network_is_tested_as_designed() {
    let folder = folder();
    let out = folder.path().join("out");
    let found = crossing::run(&design(), folder.path(), &out).unwrap();
    let of =
        |answer: &Answer| format!("{} {} {}", answer.trained_on, answer.tested_on, answer.seed);
    let expected = [
        "few plain 0",
        "plain few 0",
        "plain plain 0",
        "few plain 7",
        "plain few 7",
        "plain plain 7",
    ];
    assert_eq!(found.iter().map(of).collect::<Vec<_>>(), expected);
    for answer in &found {
        // What one set lacks is left out of both; 150 steps of 10 of 57 clouds.
        assert_eq!((answer.n, answer.train_clouds, answer.epochs), (27, 57, 30), "{answer:?}");
        assert!(answer.correct > 16, "{answer:?}");
    }
    // The same clouds under two names make the same network.
    assert_eq!(found[0].correct, found[2].correct);
    let csv = std::fs::read_to_string(out.join("answers.csv")).unwrap();
    assert!(csv.starts_with("trained_on,tested_on,seed,correct,n,train_clouds,epochs\nfew,"));
}

#[test]
fn data_that_are_missing_and_another_design_are_refused() {
    let folder = folder();
    let out = folder.path().join("out");
    let refused = |design: &Design, expected: &str| {
        let error = crossing::run(design, folder.path(), &out).unwrap_err();
        assert!(format!("{error:#}").contains(expected), "{error:#}");
        assert!(!out.join("answers.csv").exists());
    };
    let mut elsewhere = design();
    elsewhere.sets[1].path = "sets/nowhere".into();
    refused(&elsewhere, "sets/nowhere");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(out.join("terms.toml"), "version = \"another\"").unwrap();
    refused(&design(), "an earlier run had another plan or other data");
}
