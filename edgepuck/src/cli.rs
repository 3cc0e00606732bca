//! The command line of `edgepuck`, for the program and for the Python package.

use crate::{
    Outcome, adapters, calibrate, corrupt, gen_dataset, gen_scenes, merge_dataset, outcome,
    profile, scan, signals, threads, view,
};
#[cfg(feature = "models")]
use crate::{advise, detect};
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
    /// Scan street scenes into labelled clusters, or drive through a street
    GenScenes(Box<gen_scenes::Args>),
    /// Scan one scene
    Scan(scan::Args),
    /// Add weather or faults of sensors to a recorded sweep
    Corrupt(Box<corrupt::CorruptArgs>),
    /// Find and classify the objects in a sweep
    #[cfg(feature = "models")]
    Detect(detect::DetectArgs),
    /// Show points, meshes, boxes and scenes: a page for the browser, or a picture
    View(view::Args),
    /// List the built-in sensors, or check and describe a sensor profile
    Profile(profile::ProfileArgs),
    /// Measure a sensor from captures or sweeps at rest, and write its profile
    Calibrate(calibrate::CalibrateArgs),
    /// Merge the shards of a dataset, or of a set of scenes, into one
    MergeDataset(merge_dataset::Args),
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

/// The commands by task, as `--help` lists them.
const TASKS: [(&str, &[&str]); 5] = [
    ("Scan", &["scan", "view", "profile", "calibrate", "corrupt"]),
    ("Data sets", &["gen-dataset", "gen-scenes", "merge-dataset"]),
    ("Networks", &["train", "eval", "explain", "classify", "sample", "inspect", "advise"]),
    ("Sweeps", &["detect", "live"]),
    ("Tools", &["bench"]),
];

/// The help of `command`, which lists the commands by task.
fn by_task(command: clap::Command) -> clap::Command {
    let mut list = String::new();
    for (task, names) in TASKS {
        list += &format!("{task}:\n");
        let present = names.iter().filter_map(|name| command.find_subcommand(name));
        for one in present {
            let about = one.get_about().map(ToString::to_string).unwrap_or_default();
            list += &format!("  {:<15}{about}\n", one.get_name());
        }
        list.push('\n');
    }
    list += outcome::EXIT_CODES;
    let template =
        "{about-with-newline}\n{usage-heading} {usage}{after-help}\n\nOptions:\n{options}";
    command.help_template(template).after_help(list)
}

/// Runs the command line `words`, which begins with the name of the program. Prints errors and
/// help, and returns the exit code.
pub fn main(words: impl IntoIterator<Item = OsString>) -> u8 {
    match parsed(words) {
        Ok(cli) => outcome::exit_code(run_as_program(&cli.command)),
        Err(error) if adapters::are_asked_for(&error) => outcome::exit_code(adapters::list()),
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
    outcome::parsed(by_task(command), words)
}

/// Runs `command`, which signals may end.
fn run_as_program(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        // `live` ends with the objects of the last packets.
        #[cfg(feature = "models")]
        Command::Infer(infer_cpu::cli::Command::Live(_)) => {}
        // Their threads are their own, of which `--threads` says how many there are.
        #[cfg(feature = "models")]
        Command::Infer(_) => signals::handle()?,
        Command::Profile(_) => signals::handle()?,
        _ => {
            signals::handle()?;
            // Data sets are made with two more for each.
            threads::start(if let Command::GenDataset(_) = command { 2 } else { 0 })?;
        }
    }
    run(command)
}

fn run(command: &Command) -> anyhow::Result<Outcome> {
    match command {
        Command::GenDataset(args) => gen_dataset::run(args),
        Command::GenScenes(args) => gen_scenes::run(args),
        Command::Scan(args) => scan::run(args),
        Command::Corrupt(args) => corrupt::run(args),
        #[cfg(feature = "models")]
        Command::Detect(args) => detect::run(args),
        Command::View(args) => view::run(args),
        Command::Profile(args) => profile::run(args),
        Command::Calibrate(args) => calibrate::run(args),
        Command::MergeDataset(args) => merge_dataset::run(args),
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
    fn help_lists_each_command_once_under_its_task() {
        let help = parsed(["edgepuck", "--help"].map(OsString::from)).err().unwrap().to_string();
        let command = Cli::command();
        let names: Vec<&str> = command.get_subcommands().map(clap::Command::get_name).collect();
        assert!(names.len() <= 18, "{names:?}");
        for name in names {
            assert_eq!(help.matches(&format!("\n  {name:<15}")).count(), 1, "{name}: {help}");
        }
    }

    /// The commands of a page: lines that are indented in a README, or of blocks of the documentation.
    fn commands(page: &std::path::Path) -> Vec<String> {
        let text = std::fs::read_to_string(page).expect("the page is a file").replace("\\\n", " ");
        let is_in_docs = page.parent().is_some_and(|folder| folder.ends_with("docs/src"));
        let mut is_shell = false;
        let lines = text.lines().filter_map(|line| match is_in_docs {
            true => {
                is_shell = line.starts_with("```sh") || (is_shell && !line.starts_with("```"));
                is_shell.then_some(line)
            }
            false => line.strip_prefix("    "),
        });
        // `edgepuck` has the commands of `infer-cpu`, too.
        let lines = lines
            .filter(|line| line.starts_with("edgepuck ") || line.starts_with("infer-cpu "))
            .map(|line| {
                let ends = [" #", " | ", " > ", " &"].iter().filter_map(|end| line.find(end));
                // The number of `auto` is in the environment of a job.
                line[..ends.min().unwrap_or(line.len())]
                    .replace(" auto/", " 1/")
                    .replace("$part", "1")
            });
        lines.collect()
    }

    #[test]
    fn the_commands_of_the_pages_are_understood() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let docs = std::fs::read_dir(root.join("docs/src")).unwrap();
        let docs = docs.map(|entry| entry.unwrap().path());
        let docs = docs.filter(|path| path.extension().is_some_and(|found| found == "md"));
        let readmes =
            ["README.md", "edgepuck/README.md", "infer-cpu/README.md", "sim-gpu/EFFECTS.md"];
        let pages: Vec<_> = readmes.iter().map(|page| root.join(page)).chain(docs).collect();
        let mut n_commands = 0;
        for page in pages {
            for command in commands(&page) {
                let quoted = command.split(['\'', '"']).enumerate();
                let words = quoted.flat_map(|(i, part)| match i % 2 {
                    0 => part.split_whitespace().collect(),
                    _ => vec![part],
                });
                let parsed = parsed(words.map(OsString::from));
                if let Some(error) = parsed.err().filter(|it| !adapters::are_asked_for(it)) {
                    panic!("{}: {command}: {error}", page.display());
                }
                n_commands += 1;
            }
        }
        assert!(n_commands > 60, "{n_commands}");
    }
}
