//! Builds the page of `web`, and tests it in a browser.

use super::{go_without, meanwhile::nice, viewer};
use crate::summary::{Counts, Summary};
use anyhow::bail;
use std::process::Command;
use xtask::workspace::root;

/// The exit code of a script that cannot run here.
const SKIPPED: i32 = 77;

/// Tests the page. A test that cannot run fails if `install` is set and there is npm.
pub fn run(summary: &mut Summary, install: bool) {
    let name = "page in a browser";
    summary.step(name, |summary| {
        let mut script = Command::new("sh");
        let status = nice(script.arg("web/test.sh").current_dir(root())).status()?;
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
