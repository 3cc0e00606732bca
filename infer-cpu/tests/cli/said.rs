//! What commands say in cases that need only a few small files: the tables of `said`.

use crate::program::Folder;
use std::path::Path;
use test_support::said::{assert_parts, play};

/// A message of a failure begins with the first of its parts.
fn check(name: &str, folder: &Folder) {
    let tables = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cli/said");
    let table = tables.join(name).with_extension("txt");
    play(&table, &folder.path("."), |code, words, parts| {
        let ran = folder.run(words);
        if code > 0 {
            ran.assert_refused(code, parts[0]);
        }
        assert_eq!(ran.code, code, "{words}");
        assert_parts(words, &ran.err, parts);
    });
}

#[test]
fn contradictory_flags_are_usage_errors() {
    check("contradictory_flags_are_usage_errors", &Folder::new());
}

#[test]
fn empty_and_infinite_clouds_are_named() {
    check("empty_and_infinite_clouds_are_named", &Folder::new());
}

#[test]
fn failed_sampling_writes_no_file() {
    check("failed_sampling_writes_no_file", &Folder::new());
}

#[cfg(feature = "mcap")]
#[test]
fn live_names_the_inputs_that_it_cannot_use() {
    check("live_names_the_inputs_that_it_cannot_use", &crate::live::folder());
}
