//! Commands that run beside other steps, so that no core is idle.

use anyhow::Context;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use xtask::workspace::{root, words};

/// A command that runs, and the file of what it says.
pub struct Meanwhile {
    child: Child,
    log: PathBuf,
}

impl Meanwhile {
    /// Starts `command`, whose output goes to a log of this name.
    pub fn start(name: &str, command: &mut Command) -> anyhow::Result<Self> {
        let folder = root().join("target/logs");
        let log = folder.join(name).with_extension("log");
        fs::create_dir_all(folder)?;
        let output = File::create(&log).with_context(|| log.display().to_string())?;
        command.stdout(output.try_clone()?).stderr(output);
        let child = command.spawn().with_context(|| format!("cannot start {}", words(command)))?;
        Ok(Self { child, log })
    }

    /// Waits for its end; gives how it ended and what it said.
    pub fn end(mut self) -> anyhow::Result<(ExitStatus, String)> {
        let status = self.child.wait()?;
        Ok((status, String::from_utf8_lossy(&fs::read(&self.log)?).into_owned()))
    }
}
