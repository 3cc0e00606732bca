//! Runs the code blocks and notebooks of the documentation in `docs`, and builds its site.

use super::peers::Programs;
use super::python::{Wheel, counts, path_behind, pytest};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow};
use std::path::Path;
use std::process::Command;
use xtask::venv::{self, cache_dir, succeeds};
use xtask::workspace::root;

/// Debian's Python, whose PyTorch has 100 MB and needs no GPU; that of PyPI has 5 GB.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";

/// Runs what the tests in `docs` run, and the examples of the Python package with PyTorch, as a
/// user who has installed the `wheel` and `infer-cpu`.
pub fn run_blocks(
    summary: &mut Summary,
    wheel: &Result<Wheel, String>,
    programs: &anyhow::Result<Programs>,
) {
    let name = "documentation's examples";
    summary.step(name, |summary| match wheel {
        Ok(wheel) => run_with(wheel, programs.as_ref().map_err(|cause| anyhow!("{cause:#}"))?),
        Err(cause) => Ok(summary.skip(name, 1, cause)),
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
    tests.arg(root().join("docs"));
    for name in
        ["test_readme", "test_torch", "test_training", "test_birdseye", "test_import_weights"]
    {
        tests.arg(root().join("python/tests").join(name).with_extension("py"));
    }
    // `pip install edgepuck` in a block finds the wheel.
    let wheels = wheel.file.parent().context("invariant: a file is in a folder")?;
    tests.env("PIP_FIND_LINKS", wheels).env("PIP_NO_INDEX", "1");
    // Outside of the checkout.
    let beside = std::env::temp_dir().join(format!("edgepuck-{}", std::process::id()));
    std::fs::create_dir_all(&beside)?;
    let infer_cpu = beside.join("infer-cpu");
    std::fs::copy(&programs.infer_cpu, &infer_cpu)
        .with_context(|| infer_cpu.display().to_string())?;
    tests.env("PATH", path_behind([&*folder.join("bin"), &*beside])?);
    let counted = counts(&mut tests);
    std::fs::remove_dir_all(beside)?;
    counted
}
