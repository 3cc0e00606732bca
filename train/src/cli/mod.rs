//! The commands of `edgepuck-train`, what ends them, and the exit code it gives.

pub mod compare_points;
pub mod eval;
pub mod explain;
pub mod serve;
pub mod train;

use formats::outcome::Usage;
use std::io::Write;

/// Writes a line to standard output.
///
/// # Errors
/// What the system reports.
fn print(line: &str) -> anyhow::Result<()> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}
