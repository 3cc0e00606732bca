//! The commands of `edgepuck-train`.

pub mod compare_points;
pub mod eval;
pub mod explain;
mod progress;
pub mod serve;
pub mod train;

use formats::outcome::Usage;
use std::io::Write;

/// Writes a line to standard output.
fn print(line: &str) -> anyhow::Result<()> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}
