//! Classifies clouds without a GPU.

mod cli;

use clap::Parser;

#[derive(Parser)]
#[command(version)]
enum Cli {
    /// Measure this machine
    Bench(cli::bench::Args),
}

fn main() -> anyhow::Result<()> {
    let Cli::Bench(args) = Cli::parse();
    let model = args.model.clone().unwrap_or_default();
    cli::bench::run(&args, &model)
}
