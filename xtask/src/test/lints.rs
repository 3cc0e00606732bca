//! Lints from the compilation that the tests need: Clippy is rustc with more lints.

use crate::summary::Counts;
use anyhow::{Context, ensure};
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::PathBuf;
use std::process::{Command, Stdio};
use xtask::workspace::{output, words};

/// Makes `cargo` compile the packages of its workspace with Clippy, if it is installed.
pub fn by_clippy(mut cargo: Command) -> Command {
    if let Ok(driver) = driver() {
        cargo.env("RUSTC_WORKSPACE_WRAPPER", driver);
    }
    cargo
}

/// The program that is to Clippy what rustc is to Rust.
fn driver() -> anyhow::Result<PathBuf> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let sysroot = output(Command::new(rustc).args(["--print", "sysroot"]))?;
    let name = if cfg!(windows) { "clippy-driver.exe" } else { "clippy-driver" };
    let driver = PathBuf::from(sysroot.trim()).join("bin").join(name);
    ensure!(
        driver.exists(),
        "expected {}, found none: rustup component add clippy",
        driver.display()
    );
    Ok(driver)
}

/// Runs `cargo`, which compiles with Clippy. Every warning is a failure, but stops no compilation.
/// Cargo repeats the warnings of what it need not compile again.
pub fn check(name: &str, cargo: &mut Command) -> anyhow::Result<Counts> {
    driver()?;
    let shown = words(cargo);
    eprintln!("== {name}: {shown}");
    cargo.args(["--message-format", "json-diagnostic-rendered-ansi"]).stdout(Stdio::piped());
    let mut child = cargo.spawn().with_context(|| format!("cannot run {shown}"))?;
    let mut n_warnings = 0;
    for line in BufReader::new(child.stdout.take().context("invariant: it is piped")?).lines() {
        n_warnings += u32::from(shows_warning(&line?));
    }
    let status = child.wait()?;
    ensure!(status.success(), "{shown} ended with {status}");
    ensure!(n_warnings == 0, "expected no warnings, found {n_warnings}");
    Ok(Counts::PASSED)
}

/// Prints what the compiler says in a line of Cargo's messages. Returns whether it is a warning.
fn shows_warning(line: &str) -> bool {
    let message: Value = serde_json::from_str(line).unwrap_or_default();
    let said = &message["message"];
    if message["reason"] != "compiler-message" {
        return false;
    }
    eprint!("{}", said["rendered"].as_str().unwrap_or_default());
    said["level"] == "warning" || said["level"] == "error"
}

#[cfg(test)]
mod tests {
    use super::shows_warning;

    #[test]
    fn warnings_are_found_among_cargo_s_messages() {
        let message = |level| {
            let said = format!(r#"{{"level":"{level}","rendered":"{level}: unused\n"}}"#);
            format!(r#"{{"reason":"compiler-message","message":{said}}}"#)
        };
        assert!(shows_warning(&message("warning")));
        assert!(!shows_warning(&message("note")));
        assert!(!shows_warning(r#"{"reason":"compiler-artifact","fresh":true}"#));
        assert!(!shows_warning("not JSON"));
    }
}
