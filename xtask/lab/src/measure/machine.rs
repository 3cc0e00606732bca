//! The machine and the program of a benchmark record.

use serde::Serialize;
use sim_gpu::internals::gpu::{AdapterSummary, list_adapters};
use std::collections::BTreeMap;
use std::fs;
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

#[derive(Clone, Debug, Serialize)]
pub struct Machine {
    /// Seconds since 1970 at the start of the run.
    pub unix_time_s: u64,
    /// The arguments of the command, absolute paths without their folders.
    pub command: Vec<String>,
    pub version: &'static str,
    /// The commit of the working tree, `+` behind it if it has changes; `None`
    /// outside a clone.
    pub commit: Option<String>,
    /// The processor's name, where the system states it.
    pub cpu: Option<String>,
    pub threads: usize,
    pub system: String,
    /// Mean number of runnable threads over 1, 5 and 15 minutes, on Linux.
    pub load_average: Option<String>,
    /// The name, kind, backend and driver of each adapter.
    pub adapters: Vec<BTreeMap<&'static str, String>>,
}

impl Machine {
    pub fn here() -> Self {
        let now = SystemTime::now().duration_since(UNIX_EPOCH);
        Self {
            unix_time_s: now.map_or(0, |since| since.as_secs()),
            command: xtask::workspace::arguments(),
            version: env!("CARGO_PKG_VERSION"),
            commit: commit(),
            cpu: field("/proc/cpuinfo", "model name"),
            threads: rayon::current_num_threads(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
            load_average: load_average(),
            adapters: list_adapters().into_iter().map(described).collect(),
        }
    }
}

fn described(adapter: AdapterSummary) -> BTreeMap<&'static str, String> {
    let AdapterSummary { name, kind, backend, driver, .. } = adapter;
    let kind = kind.to_string();
    [("name", name), ("kind", kind), ("backend", backend), ("driver", driver)].into()
}

/// The peak memory of this process, bytes, where the system states it.
pub fn peak_memory_bytes() -> Option<u64> {
    let text = field("/proc/self/status", "VmHWM")?;
    let kibibytes: u64 = text.trim_end_matches("kB").trim().parse().ok()?;
    Some(kibibytes * 1024)
}

/// The value of the first line `key : value` in one of Linux's own files.
pub fn field(file: &str, key: &str) -> Option<String> {
    let text = fs::read_to_string(file).ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn load_average() -> Option<String> {
    let text = fs::read_to_string("/proc/loadavg").ok()?;
    Some(text.split_whitespace().take(3).collect::<Vec<_>>().join(" "))
}

fn commit() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git").args(arguments).output().ok()?;
        let text = String::from_utf8(output.stdout).ok()?;
        output.status.success().then(|| text.trim().to_owned())
    };
    let mut commit = git(&["rev-parse", "--short=12", "HEAD"])?;
    if git(&["status", "--porcelain"]).is_none_or(|changes| !changes.is_empty()) {
        commit.push('+');
    }
    Some(commit)
}
