//! `cargo xtask release-check`: what a release must pass besides the tests.

use crate::summary::{Counts, Summary, check};
use crate::test::python;
use anyhow::{bail, ensure};
use std::process::Command;
use xtask::workspace::{cargo, output, packages, root};

/// What the README has in place of an address as long as the project has none.
const PLACEHOLDER: &str = "ADDRESS";

/// Runs every check even if one fails, and prints a table of the results.
pub fn run() -> anyhow::Result<u8> {
    let mut summary = Summary::default();
    summary.step("address", |_| address());
    summary.step("packages", |_| package());
    summary.step("binaries", binaries);
    summary.step("dependencies", |_| {
        let words = ["check", "--hide-inclusion-graph", "bans", "licenses", "sources"];
        check("dependencies", tool("cargo-deny", "cargo-deny")?.args(words))
    });
    summary.step("advisories", advisories);
    summary.step("semantic versions", semantic_versions);
    summary.step("site", |_| {
        check("site", tool("mdbook", "mdbook")?.args(["build", "docs", "-d", "../target/site"]))
    });
    python::run_emulated(&mut summary);
    Ok(summary.end())
}

/// Checks that the README names the address of the repository.
fn address() -> anyhow::Result<Counts> {
    let readme = std::fs::read_to_string(root().join("README.md"))?;
    ensure!(
        !readme.contains(PLACEHOLDER),
        "README.md: expected the address of the repository, found `{PLACEHOLDER}`"
    );
    Ok(Counts::PASSED)
}

/// Checks that every crate for crates.io builds from the files of its package.
fn package() -> anyhow::Result<Counts> {
    let mut package = cargo(&["package", "--allow-dirty"]);
    for crate_ in packages()?.iter().filter(|crate_| crate_["publish"].is_null()) {
        package.args(["--package", crate_["name"].as_str().unwrap_or_default()]);
    }
    check("packages", &mut package)
}

/// Checks which files a release would have for each system.
fn binaries(summary: &mut Summary) -> anyhow::Result<Counts> {
    if !packages()?.iter().any(|crate_| crate_["repository"].is_string()) {
        let reason = "no manifest names the `repository` to release from";
        return Ok(summary.skip("binaries", 1, reason));
    }
    check("binaries", tool("dist", "cargo-dist")?.arg("plan"))
}

/// Checks that no dependency has a known vulnerability, if their database can be downloaded.
fn advisories(summary: &mut Summary) -> anyhow::Result<Counts> {
    if !tool("cargo-deny", "cargo-deny")?.args(["fetch", "db"]).status()?.success() {
        return Ok(summary.skip("advisories", 1, "their database cannot be downloaded"));
    }
    check("advisories", tool("cargo-deny", "cargo-deny")?.args(["check", "advisories"]))
}

/// Checks that changes of the public API agree with the version numbers.
fn semantic_versions(summary: &mut Summary) -> anyhow::Result<Counts> {
    let mut git = Command::new("git");
    let tags = output(git.args(["tag", "--list", "v*"]).current_dir(root()))?;
    if tags.trim().is_empty() {
        return Ok(summary.skip("semantic versions", 1, "no version has been released yet"));
    }
    let mut semver = tool("cargo-semver-checks", "cargo-semver-checks")?;
    check("semantic versions", semver.args(["semver-checks", "--workspace"]))
}

/// `program` in the workspace's root. If it is missing, the error names the `package` that has it.
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
    fn crates_for_users_are_published_and_crates_for_developers_are_not() {
        let crates = packages().unwrap();
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
