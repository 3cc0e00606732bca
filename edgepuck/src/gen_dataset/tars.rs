//! `gen-dataset --layout webdataset`: makes tars and hands each over when it is complete.

use super::{report_failures, summary};
use crate::flags::first_given;
use crate::{Outcome, shell, signals};
use edgepuck_dataset::{Cut, HandOver, Plan, Progress, Sample, TarRecord, Tars, make_tars};
use formats::counted;
use sim_gpu::Caster;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering::SeqCst};
use std::time::Duration;

/// Pauses before a command is tried again, seconds.
const PAUSES_S: [u64; 3] = [1, 4, 16];

const TAR_CLOUDS: u32 = 65_536;

#[derive(clap::Args)]
#[command(next_help_heading = "Tars (--layout webdataset)")]
pub struct TarArgs {
    /// What a sample of a tar is: `clouds` (1,024 packed clouds with their labels) or `scan` (one scan,
    /// its label and what it is of)
    #[arg(long, default_value = "clouds", value_name = "clouds|scan", hide_short_help = true)]
    sample: Sample,

    /// Number of clouds or scans in each tar; by default a tar of clouds of 1,024 points takes 800 MB
    #[arg(long, default_value_t = TAR_CLOUDS, value_name = "N", hide_short_help = true,
          value_parser = clap::value_parser!(u32).range(1..))]
    tar_clouds: u32,

    /// Command of the shell to run when a tar is complete, with its path in place of {}, such as
    /// 'rclone copyto {} remote:bucket/{name}'; {name} is the name of its file. Both are quoted
    /// already. A command that fails is tried four times
    #[arg(long, value_name = "COMMAND", hide_short_help = true)]
    on_shard: Option<String>,
}

impl TarArgs {
    /// A flag that was given.
    pub fn given(&self) -> Option<&'static str> {
        first_given(&[
            (self.sample != Sample::default(), "--sample"),
            (self.tar_clouds != TAR_CLOUDS, "--tar-clouds"),
            (self.on_shard.is_some(), "--on-shard"),
        ])
    }
}

pub fn run(
    args: &TarArgs,
    plan: &Plan,
    caster: &Caster,
    progress: &Progress,
) -> anyhow::Result<Outcome> {
    let command = args.on_shard.as_ref();
    let hand_over = command.map(|command| |tar: &Path| hand_over(command, tar, &progress.stop));
    let tars = Tars {
        cut: Cut { sample: args.sample, clouds_per_tar: args.tar_clouds },
        on_made: &|TarRecord { file, clouds, bytes, .. }| {
            program::say!("{file}: {}, {} MiB", counted(*clouds, "cloud"), bytes >> 20);
        },
        hand_over: hand_over.as_ref().map(|hand_over| hand_over as HandOver),
    };
    let made = signals::stop(progress, || make_tars(plan, &tars, caster, progress))?;

    let mut failures: Vec<_> = made.tars.iter().flat_map(|tar| tar.failures.clone()).collect();
    failures.sort_by(|p, q| p.source.cmp(&q.source));
    failures.dedup_by(|p, q| p.source == q.source);
    summary::print_notes(&progress.notes());
    report_failures(&failures);
    let clouds: u64 = made.tars.iter().map(|tar| tar.clouds).sum();
    let bytes: u64 = made.tars.iter().map(|tar| tar.bytes).sum();
    let (tars, clouds) = (counted(made.tars.len(), "tar"), counted(clouds, "cloud"));
    program::say!("{tars}, {clouds}, {} MiB: {}", bytes >> 20, plan.out.display());
    Ok(if failures.is_empty() { Outcome::Success } else { Outcome::SomeRefused })
}

/// Runs `command` for the file `tar` until it succeeds; the error is the cause of the last failure.
fn hand_over(command: &str, tar: &Path, stop: &AtomicBool) -> Result<(), String> {
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
        program::say!("{cause}; trying again in {pause_s} s");
        for _ in 0..10 * pause_s {
            if stop.load(SeqCst) {
                return Err(cause);
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    }
}
