//! Publishes the objects or the recording of `infer-cpu live` as a node of ROS 2, without ROS.

mod input;
mod publisher;

use std::io::{self, BufReader};
use std::process::ExitCode;

use clap::Parser;
use program::outcome::{Outcome, exit_code};

use publisher::Publisher;

/// Publish the objects of `infer-cpu live` as ROS 2 messages
#[derive(Parser)]
#[command(version, max_term_width = 100)]
#[command(after_help = include_str!("help.txt"))]
struct Args {
    /// DDS domain
    #[arg(long, value_name = "N", env = "ROS_DOMAIN_ID", default_value_t = 0)]
    #[arg(value_parser = clap::value_parser!(u16).range(0..=232))]
    domain: u16,

    /// Name of the node
    #[arg(long, value_name = "NAME", default_value = "edgepuck")]
    node: String,
}

fn main() -> ExitCode {
    exit_code(run(&Args::parse())).into()
}

fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut publisher = Publisher::new(args.domain, &args.node)?;
    input::read(BufReader::new(io::stdin().lock()), |message| publisher.publish(message))?;
    publisher.finish();
    Ok(Outcome::Success)
}
