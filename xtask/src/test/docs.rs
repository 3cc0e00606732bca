//! The documentation in `docs`: it is built as a site, and its code blocks are run.

use super::meanwhile::Meanwhile;
use super::peers::programs;
use super::python::{Wheel, counts, environment, path_behind, pytest};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::venv::{cache_dir, succeeds};
use xtask::workspace::{cargo, root};

/// The version of mdBook, which builds the site.
const MDBOOK: &str = "0.5.4";

/// Debian's Python, for which there is a PyTorch of 100 MB that needs no GPU; the one of PyPI takes 5 GB.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";

/// Starts to build mdBook, in the time that other steps leave a core idle.
pub fn build_meanwhile(install: bool) -> Option<anyhow::Result<Meanwhile>> {
    (install && !mdbook().exists()).then(|| {
        let mut build = Command::new("nice");
        build.arg(cargo(&[]).get_program()).args(["install", "mdbook", "--version", MDBOOK]);
        build.args(["--locked", "--no-default-features", "--features", "search", "--root"]);
        build.arg(mdbook_folder()).current_dir(cache_dir());
        // It is compiled once and run for a second.
        build.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0");
        std::fs::create_dir_all(cache_dir())?;
        Meanwhile::start("mdbook-build", &mut build)
    })
}

fn mdbook_folder() -> PathBuf {
    cache_dir().join(format!("mdbook-{MDBOOK}"))
}

fn mdbook() -> PathBuf {
    mdbook_folder().join("bin/mdbook")
}

/// Builds the site, under `target/site`.
pub fn build_site(summary: &mut Summary, mdbook_build: Option<anyhow::Result<Meanwhile>>) {
    summary.step("site", |summary| {
        if let Some(build) = mdbook_build {
            let (built, log) = build?.end()?;
            ensure!(built.success(), "mdBook cannot be built: {log}");
        }
        if !mdbook().exists() {
            return Ok(summary.skip("site", 1, "mdBook is missing"));
        }
        let mut build = Command::new(mdbook());
        build.arg("build").arg(root().join("docs")).arg("--dest-dir");
        succeeds(build.arg(root().join("target/site"))).map_err(|cause| anyhow!(cause))?;
        Ok(Counts::PASSED)
    });
}

/// Runs the code blocks of all pages, and the Python package's examples of PyTorch, as a user who
/// has installed the `wheel`.
pub fn run_blocks(wheel: &Wheel) -> anyhow::Result<Counts> {
    let has_pytorch = succeeds(Command::new(SYSTEM_PYTHON).args(["-c", "import torch"])).is_ok();
    let base = if has_pytorch { Path::new(SYSTEM_PYTHON) } else { &wheel.tools };
    // Debian's Python has no pip to put there: that of the tools installs one.
    let folder = environment(base, "docs-venv", &["--system-site-packages"])?;
    let python = folder.join("bin/python");
    wheel.install(&python, &["docs/requirements.txt"])?;

    let mut tests = pytest(&python, &folder);
    tests.arg(root().join("docs")).arg(root().join("python/tests/test_readme.py"));
    // `pip install edgepuck` finds the wheel; our other programs are those that the tests have built.
    let wheels = wheel.file.parent().context("invariant: a file is in a folder")?;
    tests.env("PIP_FIND_LINKS", wheels).env("PIP_NO_INDEX", "1");
    let [(_, program), ..] = programs()?;
    tests.env(
        "PATH",
        path_behind([Some(&*folder.join("bin")), program.parent()].into_iter().flatten())?,
    );
    counts(&mut tests)
}

#[cfg(test)]
mod tests {
    #[test]
    fn releases_build_the_site_with_the_version_that_is_tested() {
        let release = include_str!("../../../.github/workflows/docs.yml");
        assert!(release.contains(&format!("mdbook --version {} ", super::MDBOOK)));
    }
}
