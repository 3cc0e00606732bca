//! `cargo xtask bench scale`: the cost of tasks of a million, a billion and a trillion scans as tars.

use crate::measure::clock::{Cost, Costs, Spread};
use crate::measure::machine::Machine;
use crate::render::table::{Column, Table, digits};
use anyhow::{Context, Result, ensure};
use clap::Args;
use edgepuck_dataset::PartManifest;
use formats::atomic;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tempfile::TempDir;
use xtask::workspace::{command_line, output, words};

#[derive(Args, Debug)]
pub struct ScaleArgs {
    /// Program to measure, which `cargo build --release -p edgepuck` builds.
    #[arg(default_value = "target/release/edgepuck")]
    program: PathBuf,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// A split has at most a million tars, so that those of the largest plan are larger.
const PLANS: [Plan; 3] = [
    Plan { scans: 1_000_000, tar_clouds: 65_536 },
    Plan { scans: 1_000_000_000, tar_clouds: 65_536 },
    Plan { scans: 1_000_000_000_000, tar_clouds: 1 << 20 },
];

/// Words about the tables.
const NOTES: &str = include_str!("notes.md");

pub fn run(args: &ScaleArgs) -> Result<()> {
    let (machine, program) = (Machine::here(), Program::new(&args.program)?);
    let mut start_ups = PLANS.map(Plan::no_tar);
    program.run(&mut start_ups, 3)?;
    let mut equal = [0, 1].map(|i| Plan { tar_clouds: 8192, ..PLANS[i] }.one_tar("clouds"));
    program.run(&mut equal, 5)?;
    let scans = Plan { tar_clouds: 16_384, ..PLANS[0] };
    let mut samples = [PLANS[0].one_tar("clouds"), scans.one_tar("scan")];
    program.run(&mut samples, 1)?;
    let cast_cpu_s = program.cast_cpu_s(20)?;
    let [small, large] = equal.each_ref().map(|task| task.costs.cpu_s().median);
    let tasks: Vec<Task> = start_ups.into_iter().chain(equal).chain(samples).collect();
    let mut text = heading(&machine, cast_cpu_s, small / large);
    text += &(measured(&tasks).markdown() + "\n");
    text += NOTES;
    print!("{text}");
    if let Some(file) = &args.report {
        atomic::write_bytes(file, &text)?;
    }
    Ok(())
}

fn heading(machine: &Machine, cast_cpu_s: f64, ratio: f64) -> String {
    let Machine { commit, cpu, threads, system, load_average, .. } = machine;
    let [commit, cpu, load] = [commit, cpu, load_average].map(|x| x.as_deref().unwrap_or("?"));
    format!(
        "# Tars of a million to a trillion scans\n\n    {}\n\nCommit {commit}; {cpu}, {threads} \
         threads, {system}, load {load}. A CPU-second makes {} times as many clouds of the plan \
         of 1e9 scans as of that of 1e6; aiming and casting take {} CPU-ms a scan.\n\n",
        command_line(),
        digits(ratio),
        digits(1e3 * cast_cpu_s),
    )
}

fn measured(tasks: &[Task]) -> Table {
    let spread = |Spread { median, min, max }: Spread| match min == max {
        true => digits(median),
        false => format!("{} ({} to {})", digits(median), digits(min), digits(max)),
    };
    let per = |x: u64, y: f64| if x > 0 { digits(x as f64 / y) } else { "-".to_owned() };
    let columns: [Column<Task>; 10] = [
        ("plan, scans", &|t| format!("{:e}", t.plan.scans)),
        ("sample", &|t| t.sample.to_owned()),
        ("clouds", &|t| t.clouds.to_string()),
        ("wall s", &|t| spread(t.costs.wall_s())),
        ("CPU s", &|t| spread(t.costs.cpu_s())),
        ("cores busy", &|t| digits(t.costs.cpu_s().median / t.costs.wall_s().median)),
        ("clouds/wall s", &|t| per(t.clouds, t.costs.wall_s().median)),
        ("clouds/CPU s", &|t| per(t.clouds, t.costs.cpu_s().median)),
        ("bytes/cloud", &|t| per(t.bytes, t.clouds as f64)),
        ("peak MB", &|t| digits(t.peak_bytes as f64 / 1e6)),
    ];
    Table::of("Tasks without a tar, and with one", tasks, &columns)
}

/// Built-in shapes to train and to test with, of 10 classes.
const SHAPES: [u64; 2] = [400, 100];
const VIEWS: &str = "--sensor vlp32c --distance 2,10 --elevation -10,40 --azimuth-jitter 180 \
                     --adapter cpu";

#[derive(Clone, Copy)]
struct Plan {
    scans: u64,
    tar_clouds: u64,
}

/// A part of a plan, and its costs in each round.
struct Task {
    plan: Plan,
    sample: &'static str,
    /// Its number from 1 in the first round, and the number of parts.
    shard: [u64; 2],
    costs: Costs,
    peak_bytes: u64,
    clouds: u64,
    bytes: u64,
}

struct Program {
    path: PathBuf,
    shapes: TempDir,
}

impl Plan {
    fn views(self) -> u64 {
        self.scans / SHAPES.iter().sum::<u64>()
    }

    /// Scans to train and to test with.
    fn splits(self) -> [u64; 2] {
        SHAPES.map(|shapes| shapes * self.views())
    }

    fn tars(self) -> [u64; 2] {
        self.splits().map(|scans| scans.div_ceil(self.tar_clouds))
    }

    fn task(self, sample: &'static str, shard: [u64; 2]) -> Task {
        let (plan, costs) = (self, Costs::default());
        Task { plan, sample, shard, costs, peak_bytes: 0, clouds: 0, bytes: 0 }
    }

