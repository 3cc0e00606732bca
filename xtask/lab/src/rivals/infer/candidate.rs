//! The candidates of a comparison: engines in this process, and rivals in a subprocess, so that
//! their threads and memory are separate. `peers/infer/turns.py` describes the protocol.

use crate::measure::clock::Cost;
use crate::measure::subprocess::Subprocess;
use anyhow::Result;
use serde::{Deserialize, Serialize};
use std::process::Command;

/// Does the work that is timed. Every method fails if the work cannot be done.
pub trait Engine {
    fn load(&mut self, job: Job) -> Result<()>;

    /// Does the loaded job once and returns its answer: log-probabilities, the indices of
    /// the points kept, or losses.
    fn answer(&mut self) -> Result<Vec<f64>>;

    /// Does the loaded job a few times uncounted and then `repeats` times; the cost of
    /// each of the latter.
    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>>;
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Job {
    pub points: usize,
    /// Threads of a classifier, points that a sampler keeps, clouds of a batch.
    pub setting: usize,
}

/// The arithmetic of an engine, in the order of the tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Arithmetic {
    F32,
    /// f16 or bf16, at least for weights.
    Half,
    I8,
}

#[derive(Clone, Debug, Serialize)]
pub struct Label {
    /// Its name in `--engines`.
    #[serde(rename = "engine")]
    pub name: String,
    pub arithmetic: Arithmetic,
    pub ours: bool,
}

pub struct Candidate {
    pub label: Label,
    pub version: String,
    pub engine: Box<dyn Engine>,
}

impl Candidate {
    pub fn ours(name: String, arithmetic: Arithmetic, engine: impl Engine + 'static) -> Self {
        let label = Label { name, arithmetic, ours: true };
        Self { label, version: env!("CARGO_PKG_VERSION").to_owned(), engine: Box::new(engine) }
    }
}

pub struct Server(Subprocess);

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Done {}

#[derive(Deserialize)]
struct Hello {
    version: String,
}

#[derive(Deserialize)]
struct Answer {
    answer: Vec<f64>,
}

#[derive(Deserialize)]
struct Times {
    wall_ns: Vec<u64>,
    cpu_ns: Vec<u64>,
}

impl Server {
    /// Starts `command`; returns the version of its engine, too.
    pub fn start(command: &mut Command) -> Result<(Self, String)> {
        let (process, Hello { version }) = Subprocess::start(command)?;
        Ok((Self(process), version))
    }
}

impl Times {
    fn costs(self) -> Vec<Cost> {
        let seconds = |ns: u64| ns as f64 * 1e-9;
        let pairs = self.wall_ns.into_iter().zip(self.cpu_ns);
        pairs.map(|(wall, cpu)| Cost { wall_s: seconds(wall), cpu_s: seconds(cpu) }).collect()
    }
}

impl Engine for Server {
    fn load(&mut self, Job { points, setting }: Job) -> Result<()> {
        self.0.ask(format_args!("load {points} {setting}")).map(|Done {}| ())
    }

    fn answer(&mut self) -> Result<Vec<f64>> {
        self.0.ask("answer").map(|Answer { answer }| answer)
    }

    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
        self.0.ask(format_args!("time {repeats}")).map(Times::costs)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_rival_answers_until_it_ends() {
        let error_of =
            |started: Result<_>| started.map(|_: (Server, _)| ()).unwrap_err().to_string();
        assert_eq!(error_of(Server::start(&mut Command::new("true"))), "it has ended");
        let script = r#"echo '{"version": "1"}'; read request; echo '{}'; read request
            echo '{"wall_ns": [1500000, 7], "cpu_ns": [3000000, 6]}'; read request; echo '{}'"#;
        let (mut server, version) = Server::start(Command::new("sh").args(["-c", script])).unwrap();
        assert_eq!(version, "1");
        server.load(Job { points: 4, setting: 1 }).unwrap();
        let costs = server.time(2).unwrap();
        assert!((costs[0].wall_s - 1.5e-3).abs() < 1e-15, "{costs:?}");
        assert!((costs[0].cpu_s - 3e-3).abs() < 1e-15, "{costs:?}");
        assert_eq!(costs.len(), 2);
        assert_eq!(server.answer().unwrap_err().to_string(), "expected JSON, found {}");
        assert_eq!(server.answer().unwrap_err().to_string(), "it has ended");
    }
}
