//! The cases of `tests/extremes` that are about samplers, once more: here they
//! also run with a Raspberry Pi's instructions, where the crates that cast rays
//! do not.

#[path = "../../tests/extremes/sample.rs"]
mod sample;

use std::path::Path;

use serde::Deserialize;

/// A case; `derivation` is for people, and checked where all cases run.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "derivation")]
    _derivation: String,
    sample: sample::Sample,
}

#[test]
fn samplers_keep_what_they_must() {
    let cases = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/extremes/cases/sample");
    for case in cases.read_dir().unwrap() {
        let path = case.unwrap().path();
        println!("{}", path.display());
        let file: File = toml::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        file.sample.check();
    }
}
