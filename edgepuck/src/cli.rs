//! The command line of `edgepuck`, for the program and for the Python package.

use crate::{
    Outcome, adapters, calibrate, card, cluster, corrupt, gen_dataset, gen_drive, gen_scenes,
    gen_shapes, merge_dataset, outcome, preview_scan, profile, sample_surfaces, scan, segment,
    signals, view, weather,
};
#[cfg(feature = "models")]
use crate::{advise, detect, export_onnx, import_weights};
use clap::{CommandFactory, Parser, Subcommand};
use std::ffi::OsString;

/// Turns CAD meshes into realistic LiDAR training data.
#[derive(Parser)]
#[command(name = "edgepuck", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Scan a folder of meshes into a LiDAR dataset (default: built-in procedural shapes)
    #[command(alias = "gen")]
    GenDataset(Box<gen_dataset::Args>),
    /// Scan street scenes and segment them into labelled clusters (default: built-in objects)
    GenScenes(gen_scenes::Args),
    /// Simulate a drive through a street: a capture of VLP-32C packets with ground truth, or labelled
    /// sweeps of any sensor whose head turns
    GenDrive(gen_drive::Args),
    /// Write the procedural shapes that gen-dataset uses by default as OFF files
    GenShapes(gen_shapes::Args),
    /// Sample points uniformly from the surfaces of meshes, as in ModelNet40's point clouds
    SampleSurfaces(sample_surfaces::SampleSurfacesArgs),
    /// Scan one scene
    Scan(scan::Args),
    /// Segment a sensor's sweep into ground and clusters
    Segment(segment::SegmentArgs),
    /// Add rain, snow, fog or haze to a recorded scan, and label each point
    Weather(weather::WeatherArgs),
    /// Apply sensor corruptions to a sweep or to mesh scans, to make robustness test sets
    Corrupt(Box<corrupt::CorruptArgs>),
    /// Find and classify the objects in a sweep
    #[cfg(feature = "models")]
    Detect(detect::DetectArgs),
    /// Draw a picture of points: a sweep from above, others from the side, from above and the front
    Preview(preview_scan::Args),
    /// Show points, meshes, boxes and scenes in three dimensions, in a page for the browser
    View(view::Args),
    /// List the built-in sensors, or check and describe a sensor profile
    Profile(profile::ProfileArgs),
    /// Measure a sensor from captures or sweeps at rest, and write its profile
    Calibrate(calibrate::CalibrateArgs),
    /// List the adapters (GPUs and CPU) that can cast rays
    Adapters,
    /// Merge the shards of a dataset, or of a set of scenes, into one
    MergeDataset(merge_dataset::Args),
    /// Write a card (README.md) and Croissant metadata for publishing a finished dataset
    Card(card::CardArgs),
    /// Print a job file for making a dataset on many machines: Slurm, Kubernetes or HyperQueue
    Cluster(cluster::ClusterArgs),
    /// Convert a PyTorch checkpoint into a model file for infer-cpu
    #[cfg(feature = "models")]
    ImportWeights(import_weights::ImportWeightsArgs),
    /// Convert a model file to ONNX, for other inference engines
    #[cfg(feature = "models")]
    ExportOnnx(export_onnx::ExportOnnxArgs),
    #[cfg(feature = "models")]
    #[command(flatten)]
    Train(train::cli::Command),
    #[cfg(feature = "models")]
    #[command(flatten)]
    Infer(infer_cpu::cli::Command),
    /// Recommend one configuration of the classifier for a device, based on measurements
    #[cfg(feature = "models")]
    Advise(advise::AdviseArgs),
    /// A command that only the whole program has.
    #[cfg(not(feature = "models"))]
    #[command(external_subcommand)]
    Other(Vec<OsString>),
}

/// Runs the command line `words`, which begins with the name of the program. Prints errors and
/// help, and returns the exit code.
pub fn main(words: impl IntoIterator<Item = OsString>) -> u8 {
    match parsed(words) {
        Ok(cli) => outcome::exit_code(run_as_program(&cli.command)),
        Err(error) => {
            // A closed standard error does not change the exit code.
            let _ = error.print();
            error.exit_code() as u8
        }
    }
}

/// Runs the command line `words` like [`main`], but returns errors to the caller instead of
/// printing them. `--help` is an error.
pub fn run_words(words: impl IntoIterator<Item = OsString>) -> anyhow::Result<Outcome> {
    run(&parsed(words)?.command)
}

