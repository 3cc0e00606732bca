//! The report of `--stats`.

use crate::live::{Pipeline, Stage};
use formats::counted;

use super::source::Read;

/// Prints times, counts and memory on standard error.
pub fn print(pipeline: &Pipeline, read: &Read) {
    let (counts, stats) = (pipeline.counts(), pipeline.stats());
    program::say!("{:<22} {:>8} {:>8} {:>8} {:>8}", "time a turn, ms", "mean", "p50", "p90", "p99");
    let total: f64 = Stage::ALL.into_iter().map(|stage| stats.mean_ms(stage)).sum();
    for stage in Stage::ALL {
        let [p50, p90, p99] = [0.5, 0.9, 0.99].map(|share| stats.stage_ms(stage, share));
        let (mean, name) = (stats.mean_ms(stage), stage.name());
        let share = 100.0 * mean / total.max(f64::MIN_POSITIVE);
        program::say!("{name:<22} {mean:>8.3} {p50:>8.3} {p90:>8.3} {p99:>8.3} {share:>5.0} %");
    }
    if let [Some(p50), Some(p90), Some(p99)] = [0.5, 0.9, 0.99].map(|share| stats.latency_ms(share))
    {
        program::say!("{:<22} {:>8} {p50:>8.3} {p90:>8.3} {p99:>8.3}", "latency, ms", "");
    }
    let [points, clusters] = stats.per_turn();
    program::say!(
        "{} of {points:.0} points and {clusters:.1} clusters on average",
        counted(stats.n_turns(), "turn")
    );
    program::say!(
        "{}{}; {} lost, {} late, {} duplicate, {} foreign, {} from other addresses, {} overrun, {}",
        counted(counts.packets, "packet"),
        read.capture,
        counts.lost,
        counts.late,
        counts.duplicated,
        counts.foreign,
        read.senders.n_dropped(),
        read.n_overrun,
        counted(counts.restarts, "restart")
    );
    program::say!(
        "{} dropped, {} too small for a class",
        counted(counts.dropped_points, "point"),
        counted(counts.unclassified, "cluster")
    );
    if let Some([now, most]) = resident_mib() {
        program::say!("{now:.1} MiB resident, {most:.1} MiB at most");
    }
}

/// The current and the largest resident memory, MiB, if the system reports them.
fn resident_mib() -> Option<[f64; 2]> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let mib = |key: &str| {
        let line = status.lines().find_map(|line| line.strip_prefix(key))?;
        line.trim_end_matches(" kB").trim().parse::<f64>().ok().map(|kib| kib / 1024.0)
    };
    Some([mib("VmRSS:")?, mib("VmHWM:")?])
}
