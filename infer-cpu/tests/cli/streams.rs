//! File names on standard input: one line for each, at once.

use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;

use crate::program::Folder;

const STREAM: &str = "classify --json --model m.safetensors --threads 1 --files-from -";

#[test]
fn each_name_is_answered_before_the_next_is_written() {
    let folder = Folder::with_cloud(30);
    let mut child =
        folder.command(STREAM).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut names = child.stdin.take().unwrap();
    let mut answers = BufReader::new(child.stdout.take().unwrap()).lines();
    for name in ["c.xyz", "absent.xyz", "c.xyz"] {
        writeln!(names, "{name}").unwrap();
        names.flush().unwrap();
        // This would wait forever for a line that is not flushed.
        let answer: serde_json::Value =
            serde_json::from_str(&answers.next().unwrap().unwrap()).unwrap();
        assert_eq!(answer["file"], name);
        assert_eq!(answer.get("error").is_some(), name == "absent.xyz");
    }
    drop(names);
    assert_eq!(child.wait().unwrap().code(), Some(1), "one of them failed");
}

#[test]
fn a_bad_file_is_one_line_and_the_stream_goes_on() {
    let folder = Folder::with_cloud(30);
    folder.write("text.xyz", "1 2 3\n4 five 6\n");
    folder.write("cut.npy", b"\x93NUMPY\x01\x00");
    folder.write("cut.ply", "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\n");
    folder.write("none.xyz", "");
    folder.write("nan.xyz", "0 0 nan\n");
    folder.write("mesh.off", "OFF\n");
    std::fs::create_dir(folder.path("folder")).unwrap();
    let bad = [
        "text.xyz", "cut.npy", "cut.ply", "none.xyz", "nan.xyz", "mesh.off", "folder", "gone.npz",
        "-",
    ];
    let list = bad.map(|name| format!("{name}\nc.xyz\r\n")).concat();
    let ran = folder.run_with(STREAM, list.as_bytes());
    assert_eq!((ran.code, ran.err.as_str()), (1, ""));
    let answers = ran.json();
    assert_eq!(answers.len(), 2 * bad.len());
    for (answers, bad) in answers.chunks(2).zip(bad) {
        let error = answers[0]["error"].as_str().unwrap();
        assert_eq!(answers[0]["file"], bad);
        assert!(error.starts_with(bad), "{error}");
        assert!(answers[1].get("error").is_none(), "{}", answers[1]);
    }
    // Without --json, errors are on standard error, and only there.
    let ran = folder.run_with(&STREAM.replace(" --json", ""), list.as_bytes());
    assert_eq!((ran.code, ran.out.lines().count(), ran.err.lines().count()), (1, 9, 9));
}

#[test]
fn names_come_from_a_file_too() {
    let folder = Folder::with_cloud(30);
    folder.write("list", "c.xyz\nc.xyz");
    let ran = folder.classify("--files-from list");
    assert_eq!((ran.code, ran.out.lines().count()), (0, 2));
    folder.classify("--files-from absent").assert_refused(1, "error: absent: ");
}

#[test]
fn an_empty_stream_is_a_success() {
    let folder = Folder::new();
    let ran = folder.run_with(STREAM, b"\n\n");
    assert_eq!((ran.code, ran.out.as_str(), ran.err.as_str()), (0, "", ""));
}

#[test]
fn files_named_as_arguments_go_on_as_well() {
    let folder = Folder::with_cloud(30);
    let ran = folder.classify("c.xyz absent.xyz c.xyz");
    assert_eq!((ran.code, ran.out.lines().count()), (1, 2));
    assert!(ran.err.starts_with("error: absent.xyz: "), "{}", ran.err);
}
