//! The cases of `tests/extremes` that take no mesh, once more: here they also run
//! with a Raspberry Pi's instructions, where the crates that cast rays do not.

#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "../../tests/extremes/classify.rs"]
mod classify;
#[path = "../../tests/extremes/cloud.rs"]
mod cloud;
#[path = "../../tests/extremes/model.rs"]
mod model;
#[path = "../../tests/extremes/sample.rs"]
mod sample;
#[path = "../../tests/extremes/stream.rs"]
mod stream;
#[path = "support/tiny_model.rs"]
mod tiny_model;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// A case; `derivation` is for people, and checked where all cases run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "derivation")]
    _derivation: String,
    #[serde(default)]
    heavy: bool,
    classify: Option<classify::Classify>,
    sample: Option<sample::Sample>,
}

fn files(kind: &str) -> Vec<PathBuf> {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/extremes/cases").join(kind);
    let mut files: Vec<_> = cases.read_dir().unwrap().map(|item| item.unwrap().path()).collect();
    files.sort();
    files
}

fn run_all(kind: &str, check: impl Fn(&File)) {
    let mut failed = Vec::new();
    for path in files(kind) {
        let name = path.display().to_string();
        let file: File = toml::from_str(&std::fs::read_to_string(&path).unwrap())
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        // Heavy ones run in `tests/extremes`, where they are asked for.
        if !file.heavy && catch_unwind(AssertUnwindSafe(|| check(&file))).is_err() {
            failed.push(name);
        }
    }
    assert!(failed.is_empty(), "{failed:#?}");
}

#[test]
#[cfg_attr(target_arch = "aarch64", ignore = "takes many minutes under an emulator")]
fn clouds_and_weights_have_their_outcome() {
    run_all("classify", |file| file.classify.as_ref().unwrap().check());
}

#[test]
fn samplers_keep_what_they_must() {
    run_all("sample", |file| file.sample.as_ref().unwrap().check());
}
