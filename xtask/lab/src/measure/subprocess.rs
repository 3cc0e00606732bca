//! A program that takes requests, one a line, and answers each with a line of JSON.

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::fmt::Display;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The process; it ends when its input is closed.
pub struct Subprocess {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Message<T> {
    Failed { error: String },
    Answered(T),
}

impl Subprocess {
    /// Starts `command`, and returns its greeting. Fails if it does not start, or reports that it
    /// cannot work here.
    pub fn start<T: DeserializeOwned>(command: &mut Command) -> Result<(Self, T)> {
        let starting = format!("starting {}", command.get_program().display());
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = piped.spawn().context(starting)?;
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().context("it has no output")?);
        let mut process = Self { child, input, output };
        let greeting = process.answer()?;
        Ok((process, greeting))
    }

    /// Sends `request`, a line, and waits for the answer, which may be an error.
    pub fn ask<T: DeserializeOwned>(&mut self, request: impl Display) -> Result<T> {
        let input = self.input.as_mut().context("it has ended")?;
        writeln!(input, "{request}").context("it has ended")?;
        self.answer()
    }

    fn answer<T: DeserializeOwned>(&mut self) -> Result<T> {
        let mut line = String::new();
        if self.output.read_line(&mut line)? == 0 {
            bail!("it has ended");
        }
        parse(line.trim_end())
    }
}

impl Drop for Subprocess {
    fn drop(&mut self) {
        self.input = None;
        // Closing its input ends the process; its exit status does not matter.
        let _ = self.child.wait();
    }
}

fn parse<T: DeserializeOwned>(line: &str) -> Result<T> {
    match serde_json::from_str(line) {
        Ok(Message::Answered(answer)) => Ok(answer),
        Ok(Message::Failed { error }) => bail!("{error}"),
        Err(_) => bail!("expected JSON, found {line}"),
    }
}
