//! The machine of a measurement.

use serde::Serialize;

#[derive(Serialize)]
pub struct Machine {
    processor: String,
    architecture: &'static str,
    /// Cores that this process may use.
    cores: usize,
    version: &'static str,
}

impl Machine {
    pub fn here() -> Self {
        Self {
            processor: processor().unwrap_or_else(|| "unknown".to_owned()),
            architecture: std::env::consts::ARCH,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            version: env!("CARGO_PKG_VERSION"),
        }
    }
}

/// The name of the board from its device tree, else of the processor from `cpuinfo`.
fn processor() -> Option<String> {
    if let Ok(board) = std::fs::read_to_string("/proc/device-tree/model") {
        return Some(board.trim_end_matches('\0').to_owned());
    }
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
