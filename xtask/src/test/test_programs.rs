use crate::summary::{Counts, Summary};
use anyhow::Context;
use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use test_support::SKIPPED_TESTS;
use xtask::workspace::{root, words};

/// Runs `cargo`, which is `cargo test` or a test program, prints its output, and counts its tests.
pub fn run(summary: &mut Summary, cargo: &mut Command) -> anyhow::Result<Counts> {
    let skipped_tests = root().join("target/skipped-tests.txt");
    fs::create_dir_all(root().join("target"))?;
    fs::write(&skipped_tests, "").with_context(|| skipped_tests.display().to_string())?;
    let shown = words(cargo);
    eprintln!("== {shown}");
    cargo.env(SKIPPED_TESTS, &skipped_tests).stdout(Stdio::piped());
    let mut child = cargo.spawn().with_context(|| format!("cannot run {shown}"))?;
    let mut counts = Counts::default();
    if let Some(output) = child.stdout.take() {
        for line in BufReader::new(output).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            counts = counts.and(Counts::of_closing_line(&line).unwrap_or_default());
        }
    }
    let status = child.wait()?;
    let skipped = fs::read_to_string(&skipped_tests)?;
    for line in skipped.lines() {
        summary.remark(line.to_owned());
    }
    counts = counts.of_which_skipped(skipped.lines().count() as u64);
    if !status.success() && counts.failed == 0 {
        summary.remark(format!("FAILED ({status}) without a failing test: {shown}"));
        counts = counts.and(Counts::FAILED);
    }
    Ok(counts)
}
