//! Builds the page of `web`, and tests it in a browser.

use super::meanwhile::nice;
use crate::summary::{Counts, Summary};
use anyhow::bail;
use std::process::Command;
use xtask::workspace::root;

/// The exit code of a script that cannot run here.
const SKIPPED: i32 = 77;

pub fn run(summary: &mut Summary) {
    let name = "page in a browser";
    summary.step(name, |summary| {
        let mut script = Command::new("sh");
        let status = nice(script.arg("web/test.sh").current_dir(root())).status()?;
        match status.code() {
            Some(0) => Ok(Counts::PASSED),
            Some(SKIPPED) => Ok(summary.skip(name, 1, "web/test.sh printed the reason")),
            _ => bail!("web/test.sh ended with {status}"),
        }
    });
}
