//! `gen-dataset --layout webdataset`: tars, each of which is handed over when it is complete.

use crate::{Outcome, Usage, shell};
use edgepuck_dataset::config::DatasetConfig;
use edgepuck_dataset::layout;
use edgepuck_dataset::publish::retract;
use edgepuck_dataset::tars::{self, Cut, HandOver, PartManifest, Run, Sample};
use edgepuck_dataset::{DatasetError, check_layouts};
use signal_hook::consts::{SIGINT, SIGTERM};
use sim_gpu::internals::mesh::tree::MeshEntry;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Duration;

/// How often a command is tried, with a pause of this many seconds before it is tried again.
const PAUSES_S: [u64; 3] = [1, 4, 16];

/// Flags of tars.
#[derive(clap::Args)]
#[command(next_help_heading = "Tars (--layout webdataset)")]
pub struct TarArgs {
    /// What a sample of a tar is: `clouds` (1,024 packed clouds with their labels) or `scan` (one scan,
    /// its label and what it is of)
    #[arg(long, default_value = "clouds", value_name = "clouds|scan")]
    sample: Sample,

    /// Number of clouds or scans in each tar; by default a tar of clouds of 1,024 points takes 800 MB
    #[arg(long, default_value_t = 65_536, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    tar_clouds: u32,

    /// Command of the shell to run when a tar is complete, with its path in place of {}, such as
    /// 'rclone copyto {} remote:bucket/{name}'; {name} is the name of its file. Both are quoted
    /// already. A command that fails is tried four times
    #[arg(long, value_name = "COMMAND")]
    on_shard: Option<String>,
}

/// Makes the tars of one part of the dataset.
pub fn run(
    args: &super::Args,
    out: &Path,
    config: &DatasetConfig,
    meshes: &[MeshEntry],
) -> anyhow::Result<Outcome> {
    check(config)?;
    let part = args.shard.map_or((0, 1), |shard| (shard.number, shard.of));
    let caster = args.caster.open(&config.cast_effects())?;
    refuse_what_is_there(args, out, part)?;
    let is_over = Arc::new(AtomicBool::new(false));
    // A second Ctrl-C ends the program at once; schedulers may repeat SIGTERM.
    signal_hook::flag::register_conditional_default(SIGINT, Arc::clone(&is_over))?;
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&is_over))?;
    }
    let TarArgs { sample, tar_clouds, on_shard } = &args.tars;
    let hands_over = on_shard.as_ref().map(|command| {
        let is_over = Arc::clone(&is_over);
        move |tar: &Path| hand_over(command, tar, &is_over)
    });
    let run = Run {
        out,
        config,
        cut: Cut { sample: *sample, clouds_per_tar: *tar_clouds },
        part,
        caster: &caster,
        is_over: &is_over,
        hand_over: hands_over.as_ref().map(|hand_over| hand_over as HandOver),
        say: &|line| eprintln!("{line}"),
    };
    match tars::make(&run, meshes) {
        Ok(made) => Ok(end(out, &made)),
        Err(stopped @ DatasetError::Interrupted { .. }) => {
            eprintln!("{}: {stopped}", out.display());
            Ok(Outcome::Interrupted)
        }
        Err(error) => Err(error.into()),
    }
}

/// Checks that tars can hold what is asked for.
pub fn check(config: &DatasetConfig) -> anyhow::Result<()> {
    check_layouts(config, &[])?;
    if config.simplify.is_some() {
        let cause = "--simplify does not go with --layout webdataset, which reads a mesh again for \
                     each tar";
        return Err(Usage(cause.to_owned()).into());
    }
    Ok(())
}

/// Tars of this part that are there are gone on with or made anew only if that is asked for. What is not
/// ours, or another part's, stays.
fn refuse_what_is_there(args: &super::Args, out: &Path, part: (u32, u32)) -> anyhow::Result<()> {
    let occupied = |what| DatasetError::Occupied { path: out.to_owned(), what };
    if layout::manifest(out).exists() || layout::journal(out).exists() {
        return Err(occupied("a dataset of another layout").into());
    }
    if args.overwrite {
        retract(out)?;
    }
    let there = std::fs::read_dir(out).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_own = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| tars::is_of_part(name, part))
    };
    for path in there.filter(|path| is_own(path)) {
        if args.overwrite {
            std::fs::remove_file(&path)?;
        } else if !args.resume {
            return Err(occupied("tars").into());
        }
    }
    Ok(())
}

fn end(out: &Path, made: &PartManifest) -> Outcome {
    let mut failures: Vec<_> = made.tars.iter().flat_map(|tar| &tar.failures).collect();
    failures.sort_by(|p, q| p.source.cmp(&q.source));
    failures.dedup_by(|p, q| p.source == q.source);
    for failure in &failures {
        eprintln!("failed: {failure}");
    }
    let clouds: u64 = made.tars.iter().map(|tar| tar.clouds).sum();
    let bytes: u64 = made.tars.iter().map(|tar| tar.bytes).sum();
    let (tars, mib) = (made.tars.len(), bytes >> 20);
    eprintln!("{tars} tars, {clouds} clouds, {mib} MiB: {}", out.display());
    if failures.is_empty() { Outcome::Success } else { Outcome::SomeRefused }
}

/// Runs `command` for the file `tar` until it succeeds, or says why it did not.
fn hand_over(command: &str, tar: &Path, is_over: &AtomicBool) -> Result<(), String> {
    let name = tar.file_name().unwrap_or_default().to_string_lossy();
    let words = command
        .replace("{name}", &shell::quoted(&name))
        .replace("{}", &shell::quoted(&tar.to_string_lossy()));
    let mut pauses_s = PAUSES_S.iter();
    loop {
        let cause = match shell::command(&words).status() {
            Ok(status) if status.success() => return Ok(()),
            Ok(status) => format!("`{words}` ended with {status}"),
            Err(error) => format!("the shell: {error}"),
        };
        let Some(&pause_s) = pauses_s.next() else { return Err(cause) };
        eprintln!("{cause}; trying again in {pause_s} s");
        for _ in 0..10 * pause_s {
            if is_over.load(SeqCst) {
                return Err(cause);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}