/// The command line `words`. The examples of commands that `infer-cpu` has too are of this program.
fn parsed(words: impl IntoIterator<Item = OsString>) -> Result<Cli, clap::Error> {
    let command = Cli::command().mut_subcommands(|command| match command.get_after_help() {
        Some(help) => {
            let help = help.to_string().replace("infer-cpu ", "edgepuck ");
            command.after_help(help)
        }
        None => command,
    });
    outcome::parsed(command, words)
}

/// Runs `command`, which signals may end.
fn run_as_program(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        // `live` ends with the objects of the last packets.
        #[cfg(feature = "models")]
        Command::Infer(infer_cpu::cli::Command::Live(_)) => {}
        _ => signals::handle()?,
    }
    run(command)
}

fn run(command: &Command) -> anyhow::Result<Outcome> {
    formats::new_outputs::forget();
    match command {
        Command::GenDataset(args) => gen_dataset::run(args),
        Command::GenScenes(args) => gen_scenes::run(args),
        Command::GenDrive(args) => gen_drive::run(args),
        Command::GenShapes(args) => gen_shapes::run(args),
        Command::SampleSurfaces(args) => sample_surfaces::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Segment(args) => segment::run(args),
        Command::Weather(args) => weather::run(args),
        Command::Corrupt(args) => corrupt::run(args),
        #[cfg(feature = "models")]
        Command::Detect(args) => detect::run(args),
        Command::Preview(args) => preview_scan::run(args),
        Command::View(args) => view::run(args),
        Command::Profile(args) => profile::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::Adapters => adapters::run(),
        Command::MergeDataset(args) => merge_dataset::run(args),
        Command::Card(args) => card::run(args),
        Command::Cluster(args) => cluster::run(args),
        #[cfg(feature = "models")]
        Command::ImportWeights(args) => import_weights::run(args),
        #[cfg(feature = "models")]
        Command::ExportOnnx(args) => export_onnx::run(args),
        #[cfg(feature = "models")]
        Command::Train(command) => train::cli::run(command),
        #[cfg(feature = "models")]
        Command::Infer(command) => infer_cpu::cli::run(command),
        #[cfg(feature = "models")]
        Command::Advise(args) => advise::run(args),
        #[cfg(not(feature = "models"))]
        Command::Other(words) => {
            let word = words[0].to_string_lossy();
            Err(crate::Usage(format!(
                "expected a command, found `{word}`; this program was built without the commands of \
                 networks: `cargo install --path edgepuck` in a checkout builds it with them"
            ))
            .into())
        }
    }
}

#[cfg(all(test, feature = "models"))]
mod tests {
    use super::*;

    #[test]
    fn examples_in_help_are_of_this_program() {
        for command in ["classify", "sample", "inspect", "live", "bench"] {
            let help = parsed(["edgepuck", command, "--help"].map(OsString::from)).err().unwrap();
            let help = help.to_string();
            assert!(help.contains(&format!("  edgepuck {command} ")), "{help}");
            assert!(!help.contains("infer-cpu "), "{help}");
        }
    }

    #[test]
    fn the_commands_in_the_readmes_are_understood() {
        let mut n_commands = 0;
        for page in ["README.md", "edgepuck/README.md", "infer-cpu/README.md", "sim-gpu/EFFECTS.md"]
        {
            let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(page);
            let text = std::fs::read_to_string(file).unwrap().replace("\\\n", " ");
            for line in text.lines().filter_map(|line| line.strip_prefix("    ")) {
                let command = line.split(" #").next().unwrap_or(line);
                let command = command.split(" | ").next().unwrap_or(command);
                // `edgepuck` has the commands of `infer-cpu`, too.
                if command.starts_with("edgepuck ") || command.starts_with("infer-cpu ") {
                    // The number of `auto` is in the environment of a job.
                    let command = command.replace(" auto/", " 1/");
                    let quoted = command.split('\'').enumerate();
                    let words = quoted.flat_map(|(i, part)| match i % 2 {
                        0 => part.split_whitespace().collect(),
                        _ => vec![part],
                    });
                    let parsed = parsed(words.map(OsString::from));
                    assert!(parsed.is_ok(), "{page}: {command}: {}", parsed.err().unwrap());
                    n_commands += 1;
                }
            }
        }
        assert!(n_commands > 30, "{n_commands}");
    }
}
