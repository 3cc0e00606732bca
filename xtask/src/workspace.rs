//! The workspace that this program is part of, and commands that run in it.

use anyhow::{Context, bail};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The laboratory, which measures.
pub const LAB: &str = "edgepuck-lab";

/// The workspace's root.
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new("."))
}

/// The Cargo that runs us, at the root.
pub fn cargo(args: &[&str]) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).current_dir(root());
    command
}

/// The folder of Rust's standard library for `target`, which may be missing.
pub fn standard_library(target: &str) -> anyhow::Result<PathBuf> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let mut ask = Command::new(rustc);
    let folder = output(ask.args(["--print", "target-libdir", "--target", target]))?;
    Ok(PathBuf::from(folder.trim()))
}

/// Downloads the standard library for `target` through rustup if it is missing.
pub fn need_standard_library(target: &str) -> anyhow::Result<()> {
    if standard_library(target)?.is_dir() {
        return Ok(());
    }
    eprintln!("downloading Rust's standard library for {target}: rustup target add {target}");
    let status = Command::new("rustup").args(["target", "add", target]).status();
    let status = status.with_context(|| {
        format!("rustup is missing; install the standard library for {target} yourself")
    })?;
    if !status.success() {
        bail!("rustup cannot download {target}; is this machine offline?");
    }
    Ok(())
}

/// The standard output of a command.
pub fn output(command: &mut Command) -> anyhow::Result<String> {
    let output = command.output().with_context(|| format!("cannot run {}", words(command)))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        bail!("{} failed ({}): {}", words(command), output.status, errors.trim());
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A command line, for people.
pub fn words(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    words.map(OsStr::to_string_lossy).collect::<Vec<_>>().join(" ")
}

/// The packages of the workspace, as `cargo metadata` describes them.
pub fn packages() -> anyhow::Result<Vec<Value>> {
    let words = ["metadata", "--no-deps", "--format-version", "1"];
    let mut metadata: Value = serde_json::from_str(&output(&mut cargo(&words))?)?;
    Ok(metadata["packages"].as_array_mut().map(std::mem::take).unwrap_or_default())
}

/// The path of program `name`, a `bin` or an `example`, from Cargo's `messages`, one JSON object a line.
pub fn executable(messages: &str, kind: &str, name: &str) -> anyhow::Result<PathBuf> {
    let mut programs = executables(messages, false).filter(|message| {
        message["target"]["name"] == name && message["target"]["kind"][0] == kind
    });
    let program = programs.find_map(|message| Some(message["executable"].as_str()?.into()));
    program.with_context(|| format!("Cargo has not built the program {name}"))
}

/// The path of the dynamic library `name`, from Cargo's `messages`.
pub fn library(messages: &str, name: &str) -> anyhow::Result<PathBuf> {
    let mut built = objects(messages).filter(|message| {
        message["reason"] == "compiler-artifact" && message["target"]["name"] == name
    });
    let library = built.find_map(|message| Some(message["filenames"][0].as_str()?.into()));
    library.with_context(|| format!("Cargo has not built the library {name}"))
}

/// The programs of unit tests, from Cargo's `messages`, each in the folder of its package.
pub fn unit_tests(messages: &str) -> Vec<Command> {
    let is_unit = |message: &Value| message["target"]["kind"][0] != "test";
    let programs = executables(messages, true).filter(is_unit).filter_map(|message| {
        let mut program = Command::new(message["executable"].as_str()?);
        program.current_dir(Path::new(message["manifest_path"].as_str()?).parent()?);
        Some(program)
    });
    programs.collect()
}

/// The messages of Cargo that name an executable, either of tests or of no tests.
fn executables(messages: &str, are_tests: bool) -> impl Iterator<Item = Value> {
    objects(messages).filter(move |message| {
        message["profile"]["test"] == are_tests && message["executable"].is_string()
    })
}

fn objects(messages: &str) -> impl Iterator<Item = Value> {
    messages.lines().filter_map(|line| serde_json::from_str(line).ok())
}

/// The arguments that the user typed, paths as [`recorded`] writes them.
pub fn arguments() -> Vec<String> {
    let recorded = |word: String| match word.split_once('=') {
        Some((flag, path)) => format!("{flag}={}", recorded(Path::new(path))),
        None => recorded(Path::new(&word)),
    };
    std::env::args().skip(1).map(recorded).collect()
}

/// `path` as a record names it: from the workspace's root if it lies there, and without
/// its folders if it is absolute, so that a record does not name folders of a machine.
pub fn recorded(path: &Path) -> String {
    match path.strip_prefix(root()) {
        Ok(inside) => inside.display().to_string(),
        Err(_) if path.is_absolute() => file_name(path),
        Err(_) => path.display().to_string(),
    }
}

/// A file's or folder's own name, for people.
pub fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_names_no_folder_of_the_machine() {
        assert_eq!(recorded(&root().join("assets/a.toml")), "assets/a.toml");
        assert_eq!(recorded(&std::env::temp_dir().join("a.json")), "a.json");
        assert_eq!(recorded(Path::new("data/a.json")), "data/a.json");
        assert_eq!(recorded(Path::new("--quick")), "--quick");
    }

    #[test]
    fn a_program_is_found_among_tests_and_libraries_of_its_name() {
        let messages = r#"{"reason":"build-script-executed"}
{"target":{"kind":["lib"],"name":"a"},"profile":{"test":false},"executable":null}
{"target":{"kind":["bin"],"name":"a"},"profile":{"test":true},"executable":"/t/deps/a-1","manifest_path":"/a/Cargo.toml"}
{"target":{"kind":["bin"],"name":"a"},"profile":{"test":false},"executable":"/t/a"}
{"target":{"kind":["example"],"name":"a"},"profile":{"test":false},"executable":"/t/examples/a"}
{"reason":"compiler-artifact","target":{"name":"_m"},"profile":{"test":false},"executable":null,"filenames":["/t/m.so"]}
not JSON"#;
        assert_eq!(executable(messages, "bin", "a").unwrap(), Path::new("/t/a"));
        assert_eq!(executable(messages, "example", "a").unwrap(), Path::new("/t/examples/a"));
        assert_eq!(library(messages, "_m").unwrap(), Path::new("/t/m.so"));
        assert!(executable(messages, "bin", "b").is_err());
        let tests = unit_tests(messages);
        assert_eq!(tests.len(), 1);
        assert_eq!(tests[0].get_program(), "/t/deps/a-1");
    }
}
