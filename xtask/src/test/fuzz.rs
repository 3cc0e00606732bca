//! Feeds each hand-written parser with mutated input for a while.

use crate::summary::{Counts, Summary};
use anyhow::{Context, bail};
use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, Command};
use std::thread::available_parallelism;
use xtask::workspace::{cargo, root};

/// The targets, a program each.
const TARGETS: [&str; 6] = ["off", "mesh", "clouds", "model", "packets", "live"];

/// Named, so that build scripts go without the flags.
const TRIPLE: &str = "x86_64-unknown-linux-gnu";

/// libFuzzer's coverage, by flags that a stable compiler takes.
const COVERAGE: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
     -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
     -Cllvm-args=-sanitizer-coverage-pc-table \
     -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";

/// Starts to build the targets, while tests under the emulator leave a core idle.
pub fn build_meanwhile(seconds: u32) -> Option<anyhow::Result<Child>> {
    let is_known = cfg!(all(target_os = "linux", target_arch = "x86_64"));
    (seconds > 0 && is_known).then(|| {
        fs::create_dir_all(folder().join("target"))?;
        let mut build = cargo(&["build", "--release", "--target", TRIPLE, "--bins"]);
        spawn(build.current_dir(folder()).env("RUSTFLAGS", COVERAGE), "build")
    })
}

/// Fuzzes every target for `seconds`, as many at a time as there are cores.
pub fn run(summary: &mut Summary, seconds: u32, build: Option<anyhow::Result<Child>>) {
    summary.step("fuzzing", |summary| {
        let Some(build) = build else {
            let reason = "it needs x86-64 Linux and --fuzz-seconds above 0";
            return Ok(summary.skip("fuzzing", TARGETS.len(), reason));
        };
        if !build?.wait()?.success() {
            bail!("the targets cannot be built: {}", fs::read_to_string(log("build"))?);
        }
        let mut counts = Counts::default();
        for targets in TARGETS.chunks(available_parallelism()?.get()) {
            let started = targets.iter().map(|target| start(target, seconds));
            let started = started.collect::<anyhow::Result<Vec<_>>>()?;
            for (target, mut child) in targets.iter().zip(started) {
                let passed = child.wait()?.success();
                if !passed {
                    let log = fs::read(log(target)).unwrap_or_default();
                    eprintln!("{}", String::from_utf8_lossy(&log));
                    summary.remark(format!("fuzzing {target}: FAILED"));
                }
                counts = counts.and(if passed { Counts::PASSED } else { Counts::FAILED });
            }
        }
        Ok(counts)
    });
}

fn folder() -> std::path::PathBuf {
    root().join("tests/fuzz")
}

fn log(target: &str) -> std::path::PathBuf {
    folder().join("target").join(format!("{target}.log"))
}

/// Starts fuzzing `target`; what it says goes to a file of its own.
fn start(target: &str, seconds: u32) -> anyhow::Result<Child> {
    let folder = folder();
    let program = Path::new("target").join(TRIPLE).join("release").join(target);
    let mut command = Command::new(folder.join(program));
    command.arg(format!("-max_total_time={seconds}")).current_dir(&folder);
    // What is found goes to the first folder; the second is where it starts.
    if folder.join("seeds").join(target).is_dir() {
        fs::create_dir_all(folder.join("corpus").join(target))?;
        command.args([format!("corpus/{target}"), format!("seeds/{target}")]);
    }
    eprintln!("== fuzzing {target} for {seconds} s, see {}", log(target).display());
    spawn(&mut command, target)
}

/// Starts `command`; its output goes to the log `name`.
fn spawn(command: &mut Command, name: &str) -> anyhow::Result<Child> {
    let log = log(name);
    let output = File::create(&log).with_context(|| log.display().to_string())?;
    command.stdout(output.try_clone()?).stderr(output);
    command.spawn().with_context(|| format!("cannot start {}", command.get_program().display()))
}
