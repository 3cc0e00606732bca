//! Runs the code blocks of the documentation in `docs`.

use super::meanwhile::nice;
use super::python::{NATIVE, Wheel, counts, path_behind, pytest};
use crate::summary::{Counts, Summary};
use anyhow::{Context, anyhow};
use std::path::Path;
use std::process::Command;
use xtask::venv::{self, cache_dir, succeeds};
use xtask::workspace::{cargo, executable, output, root};

/// Debian's Python, whose PyTorch has 100 MB and needs no GPU; that of PyPI has 5 GB.
const SYSTEM_PYTHON: &str = "/usr/bin/python3";

/// Runs the code blocks of all pages, and the examples of the Python package with PyTorch, as a
/// user who has installed the `wheel` and `infer-cpu`.
pub fn run_blocks(summary: &mut Summary, wheel: &Result<Wheel, String>) {
    let name = "documentation's examples";
    summary.step(name, |summary| match wheel {
        Ok(wheel) => run_with(wheel),
        Err(cause) => Ok(summary.skip(name, 1, cause)),
    });
}

/// Builds `infer-cpu` for a release, and copies it to a folder outside of the checkout.
fn install_infer_cpu(folder: &Path) -> anyhow::Result<()> {
    // With the profile and the target of the wheel, most is built already.
    let mut build = cargo(&["build", "--release", "--package", "infer-cpu", "--bin", "infer-cpu"]);
    build.args(["--target", NATIVE, "--message-format", "json-render-diagnostics"]);
    let program = executable(&output(&mut nice(&build))?, "infer-cpu")?;
    std::fs::copy(&program, folder.join("infer-cpu"))
        .with_context(|| program.display().to_string())?;
    Ok(())
}

fn run_with(wheel: &Wheel) -> anyhow::Result<Counts> {
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
    let programs = std::env::temp_dir().join(format!("edgepuck-{}", std::process::id()));
    std::fs::create_dir_all(&programs)?;
    install_infer_cpu(&programs)?;
    tests.env("PATH", path_behind([&*folder.join("bin"), &*programs])?);
    let counted = counts(&mut tests);
    std::fs::remove_dir_all(programs)?;
    counted
}
