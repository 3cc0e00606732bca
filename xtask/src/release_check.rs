//! `cargo xtask release-check`: what a release must pass besides the tests.

use crate::summary::{Counts, Summary, check};
use crate::test::python;
use anyhow::{Context, bail};
use serde_json::Value;
use std::process::Command;
use xtask::workspace::{cargo, output, root};

/// Runs every check, whether or not one before it failed, and ends with a table.
pub fn run() -> anyhow::Result<u8> {
    let mut summary = Summary::default();
    summary.step("packages", |_| packages());
    summary.step("binaries", binaries);
    summary.step("dependencies", |_| {
        let words = ["check", "--hide-inclusion-graph", "bans", "licenses", "sources"];
        check("dependencies", tool("cargo-deny", "cargo-deny")?.args(words))
    });
    summary.step("advisories", advisories);
    summary.step("semantic versions", semantic_versions);
    python::run_emulated(&mut summary);
    Ok(summary.end())
}

/// Checks that every crate for crates.io builds from what its package holds.
fn packages() -> anyhow::Result<Counts> {
    let mut package = cargo(&["package", "--allow-dirty"]);
    for crate_ in crates()?.iter().filter(|crate_| crate_["publish"].is_null()) {
        package.args(["--package", crate_["name"].as_str().unwrap_or_default()]);
    }
    check("packages", &mut package)
}

/// Checks what a release would hold for each system.
fn binaries(summary: &mut Summary) -> anyhow::Result<Counts> {
    let is_known = crates()?.iter().any(|crate_| crate_["repository"].is_string());
    if !is_known {
        let reason = "no manifest names the `repository` to release from";
        return Ok(summary.skip("binaries", 1, reason));
    }
    check("binaries", tool("dist", "cargo-dist")?.arg("plan"))
}

/// Checks that no dependency has a known flaw, where the database of them can be fetched.
fn advisories(summary: &mut Summary) -> anyhow::Result<Counts> {
    if !tool("cargo-deny", "cargo-deny")?.args(["fetch", "db"]).status()?.success() {
        return Ok(summary.skip("advisories", 1, "their database cannot be fetched"));
    }
    check("advisories", tool("cargo-deny", "cargo-deny")?.args(["check", "advisories"]))
}

/// Checks that the public interface changes as the versions say.
fn semantic_versions(summary: &mut Summary) -> anyhow::Result<Counts> {
    let mut git = Command::new("git");
    let tags = output(git.args(["tag", "--list", "v*"]).current_dir(root()))?;
    if tags.trim().is_empty() {
        return Ok(summary.skip("semantic versions", 1, "no version has been released yet"));
    }
    let mut semver = tool("cargo-semver-checks", "cargo-semver-checks")?;
    check("semantic versions", semver.args(["semver-checks", "--workspace"]))
}

/// The workspace's crates as `cargo metadata` describes them.
fn crates() -> anyhow::Result<Vec<Value>> {
    let metadata = output(&mut cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    let mut metadata: Value = serde_json::from_str(&metadata).context("cargo metadata")?;
    Ok(metadata["packages"].as_array_mut().map(std::mem::take).unwrap_or_default())
}

/// The program, at the workspace's root, or an error that says which package installs it.
fn tool(program: &str, package: &str) -> anyhow::Result<Command> {
    if Command::new(program).arg("--version").output().is_err() {
        bail!("{program} is missing: `cargo install --locked {package}` installs it");
    }
    let mut command = Command::new(program);
    command.current_dir(root());
    Ok(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_tool_is_named_with_what_installs_it() {
        let error = tool("no-such-tool", "a-package").unwrap_err().to_string();
        let expected = "no-such-tool is missing: `cargo install --locked a-package` installs it";
        assert_eq!(error, expected);
    }

    #[test]
    fn the_crates_for_users_are_published_and_the_chores_are_not() {
        let crates = crates().unwrap();
        let find = |name: &str| crates.iter().find(|crate_| crate_["name"] == name).unwrap();
        let is_published = |name: &str| find(name)["publish"].is_null();
        for name in ["edgepuck", "edgepuck-formats", "sim-gpu", "infer-cpu"] {
            assert!(is_published(name), "{name}");
        }
        for name in ["xtask", "tests"] {
            assert!(!is_published(name), "{name}");
        }
    }
}
