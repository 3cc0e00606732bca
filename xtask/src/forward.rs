//! Starts the repository's other programs, which Cargo builds first if need be.

use anyhow::Context;
use formats::modelnet_h5_list;
use std::ffi::OsString;
use std::process::Command;
use xtask::workspace::{LAB, cargo_run};

pub const EDGEPUCK: &str = "edgepuck";

/// Commands of the product that read or write no network. A first build for them
/// leaves out the feature `models`: infer-cpu, and readers and writers of PyTorch's
/// and ONNX's files.
const WITHOUT_MODELS: &str = "gen-dataset gen gen-scenes gen-drive gen-shapes sample-surfaces scan \
     segment weather corrupt preview profile adapters merge-dataset";

/// Commands that read points in any format.
const READS_POINTS: &str = "segment weather corrupt preview";

/// Runs the program of `package` with `words` in the caller's folder and gives
/// the exit code that it ended with.
pub fn run(package: &str, words: &[OsString]) -> anyhow::Result<u8> {
    let mut cargo = cargo_run(package);
    if words.first().is_some_and(|word| WITHOUT_MODELS.split(' ').any(|name| word == name)) {
        cargo.arg("--no-default-features");
    }
    for feature in features(package, words) {
        cargo.args(["--features", feature]);
    }
    cargo.arg("--").args(words);
    become_process(&mut cargo).context("cannot start cargo")
}

/// Replaces this process where the system allows it, so that a signal ends what
/// the caller sees; elsewhere waits for the child and returns its exit code.
fn become_process(command: &mut Command) -> std::io::Result<u8> {
    #[cfg(unix)]
    return Err(std::os::unix::process::CommandExt::exec(command));
    #[cfg(not(unix))]
    Ok(command.status()?.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1))
}

/// The features that a command line needs beyond the default ones: what takes long to build.
fn features(package: &str, words: &[OsString]) -> Vec<&'static str> {
    let any = |is: fn(&str) -> bool| words.iter().any(|word| is(&word.to_string_lossy()));
    let is_in_scene = |key| words.iter().any(|word| has_key(word, key));
    let reads_hdf5 = modelnet_h5_list::is_among(words);
    if package == LAB {
        return if reads_hdf5 { vec!["hdf5"] } else { Vec::new() };
    }
    let simplifies = any(|word| word.starts_with("--simplify")) || is_in_scene("simplify");
    let is_coloured = any(|word| word.starts_with("--colours")) || is_in_scene("colours");
    let writes_hdf5 =
        any(|word| word.starts_with("--layout")) && any(|word| word.contains("modelnet-h5"));
    let hdf5 = reads_hdf5 || writes_hdf5;
    let reads_points =
        words.first().is_some_and(|word| READS_POINTS.split(' ').any(|name| word == name));
    let features = [
        (simplifies, "simplify"),
        (hdf5, "hdf5"),
        (is_coloured, "textures"),
        (reads_points, "las"),
    ];
    features.into_iter().filter(|(is_needed, _)| *is_needed).map(|(_, name)| name).collect()
}

/// Whether the scene file has this key, and not `false`. An error costs a longer build alone.
fn has_key(scene: &OsString, key: &str) -> bool {
    scene.to_string_lossy().ends_with(".toml")
        && std::fs::read_to_string(scene).is_ok_and(|text| is_key_of(&text, key))
}

fn is_key_of(scene: &str, key: &str) -> bool {
    let mut code = scene.lines().map(|line| line.split('#').next().unwrap_or_default());
    code.any(|code| code.contains(key) && !code.contains("false"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_simplifies_is_built_with_the_feature() {
        let flags = ["gen-dataset", "--simplify=auto", "--layout", "modelnet-h5"];
        assert_eq!(features(EDGEPUCK, &flags.map(OsString::from)), ["simplify", "hdf5"]);
        assert_eq!(features(EDGEPUCK, &["preview", "a.las"].map(OsString::from)), ["las"]);
        for (scene, expected) in [
            ("simplify = \"auto\"", true),
            ("[[object]]\n  simplify = 0.01 # metres", true),
            ("simplify = false", false),
            ("# simplify = \"auto\"", false),
        ] {
            assert_eq!(is_key_of(scene, "simplify"), expected, "{scene}");
        }
    }
}
