//! The viewer in `assets/view`: its sources are linted, what the programs embed is built again and
//! compared, and pages are opened in Chromium.

use super::{go_without, peers::Programs};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow};
use std::path::PathBuf;
use std::process::Command;
use xtask::venv::succeeds;
use xtask::workspace::{output, root};

/// The names of Chromium.
const BROWSERS: [&str; 2] = ["chromium", "google-chrome"];

/// Checks the viewer with the packages of npm, which are downloaded first if `install` is set: then
/// only a lack of npm skips a check.
pub fn run(summary: &mut Summary, install: bool, programs: &anyhow::Result<Programs>) {
    summary.step("viewer", |summary| {
        if !has_npm() {
            return Ok(summary.skip("viewer", 3, "there is no npm"));
        }
        if install {
            passes(in_viewer("npm").args(["ci", "--loglevel", "error"])).context("npm ci")?;
        } else if !folder().join("node_modules").is_dir() {
            return Ok(summary.skip("viewer", 3, "its packages are missing"));
        }
        passes(in_viewer("npm").args(["run", "--silent", "check"]))?;
        let counts = Counts { passed: 2, ..Counts::default() };
        let answers = |name: &&&str| succeeds(Command::new(name).arg("--version")).is_ok();
        let Some(browser) = BROWSERS.iter().find(answers) else {
            let lack = "there is no Chromium";
            return Ok(counts.and(go_without(summary, "pages in a browser", lack, install)?));
        };
        let programs = programs.as_ref().map_err(|cause| anyhow!("{cause:#}"))?;
        let path = output(Command::new("which").arg(browser))?;
        passes(in_viewer("node").arg("test/browser.mjs").arg(&programs.edgepuck).arg(path.trim()))?;
        Ok(counts.and(Counts::PASSED))
    });
}

pub fn has_npm() -> bool {
    succeeds(Command::new("npm").arg("--version")).is_ok()
}

fn folder() -> PathBuf {
    root().join("assets/view")
}

fn in_viewer(program: &str) -> Command {
    let mut command = Command::new(program);
    command.current_dir(folder());
    command
}

fn passes(command: &mut Command) -> anyhow::Result<()> {
    succeeds(command).map_err(|cause| anyhow!(cause))
}
