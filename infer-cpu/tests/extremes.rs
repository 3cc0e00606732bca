//! The sampler cases of `tests/extremes`, which run here with a Raspberry Pi's instructions, too.

#[path = "../../tests/extremes/sample.rs"]
mod sample;

use std::path::Path;

use serde::Deserialize;

/// A case; `tests/extremes` checks that it has a derivation.
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
