//! The one command line of an Edgepuck workstation.

use clap::Parser;

mod bench;

#[derive(Parser)]
#[command(version, about)]
enum Command {
    /// Measure speed and accuracy.
    Bench(bench::BenchArgs),
}

fn main() -> anyhow::Result<()> {
    match Command::parse() {
        Command::Bench(args) => bench::run(&args),
    }
}
