//! A rival in a subprocess, so that its threads and its memory are separate from ours. The protocol is described in `peers/infer/turns.py`.

use super::candidate::{Engine, Job};
use crate::measure::clock::Cost;
use crate::measure::subprocess::Subprocess;
use anyhow::{Result, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::process::Command;

/// A running rival.
pub struct Server {
    process: Subprocess,
    /// Of its package.
    pub version: String,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Message<T> {
    Failed { error: String },
    Answered(T),
}

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
    /// Starts `command`.
    ///
    /// # Errors
    /// If it does not start, or reports that its engine is not available.
    pub fn start(command: &mut Command) -> Result<Self> {
        let mut process = Subprocess::start(command)?;
        let Hello { version } = parse(&process.receive()?)?;
        Ok(Self { process, version })
    }

    fn ask<T: DeserializeOwned>(&mut self, request: &str) -> Result<T> {
        self.process.send(request)?;
        parse(&self.process.receive()?)
    }
}

fn parse<T: DeserializeOwned>(line: &str) -> Result<T> {
    match serde_json::from_str(line) {
        Ok(Message::Answered(answer)) => Ok(answer),
        Ok(Message::Failed { error }) => bail!("{error}"),
        Err(_) => bail!("expected JSON, found {line}"),
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
    fn load(&mut self, job: Job) -> Result<()> {
        self.ask(&format!("load {} {}", job.points, job.setting)).map(|Done {}| ())
    }

    fn answer(&mut self) -> Result<Vec<f64>> {
        self.ask("answer").map(|Answer { answer }| answer)
    }

    fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
        self.ask(&format!("time {repeats}")).map(Times::costs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds() {
        let times: Times = parse(r#"{"wall_ns": [1500000, 7], "cpu_ns": [3000000, 6]}"#).unwrap();
        let costs = times.costs();
        assert!((costs[0].wall_s - 1.5e-3).abs() < 1e-15);
        assert!((costs[0].cpu_s - 3e-3).abs() < 1e-15);
        assert_eq!(costs.len(), 2);
    }

    #[test]
    fn an_error_has_the_rivals_words() {
        let error_of = |line: &str| parse::<Answer>(line).map(|_| ()).unwrap_err().to_string();
        assert_eq!(error_of(r#"{"error": "no such request: x"}"#), "no such request: x");
        assert_eq!(error_of("Segmentation fault"), "expected JSON, found Segmentation fault");
        assert_eq!(error_of("{}"), "expected JSON, found {}");
        assert!(parse::<Done>("{}").is_ok());
    }

    #[cfg(unix)]
    #[test]
    fn a_rival_that_ends_is_an_error() {
        let ended = Server::start(&mut Command::new("true"));
        assert_eq!(ended.err().map(|error| error.to_string()).as_deref(), Some("it has ended"));
        let script = r#"echo '{"version": "1"}'; read request; echo '{}'"#;
        let mut server = Server::start(Command::new("sh").args(["-c", script])).unwrap();
        assert_eq!(server.version, "1");
        server.load(Job { points: 4, setting: 1 }).unwrap();
        assert!(server.answer().is_err());
    }
}
