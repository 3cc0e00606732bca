//! Builds the page of `web`, and tests it in a browser.

use super::lints::{self, by_clippy};
use super::peers::Programs;
use super::{go_without, meanwhile::nice, viewer};
use crate::summary::{Counts, Summary};
use anyhow::{anyhow, bail};
use std::process::Command;
use xtask::workspace::{cargo, root};

/// The exit code of a script that cannot run here.
const SKIPPED: i32 = 77;

/// Lints the code of the page, which compiles it as [`run`] needs it.
pub fn lint(name: &str, target: &str) -> anyhow::Result<Counts> {
    let words = ["build", "--package", "edgepuck-web", "--lib", "--profile", "test"];
    lints::check(name, nice(&by_clippy(cargo(&words))).args(["--target", target]))
}

/// Tests the page. A test that cannot run fails if `install` is set and there is npm.
pub fn run(summary: &mut Summary, install: bool, programs: &anyhow::Result<Programs>) {
    let name = "page in a browser";
    summary.step(name, |summary| {
        let programs = programs.as_ref().map_err(|cause| anyhow!("{cause:#}"))?;
        let mut script = by_clippy(Command::new("sh"));
        script.arg("web/test.sh").env("EDGEPUCK_TRACED", &programs.traced).current_dir(root());
        let status = nice(&script).status()?;
        match status.code() {
            Some(0) => Ok(Counts::PASSED),
            Some(SKIPPED) => {
                let required = install && viewer::has_npm();
                go_without(summary, name, "web/test.sh printed the reason", required)
            }
            _ => bail!("web/test.sh ended with {status}"),
        }
    });
}
