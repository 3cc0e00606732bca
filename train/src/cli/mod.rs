pub mod compare_points;
pub mod eval;
pub mod explain;
mod progress;
pub mod train;

use formats::outcome::Usage;
use std::io::Write;

fn print(line: &str) -> anyhow::Result<()> {
    Ok(writeln!(std::io::stdout(), "{line}")?)
}
