//! Feeds mutated input to each hand-written parser.

use super::meanwhile::{Meanwhile, nice};
use crate::summary::{Counts, Summary};
use anyhow::ensure;
use std::fs;
use std::process::Command;
use std::thread::available_parallelism;
use xtask::workspace::{cargo, root};

const FOLDER: &str = "tests/fuzz";
const TARGETS: [&str; 9] =
    ["off", "mesh", "gltf", "urdf", "clouds", "model", "packets", "captures", "live"];

/// The target is named, so that build scripts are compiled without the flags below.
const TRIPLE: &str = "x86_64-unknown-linux-gnu";

/// The flags of the stable compiler that instrument code for libFuzzer.
const COVERAGE: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
     -Cllvm-args=-sanitizer-coverage-pc-table \
     -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";

pub fn build_meanwhile(seconds: u32) -> Option<anyhow::Result<Meanwhile>> {
    let is_known = cfg!(all(target_os = "linux", target_arch = "x86_64"));
    (seconds > 0 && is_known).then(|| {
        let mut build = cargo(&["build", "--release", "--target", TRIPLE, "--bins"]);
        build.current_dir(root().join(FOLDER)).env("RUSTFLAGS", COVERAGE);
        Meanwhile::start("fuzz-build", &mut nice(&build))
    })
}

/// Fuzzes every target for `seconds`, one per core at a time.
pub fn run(summary: &mut Summary, seconds: u32, build: Option<anyhow::Result<Meanwhile>>) {
    summary.step("fuzzing", |summary| {
        let Some(build) = build else {
            let reason = "it needs x86-64 Linux and --fuzz-seconds above 0";
            return Ok(summary.skip("fuzzing", TARGETS.len(), reason));
        };
        let (built, log) = build?.end()?;
        ensure!(built.success(), "the targets cannot be built: {log}");
        let mut counts = Counts::default();
        for targets in TARGETS.chunks(available_parallelism()?.get()) {
            let started = targets.iter().map(|target| start(target, seconds));
            let started = started.collect::<anyhow::Result<Vec<_>>>()?;
            for (target, fuzzer) in targets.iter().zip(started) {
                let (status, log) = fuzzer.end()?;
                counts = counts.and(if status.success() {
                    Counts::PASSED
                } else {
                    eprintln!("{log}");
                    summary.remark(format!("fuzzing {target}: FAILED"));
                    Counts::FAILED
                });
            }
        }
        Ok(counts)
    });
}

fn start(target: &str, seconds: u32) -> anyhow::Result<Meanwhile> {
    let folder = root().join(FOLDER);
    let mut command = Command::new(folder.join(format!("target/{TRIPLE}/release/{target}")));
    command.arg(format!("-max_total_time={seconds}")).current_dir(&folder);
    // libFuzzer starts with both folders, and writes new inputs to the first.
    if folder.join("seeds").join(target).is_dir() {
        fs::create_dir_all(folder.join("corpus").join(target))?;
        command.args([format!("corpus/{target}"), format!("seeds/{target}")]);
    }
    eprintln!("== fuzzing {target} for {seconds} s");
    Meanwhile::start(&format!("fuzz-{target}"), &mut command)
}
