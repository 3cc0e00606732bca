//! Starts the repository's other programs, which Cargo builds first if need be.

use anyhow::Context;
use std::env::current_dir;
use std::ffi::OsString;
use std::process::Command;
use xtask::workspace::{cargo, root};

pub const EDGEPUCK: &str = "edgepuck";

/// Commands of the product that read or write no network. A first build for them
/// leaves out the feature `models`: infer-cpu and training. It leaves out `gpu`, too, on a
/// machine without one.
const WITHOUT_MODELS: &str = "gen-dataset gen gen-scenes scan \
     corrupt view profile merge-dataset";

/// Commands that read points in any format. The features that they need beyond those of a first build take
/// long to build.
const READS_POINTS: &str = "corrupt view";

/// Runs the program of `package` with `words` in the caller's folder and gives
/// the exit code that it ended with.
pub fn run(package: &str, words: &[OsString]) -> anyhow::Result<u8> {
    let mut cargo = cargo(&["run", "--release", "--package", package, "--bin", package]);
    cargo.arg("--manifest-path").arg(root().join("Cargo.toml")).current_dir(current_dir()?);
    if is_one_of(words, WITHOUT_MODELS) {
        cargo.arg("--no-default-features");
        if names_adapter(words) || has_gpu() {
            cargo.args(["--features", "gpu"]);
        }
    }
    cargo.args(features(package, words)).arg("--").args(words);
    become_process(&mut cargo).context("cannot start cargo")
}

/// The flags for the features that a command line needs beyond those of a first build.
fn features(package: &str, words: &[OsString]) -> &'static [&'static str] {
    let needs_las = package == EDGEPUCK && is_one_of(words, READS_POINTS);
    if needs_las { &["--features", "las,mcap"] } else { &[] }
}

/// Replaces this process where the system allows it, so that a signal ends what
/// the caller sees; elsewhere waits for the child and returns its exit code.
fn become_process(command: &mut Command) -> std::io::Result<u8> {
    #[cfg(unix)]
    return Err(std::os::unix::process::CommandExt::exec(command));
    #[cfg(not(unix))]
    Ok(command.status()?.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1))
}

/// Whether the command that `words` begin with is one of `commands`.
fn is_one_of(words: &[OsString], commands: &str) -> bool {
    words.first().is_some_and(|word| commands.split(' ').any(|name| word == name))
}

/// Whether a command line asks for a GPU, or for the list of those that there are.
fn names_adapter(words: &[OsString]) -> bool {
    let words: Vec<_> = words.iter().map(|word| word.to_string_lossy()).collect();
    let value = |i: usize| match words[i].strip_prefix("--adapter") {
        Some("") => words.get(i + 1).map(|word| word.as_ref()),
        Some(value) => value.strip_prefix('='),
        None => None,
    };
    (0..words.len()).filter_map(value).any(|name| !["auto", "cpu"].contains(&name))
}

/// Whether this machine has a GPU that a program could open. A system that is not asked counts as one
/// that has. Vulkan in software is none: `auto` never takes it.
fn has_gpu() -> bool {
    let names = |folder: &str| {
        let files = std::fs::read_dir(format!("/dev/{folder}")).into_iter().flatten().flatten();
        files.map(|file| format!("{folder}{}", file.file_name().display())).collect::<Vec<_>>()
    };
    !cfg!(target_os = "linux") || names("").iter().chain(&names("dri/")).any(|name| is_gpu(name))
}

/// Whether a file in `/dev` is a GPU: a render node of the kernel's drivers, or NVIDIA's, WSL's, Adreno's
/// or Mali's.
fn is_gpu(name: &str) -> bool {
    ["dri/renderD", "nvidiactl", "dxg", "kgsl-3d", "mali"].iter().any(|it| name.starts_with(it))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_that_read_points_have_las() {
        for (word, expected) in [("view", true), ("corrupt", true), ("gen-dataset", false)] {
            let found = features(EDGEPUCK, &[word, "a.las"].map(OsString::from));
            assert_eq!(!found.is_empty(), expected, "{word}");
        }
    }

    #[test]
    fn adapters_are_named_by_flags() {
        for (words, expected) in [
            ("gen-dataset meshes --out a", false),
            ("gen-dataset meshes --adapter cpu --out a", false),
            ("gen-dataset meshes --adapter=auto", false),
            ("gen-dataset meshes --adapter llvmpipe", true),
            ("scan scene.toml --adapter=NVIDIA", true),
            ("gen-dataset --adapter list", true),
        ] {
            let typed: Vec<OsString> = words.split(' ').map(OsString::from).collect();
            assert_eq!(names_adapter(&typed), expected, "{words}");
        }
    }

    #[test]
    fn a_display_without_a_render_node_is_no_gpu() {
        let found = ["dri/card0", "dri/renderD128", "nvidiactl", "nvram", "dxg", "fb0"];
        assert_eq!(found.map(is_gpu), [false, true, true, false, true, false]);
    }
}
