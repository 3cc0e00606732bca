//! What the program refuses, and how. What it publishes, `tests/peers/ros2.py` receives.

#![expect(clippy::unwrap_used, reason = "tests")]

use std::io::Write;
use std::process::{Command, Stdio};

/// The exit code, and what the program says, when it is given `input`.
fn run(flags: &[&str], input: &[u8]) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_edgepuck-ros2"));
    command.args(flags).env_remove("ROS_DOMAIN_ID").stdin(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A program that refuses its flags reads nothing.
    let _ = child.stdin.take().unwrap().write_all(input);
    let output = child.wait_with_output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn flags_that_no_node_can_have_are_refused() {
    let (code, err) = run(&["--node", "a b"], b"");
    let expected = "error: --node: expected letters, digits and _, found \"a b\"\n";
    assert_eq!((code, err.as_str()), (Some(2), expected));
    let (code, err) = run(&["--domain", "233"], b"");
    assert_eq!(code, Some(2));
    assert!(err.starts_with("error: invalid value '233' for '--domain <N>'"), "{err}");
}

#[test]
fn input_that_is_no_objects_is_named() {
    let (code, err) = run(&["--domain", "231"], b"hello\n");
    assert_eq!(code, Some(1));
    assert!(err.starts_with("error: standard input: line 1: expected value"), "{err}");
    assert_eq!(run(&["--domain", "231"], b""), (Some(0), String::new()));
}
