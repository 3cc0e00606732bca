//! Builds the documentation in `docs` as a site, and runs its code blocks.

use super::meanwhile::{Meanwhile, nice};
use super::peers::Programs;
use super::python::{Wheel, counts, path_behind, pytest};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, bail, ensure};
use std::path::{Path, PathBuf};
use std::process::Command;
use xtask::venv::{self, cache_dir, succeeds};
use xtask::workspace::{cargo, root};

/// The version of mdBook, which builds the site.
const MDBOOK: &str = "0.5.4";

/// Debian's Python, whose PyTorch has 100 MB and needs no GPU; that of PyPI has 5 GB.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";

pub fn build_meanwhile(install: bool) -> Option<anyhow::Result<Meanwhile>> {
    (install && !mdbook().exists()).then(|| {
        let mut build = cargo(&["install", "mdbook", "--version", MDBOOK, "--locked"]);
        build.args(["--no-default-features", "--features", "search", "--root"]);
        build.arg(mdbook_folder()).current_dir(cache_dir());
        // It runs for a second.
        build.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0");
        std::fs::create_dir_all(cache_dir())?;
        Meanwhile::start("mdbook-build", &mut nice(&build))
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

/// Runs the code blocks of all pages, and the examples of the Python package with PyTorch, as a
/// user who has installed the `wheel` and our `programs`.
pub fn run_blocks(
    summary: &mut Summary,
    wheel: &Result<Wheel, String>,
    programs: &anyhow::Result<Programs>,
) {
    let name = "documentation's examples";
    summary.step(name, |summary| match (wheel, programs) {
        (Ok(wheel), Ok(programs)) => run_with(wheel, programs),
        (Err(cause), _) => Ok(summary.skip(name, 1, cause)),
        (_, Err(cause)) => bail!("{cause:#}"),
    });
}

fn run_with(wheel: &Wheel, programs: &Programs) -> anyhow::Result<Counts> {
    let has_pytorch = succeeds(Command::new(SYSTEM_PYTHON).args(["-c", "import torch"])).is_ok();
    let base = if has_pytorch { Path::new(SYSTEM_PYTHON) } else { &wheel.tools };
    let folder = cache_dir().join("docs-venv");
    venv::make(base, &folder, &["--without-pip", "--system-site-packages"])
        .map_err(|cause| anyhow!(cause))?;
    let python = folder.join("bin/python");
    wheel.install(&python, &["docs/requirements.txt"])?;

    let mut tests = pytest(&python, &folder);
    tests.arg(root().join("docs")).arg(root().join("python/tests/test_readme.py"));
    // `pip install edgepuck` in a block finds the wheel.
    let wheels = wheel.file.parent().context("invariant: a file is in a folder")?;
    tests.env("PIP_FIND_LINKS", wheels).env("PIP_NO_INDEX", "1");
    let [(_, program), ..] = programs;
    let folders = [Some(&*folder.join("bin")), program.parent()];
    tests.env("PATH", path_behind(folders.into_iter().flatten())?);
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
