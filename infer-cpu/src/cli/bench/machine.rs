//! The machine that figures belong to.

use serde::Serialize;

/// What a record of figures says about where they were measured.
#[derive(Serialize)]
pub struct Machine {
    /// The processor's name, as the system has it.
    processor: String,
    /// Its architecture.
    architecture: &'static str,
    /// Cores that this process may use.
    cores: usize,
    /// The version of this program.
    version: &'static str,
}

impl Machine {
    /// This machine.
    pub fn here() -> Self {
        Self {
            processor: processor().unwrap_or_else(|| "unknown".to_owned()),
            architecture: std::env::consts::ARCH,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// A board's name from its device tree, else the processor's from `cpuinfo`.
fn processor() -> Option<String> {
    if let Ok(board) = std::fs::read_to_string("/proc/device-tree/model") {
        return Some(board.trim_end_matches('\0').to_owned());
    }
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