    /// The task of the last but one tar to train with, which is whole: there are fewer to test with.
    fn one_tar(self, sample: &'static str) -> Task {
        let [train, _] = self.tars();
        self.task(sample, [train - 1, train])
    }

    /// A task without tars, since a split has fewer than a million.
    fn no_tar(self) -> Task {
        self.task("clouds", [1_000_000; 2])
    }
}

impl Task {
    /// The costs of tars differ: each round takes another one, a sixteenth of all tars before the
    /// last.
    fn shard_in(&self, round: u64) -> [u64; 2] {
        let [number, of] = self.shard;
        [number - round * (of / 16), of]
    }
}

impl Program {
    fn new(path: &Path) -> Result<Self> {
        let path = path.canonicalize().with_context(|| path.display().to_string())?;
        let shapes = tempfile::tempdir()?;
        let [train, test] = SHAPES.map(|shapes| (shapes / 10).to_string());
        let mut command = Command::new(&path);
        command.args(["gen-shapes", "--train", &train, "--test", &test, "--out"]);
        output(command.arg(shapes.path()))?;
        Ok(Self { path, shapes })
    }

    fn run(&self, tasks: &mut [Task], rounds: u64) -> Result<()> {
        let in_turns = |round| tasks.iter_mut().try_for_each(|task| self.run_once(task, round));
        (0..rounds).try_for_each(in_turns)
    }

    fn run_once(&self, task: &mut Task, round: u64) -> Result<()> {
        let (Task { plan, sample, .. }, [number, of]) = (&*task, task.shard_in(round));
        let (views, clouds) = (plan.views(), plan.tar_clouds);
        let out = tempfile::tempdir()?;
        let flags = format!(
            "--layout webdataset --views {views} --sample {sample} --tar-clouds {clouds} --shard {number}/{of}"
        );
        let (cost, peak_bytes, _) = self.gen_dataset(&flags, out.path())?;
        let part = format!("data/part-{:04}-of-{of:04}.json", number - 1);
        let part: PartManifest = serde_json::from_slice(&std::fs::read(out.path().join(part))?)?;
        task.costs.0.push(cost);
        task.peak_bytes = task.peak_bytes.max(peak_bytes);
        task.clouds = part.tars.iter().map(|tar| tar.clouds).sum();
        task.bytes = part.tars.iter().map(|tar| tar.bytes).sum();
        Ok(())
    }

    /// CPU-seconds that aiming and casting take of each scan of a dataset without tars, if threads
    /// wait as often in all of its stages.
    fn cast_cpu_s(&self, views: u64) -> Result<f64> {
        let out = tempfile::tempdir()?;
        let (cost, _, said) = self.gen_dataset(&format!("--views {views}"), out.path())?;
        let share = cast_share(&said).context("expected the seconds of each stage, found none")?;
        Ok(share * cost.cpu_s / (views * SHAPES.iter().sum::<u64>()) as f64)
    }

    /// Makes a dataset in `out`/data; returns the cost, the peak memory in bytes, and the program's
    /// messages.
    fn gen_dataset(&self, flags: &str, out: &Path) -> Result<(Cost, u64, String)> {
        let usage = out.join("usage");
        let mut command = Command::new("time");
        command.args(["--quiet", "--format", "%U %S %M", "--output"]).arg(&usage).arg(&self.path);
        command.arg("gen-dataset").arg(self.shapes.path()).args(VIEWS.split_whitespace());
        command.args(flags.split_whitespace()).arg("--out").arg(out.join("data"));
        let start = Instant::now();
        let output = command.output().context("running GNU time, of the Debian package time")?;
        let wall_s = start.elapsed().as_secs_f64();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        // 3: all is done, but for shapes that too few beams hit from afar.
        let is_done = matches!(output.status.code(), Some(0 | 3));
        ensure!(is_done, "{} failed ({}): {said}", words(&command), output.status);
        let usage = std::fs::read_to_string(usage)?;
        let figures: Vec<f64> = usage.split_whitespace().flat_map(str::parse).collect();
        ensure!(figures.len() == 3, "expected three figures of GNU time, found {usage}");
        let cost = Cost { wall_s, cpu_s: figures[0] + figures[1] };
        Ok((cost, figures[2] as u64 * 1024, said))
    }
}

/// The share of aiming, which GPUs do too, and casting in the seconds of a summary.
fn cast_share(said: &str) -> Option<f64> {
    let stages = said.lines().find_map(|line| line.strip_prefix("seconds over all threads: "))?;
    let (mut cast, mut all) = (0.0, 0.0);
    for stage in stages.split(", ") {
        let (name, seconds) = stage.split_once(' ')?;
        let seconds: f64 = seconds.parse().ok()?;
        all += seconds;
        cast += if ["aim", "cast"].contains(&name) { seconds } else { 0.0 };
    }
    Some(cast / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_task_has_one_whole_tar_and_a_plan_fewer_than_a_million() {
        let plan = Plan { scans: 1_000_000, tar_clouds: 65_536 };
        assert_eq!((plan.splits(), plan.tars()), ([800_000, 200_000], [13, 4]));
        assert_eq!(plan.one_tar("scan").shard_in(0), [12, 13]);
        let (small, large) =
            (Plan { tar_clouds: 8192, ..plan }, Plan { scans: 1 << 40, tar_clouds: 1 << 20 });
        assert_eq!((small.tars(), small.one_tar("scan").shard_in(4)), ([98, 25], [73, 98]));
        assert!(large.no_tar().shard_in(2)[0] > large.tars()[0]);
    }
}
