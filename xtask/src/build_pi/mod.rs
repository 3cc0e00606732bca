//! `cargo xtask build-pi`: infer-cpu as one file to copy to a Raspberry Pi.

use crate::{pi_target, workspace};
use anyhow::{Context, bail, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The largest size of the binary, which suits the smallest boards: 8.9 MiB of it are models.
const MOST_BYTES: u64 = 12 << 20;

/// Flags of `build-pi`.
#[derive(clap::Args, Default)]
pub struct Args {
    /// Copy the binary to this path [default: leave it under target/]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Builds and checks the binary, and runs it in QEMU if that is installed.
pub fn run(args: &Args) -> anyhow::Result<()> {
    workspace::need_standard_library(pi_target::TRIPLE)?;
    let built = build(&[])?;
    let binary = match &args.out {
        Some(out) => copy(&built, out)?,
        None => built.as_path(),
    };
    let shown = binary.display();
    let n_bytes = fs::metadata(binary).with_context(|| format!("cannot read {shown}"))?.len();
    check_static_stripped_aarch64(binary)?;
    let mebibytes = |bytes: u64| bytes as f64 / f64::from(1 << 20);
    let (size, limit) = (mebibytes(n_bytes), mebibytes(MOST_BYTES));
    if n_bytes > MOST_BYTES {
        bail!("{shown} has {size:.2} MiB; the limit is {limit} MiB");
    }
    println!("{shown}");
    println!("{size:.2} MiB of at most {limit}, static and stripped, for 64-bit Arm");
    match pi_target::emulator() {
        Some(mut emulator) => {
            let version = workspace::output(emulator.arg(binary).arg("--version"))?;
            println!("on an emulated Cortex-A76, --version prints: {}", version.trim());
        }
        None => println!("not run: {}", pi_target::NO_EMULATOR),
    }
    println!("Copy it to a Raspberry Pi (64-bit system) and measure there:");
    println!("    scp {shown} pi@raspberrypi.local:infer-cpu");
    println!("    ssh pi@raspberrypi.local ./infer-cpu bench");
    Ok(())
}

/// Checks by binutils' `readelf` that `file` is a program for 64-bit Arm which needs no library of the system
/// it runs on and carries no symbols.
fn check_static_stripped_aarch64(file: &Path) -> anyhow::Result<()> {
    let mut readelf = Command::new("readelf");
    let headers = workspace::output(readelf.args(["--wide", "--headers"]).arg(file))?;
    for (part, is_expected, expected) in [
        ("AArch64", true, "a program for aarch64, found another machine's"),
        (" INTERP ", false, "a static program, found one that is linked dynamically"),
        (" .symtab ", false, "a stripped program, found a table of symbols"),
    ] {
        let cause = || format!("{}: expected {expected}", file.display());
        ensure!(headers.contains(part) == is_expected, cause());
    }
    Ok(())
}

/// Builds infer-cpu for the Pi, with more arguments for rustc, and returns its path.
pub fn build(for_rustc: &[&str]) -> anyhow::Result<PathBuf> {
    let words = ["rustc", "--package", "infer-cpu", "--bin", "infer-cpu", "--profile", "pi"];
    let mut cargo = pi_target::cargo(&words);
    cargo.args(["--message-format", "json-render-diagnostics", "--"]).args(for_rustc);
    let messages = workspace::output(cargo.stderr(Stdio::inherit()))?;
    workspace::executable(&messages, "bin", "infer-cpu")
}

/// Copies the program and its permissions. The copy is complete or absent.
fn copy<'a>(from: &Path, to: &'a Path) -> anyhow::Result<&'a Path> {
    let mut partial = to.as_os_str().to_owned();
    partial.push(".partial");
    let copied = fs::copy(from, &partial).and_then(|_| fs::rename(&partial, to));
    copied.with_context(|| format!("cannot copy {} to {}", from.display(), to.display()))?;
    Ok(to)
}
