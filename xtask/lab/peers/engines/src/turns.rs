//! The talk between `cargo xtask bench infer` and one engine.

use anyhow::{Context, Result, bail};
use cpu_time::ProcessTime;
use serde_json::{Value, json};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Caches, branch predictors and thread pools of an engine that had to wait.
const UNCOUNTED: usize = 3;

/// Of each form of the model.
const TRIALS: usize = 7;

/// Runs a model once; its log-probabilities.
pub type Run = Box<dyn FnMut() -> Result<Vec<f32>>>;

/// Makes the model in a file ready for a cloud `[1, 3, n]` and that many
/// threads.
pub type Ready = fn(&Path, &[f32], usize) -> Result<Run>;

/// An engine that can be asked.
pub struct Engine {
    /// Of its crate.
    pub version: &'static str,
    /// Its way in.
    pub ready: Ready,
    /// The model in several forms, of which the fastest is run.
    pub files: Vec<PathBuf>,
    /// The largest cloud `[n, 3]`.
    pub points: Vec<f32>,
    /// What was loaded last.
    pub run: Option<Run>,
}

/// Answers the requests on standard input to `engine`.
///
/// # Errors
/// If standard input or output breaks.
pub fn serve(engine: Result<Engine>) -> Result<()> {
    let mut engine = match engine {
        Ok(engine) => engine,
        Err(error) => return say(&json!({ "error": format!("{error:#}") })),
    };
    say(&json!({ "version": engine.version }))?;
    for line in io::stdin().lines() {
        let answer = engine.answer(&line?);
        say(&answer.unwrap_or_else(|error| json!({ "error": format!("{error:#}") })))?;
    }
    Ok(())
}

fn say(message: &Value) -> Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{message}")?;
    Ok(out.flush()?)
}

impl Engine {
    fn answer(&mut self, request: &str) -> Result<Value> {
        match request.split_whitespace().collect::<Vec<_>>()[..] {
            ["load", size, threads] => self.load(size.parse()?, threads.parse()?),
            ["answer"] => Ok(json!({ "answer": self.loaded()?()? })),
            ["time", repeats] => {
                let timed = timed(self.loaded()?, repeats.parse()?)?;
                let (wall_ns, cpu_ns): (Vec<_>, Vec<_>) = timed.into_iter().unzip();
                Ok(json!({ "wall_ns": wall_ns, "cpu_ns": cpu_ns }))
            }
            _ => bail!("no such request: {request}"),
        }
    }

    fn loaded(&mut self) -> Result<&mut Run> {
        self.run.as_mut().context("nothing is loaded")
    }

    fn load(&mut self, size: usize, threads: usize) -> Result<Value> {
        let points = self.points.get(..3 * size).with_context(|| format!("no {size} points"))?;
        let axis = |axis| points.iter().skip(axis).step_by(3).copied();
        let x: Vec<f32> = (0..3).flat_map(axis).collect();
        let mut fastest = None;
        for file in &self.files {
            let mut run = (self.ready)(file, &x, threads)?;
            let least = timed(&mut run, TRIALS)?.into_iter().map(|(wall_ns, _)| wall_ns).min();
            if fastest.as_ref().is_none_or(|(best, _)| least < *best) {
                fastest = Some((least, run));
            }
        }
        self.run = fastest.map(|(_, run)| run);
        Ok(json!({}))
    }
}

/// Wall and CPU time of each of some runs, ns; the latter of all threads.
fn timed(run: &mut Run, repeats: usize) -> Result<Vec<(u64, u64)>> {
    for _ in 0..UNCOUNTED {
        run()?;
    }
    let once = || {
        let (wall, cpu) = (Instant::now(), ProcessTime::now());
        run()?;
        Ok((wall.elapsed().as_nanos() as u64, cpu.elapsed().as_nanos() as u64))
    };
    std::iter::repeat_with(once).take(repeats).collect()
}
