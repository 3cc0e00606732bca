//! A process of its own that answers lines with lines.

use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The process; it ends when its input does.
pub struct Companion {
    child: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
}

impl Companion {
    /// Starts `command`.
    ///
    /// # Errors
    /// If it does not start.
    pub fn start(command: &mut Command) -> Result<Self> {
        let starting = format!("starting {}", command.get_program().display());
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = piped.spawn().context(starting)?;
        let requests = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().context("it has no output")?);
        Ok(Self { child, requests, answers })
    }

    /// Sends `request`.
    ///
    /// # Errors
    /// If it has ended.
    pub fn tell(&mut self, request: &str) -> Result<()> {
        let requests = self.requests.as_mut().context("it has ended")?;
        writeln!(requests, "{request}").context("it has ended")
    }

    /// Waits for its next line, without the line's end.
    ///
    /// # Errors
    /// If it has ended.
    pub fn hear(&mut self) -> Result<String> {
        let mut line = String::new();
        if self.answers.read_line(&mut line)? == 0 {
            bail!("it has ended");
        }
        Ok(line.trim_end().to_owned())
    }
}

impl Drop for Companion {
    fn drop(&mut self) {
        self.requests = None;
        // Its input is closed, so it ends; how does not matter any more.
        let _ = self.child.wait();
    }
}
