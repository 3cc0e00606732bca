//! Runs the code blocks of the documentation in `docs`.

use super::peers::Programs;
use super::python::{Wheel, counts, path_behind, pytest};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow, bail};
use std::path::Path;
use std::process::Command;
use xtask::venv::{self, cache_dir, succeeds};
use xtask::workspace::root;

/// Debian's Python, whose PyTorch has 100 MB and needs no GPU; that of PyPI has 5 GB.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";

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
