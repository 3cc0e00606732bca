use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use formats::rng::StreamKey;

use super::folder;

fn run(folder: &Path, out: &str) -> std::process::Child {
    Command::new(env!("CARGO_BIN_EXE_edgepuck"))
        .args(["train", "--data", ".", "--recipe", "small.toml", "--epochs", "40", "--out", out])
        .current_dir(folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// The metrics of each epoch, without its duration.
fn curve(folder: &Path, out: &str) -> Vec<String> {
    let csv = std::fs::read_to_string(folder.join(out).join("metrics.csv")).unwrap();
    let without_time = |line: &str| line.splitn(7, ',').take(6).collect::<Vec<_>>().join(",");
    csv.lines().map(without_time).collect()
}

#[test]
fn a_run_that_is_killed_again_and_again_ends_with_the_same_bytes_and_curve() {
    let folder = folder();
    let folder = folder.path();
    assert!(run(folder, "whole.safetensors").wait().unwrap().success());
    let key = StreamKey::new(3, "kills", 0);
    let mut kills = 0;
    for attempt in 0..12 {
        let mut broken = run(folder, "broken.safetensors");
        let wait = 2.0 + 120.0 * key.unit(attempt);
        std::thread::sleep(Duration::from_micros((1e3 * wait) as u64));
        // SIGKILL; one that has finished cannot be killed any more.
        broken.kill().unwrap();
        kills += usize::from(broken.wait().unwrap().signal() == Some(9));
    }
    assert!(kills > 0, "all runs ended before they were killed");
    // If no run has written a checkpoint, one is left to do so; the last run resumes it.
    while !folder.join("broken.run/checkpoint.safetensors").exists() {
        let mut broken = run(folder, "broken.safetensors");
        std::thread::sleep(Duration::from_millis(500));
        broken.kill().unwrap();
        broken.wait().unwrap();
    }
    assert!(run(folder, "broken.safetensors").wait().unwrap().success());
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert_eq!(bytes("broken.safetensors"), bytes("whole.safetensors"));
    assert_eq!(curve(folder, "broken.run"), curve(folder, "whole.run"));
    for name in ["", "broken.run"] {
        for entry in std::fs::read_dir(folder.join(name)).unwrap() {
            let name = entry.unwrap().file_name().to_string_lossy().into_owned();
            assert!(!name.starts_with('.') && !name.ends_with(".tmp"), "{name}");
        }
    }
}
