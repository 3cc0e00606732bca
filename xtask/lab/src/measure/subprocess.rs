//! A subprocess that answers each line of input with a line of output.

use anyhow::{Context, Result, bail};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// The process; it ends when its input does.
pub struct Subprocess {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Subprocess {
    /// Starts `command`.
    ///
    /// # Errors
    /// If it does not start.
    pub fn start(command: &mut Command) -> Result<Self> {
        let starting = format!("starting {}", command.get_program().display());
        let piped = command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = piped.spawn().context(starting)?;
        let input = child.stdin.take();
        let output = BufReader::new(child.stdout.take().context("it has no output")?);
        Ok(Self { child, input, output })
    }

    /// Sends `line`.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn send(&mut self, line: &str) -> Result<()> {
        let input = self.input.as_mut().context("it has ended")?;
        writeln!(input, "{line}").context("it has ended")
    }

    /// Waits for the next line, which is returned without its end.
    ///
    /// # Errors
    /// If the process has ended.
    pub fn receive(&mut self) -> Result<String> {
        let mut line = String::new();
        if self.output.read_line(&mut line)? == 0 {
            bail!("it has ended");
        }
        Ok(line.trim_end().to_owned())
    }
}

impl Drop for Subprocess {
    fn drop(&mut self) {
        self.input = None;
        // Closing its input ends the process; its exit status does not matter.
        let _ = self.child.wait();
    }
}
