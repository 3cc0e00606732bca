//! `edgepuck` ends with the exit code of the training program.

use crate::{Folder, said};
use std::fs;
use std::os::unix::fs::PermissionsExt;

fn train(script: &str) -> (Option<i32>, String) {
    let folder = Folder::new();
    folder.write("train.sh", format!("#!/bin/sh\n{script}\n"));
    let program = folder.at("train.sh");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    let output = folder.edgepuck("train").env("EDGEPUCK_TRAIN", &program).output().unwrap();
    (output.status.code(), said(&output))
}

#[test]
fn exit_codes_of_the_training_program_pass_through() {
    for code in [0, 1, 2, 42] {
        let (found, said) = train(&format!("exit {code}"));
        assert_eq!(found, Some(code), "{said}");
    }
}

#[test]
fn a_signal_is_named_and_ends_with_its_shell_s_code() {
    let (code, said) = train("kill -9 $$");
    assert_eq!(code, Some(128 + 9), "{said}");
    assert!(said.contains("signal 9"), "{said}");
}
