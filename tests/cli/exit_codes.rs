//! What the training program ends with is what `edgepuck` ends with.

use crate::{edgepuck, said};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Output;

/// `edgepuck train` with a training program that is this shell script.
fn train(folder: &Path, script: &str) -> Output {
    let program = folder.join("train.sh");
    fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    edgepuck(folder, &["train"]).env("EDGEPUCK_TRAIN", &program).output().unwrap()
}

#[test]
fn exit_codes_of_the_training_program_pass_through() {
    let folder = tempfile::tempdir().unwrap();
    for code in [0, 1, 2, 42] {
        let output = train(folder.path(), &format!("exit {code}"));
        assert_eq!(output.status.code(), Some(code), "{}", said(&output));
    }
}

#[test]
fn a_signal_is_named_and_ends_with_its_shell_s_code() {
    let folder = tempfile::tempdir().unwrap();
    let output = train(folder.path(), "kill -9 $$");
    assert_eq!(output.status.code(), Some(128 + 9), "{}", said(&output));
    assert!(said(&output).contains("signal 9"), "{}", said(&output));
}
