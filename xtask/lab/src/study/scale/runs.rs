//! Runs of the program, and what they cost.

use crate::measure::clock::{Cost, Costs};
use anyhow::{Context, Result, ensure};
use edgepuck_dataset::tars::PartManifest;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;
use tempfile::TempDir;
use xtask::workspace::{output, words};

/// Built-in shapes to train and to test with, of 10 classes.
const SHAPES: [u64; 2] = [400, 100];
/// How each shape is seen.
const VIEWS: &str = "--sensor vlp32c --distance 2,10 --elevation -10,40 --azimuth-jitter 180 \
                     --adapter cpu";

/// A dataset of tars.
#[derive(Clone, Copy)]
pub struct Plan {
    pub scans: u64,
    pub tar_clouds: u64,
}

/// A part of a plan, and what it cost in each round.
pub struct Task {
    pub plan: Plan,
    pub sample: &'static str,
    /// Its number from 1 in the first round, and of how many.
    shard: [u64; 2],
    pub costs: Costs,
    pub peak_bytes: u64,
    pub clouds: u64,
    pub bytes: u64,
}

/// The program, and the shapes that it scans.
pub struct Program {
    path: PathBuf,
    shapes: TempDir,
}

impl Plan {
    fn views(self) -> u64 {
        self.scans / SHAPES.iter().sum::<u64>()
    }

    /// Scans to train and to test with.
    pub fn splits(self) -> [u64; 2] {
        SHAPES.map(|shapes| shapes * self.views())
    }

    pub fn tars(self) -> [u64; 2] {
        self.splits().map(|scans| scans.div_ceil(self.tar_clouds))
    }

    fn task(self, sample: &'static str, shard: [u64; 2]) -> Task {
        let (plan, costs) = (self, Costs::default());
        Task { plan, sample, shard, costs, peak_bytes: 0, clouds: 0, bytes: 0 }
    }

    /// The task of the last but one tar to train with, which is whole: there are fewer to test with.
    pub fn one_tar(self, sample: &'static str) -> Task {
        let [train, _] = self.tars();
        self.task(sample, [train - 1, train])
    }

    /// A task without tars, since a split has fewer than a million.
    pub fn no_tar(self) -> Task {
        self.task("clouds", [1_000_000; 2])
    }
}

impl Task {
    /// Tars differ in what they cost: each round takes another, a sixteenth of all tars before the last.
    fn shard_in(&self, round: u64) -> [u64; 2] {
        let [number, of] = self.shard;
        [number - round * (of / 16), of]
    }
}

impl Program {
    pub fn new(path: &Path) -> Result<Self> {
        let path = path.canonicalize().with_context(|| path.display().to_string())?;
        let shapes = tempfile::tempdir()?;
        let [train, test] = SHAPES.map(|shapes| (shapes / 10).to_string());
        let mut command = Command::new(&path);
        command.args(["gen-shapes", "--train", &train, "--test", &test, "--out"]);
        output(command.arg(shapes.path()))?;
        Ok(Self { path, shapes })
    }

    /// Runs all `tasks` in turns, `rounds` times.
    pub fn run(&self, tasks: &mut [Task], rounds: u64) -> Result<()> {
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
    pub fn cast_cpu_s(&self, views: u64) -> Result<f64> {
        let out = tempfile::tempdir()?;
        let (cost, _, said) = self.gen_dataset(&format!("--views {views}"), out.path())?;
        let share = cast_share(&said).context("expected the seconds of each stage, found none")?;
        Ok(share * cost.cpu_s / (views * SHAPES.iter().sum::<u64>()) as f64)
    }

    /// Makes a dataset in `out`/data; returns also the most bytes of memory, and what was said.
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

/// Which share of its seconds a summary gives to aiming, which GPUs do too, and casting.
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

    #[test]
    fn aiming_and_casting_have_a_share() {
        let said = "10 rays\nseconds over all threads: read 2.0, aim 0.5, cast 1.5\nDataset: o";
        assert_eq!(cast_share(said), Some(0.5));
        assert_eq!(cast_share("seconds over all threads: read two"), None);
    }
}
