//! Commands that run in the background, in the time that other steps leave a core idle.

use anyhow::Context;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use xtask::workspace::{root, words};

/// A command that runs in the background, and the file of its output.
pub struct Meanwhile {
    child: Child,
    log: PathBuf,
}

impl Meanwhile {
    /// Starts `command`, whose output goes to `target/logs/NAME.log`.
    pub fn start(name: &str, command: &mut Command) -> anyhow::Result<Self> {
        let folder = root().join("target/logs");
        let log = folder.join(name).with_extension("log");
        fs::create_dir_all(folder)?;
        let output = File::create(&log).with_context(|| log.display().to_string())?;
        command.stdout(output.try_clone()?).stderr(output);
        let child = command.spawn().with_context(|| format!("cannot start {}", words(command)))?;
        Ok(Self { child, log })
    }

    /// Waits until the command ends. Returns its status and its output.
    pub fn end(mut self) -> anyhow::Result<(ExitStatus, String)> {
        let status = self.child.wait()?;
        Ok((status, String::from_utf8_lossy(&fs::read(&self.log)?).into_owned()))
    }
}

/// `command` at a low priority, where the system has such.
pub fn nice(command: &Command) -> Command {
    let program = command.get_program();
    let mut nice = Command::new(if cfg!(unix) { "nice".as_ref() } else { program });
    if cfg!(unix) {
        nice.arg(program);
    }
    let set = command.get_envs().filter_map(|(name, value)| Some((name, value?)));
    nice.args(command.get_args()).envs(set);
    nice.current_dir(command.get_current_dir().unwrap_or(root()));
    nice
}
