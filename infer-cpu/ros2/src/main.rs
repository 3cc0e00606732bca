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
#[command(after_help = "\
Examples:
  infer-cpu live --udp 2368 | edgepuck-ros2
  infer-cpu live --udp 2368 --mcap /dev/stdout | edgepuck-ros2 --domain 7

Standard input is either the JSON lines of `infer-cpu live` or its recording. Of lines, the objects
of a turn are published when the first object of the next one comes: as
vision_msgs/Detection3DArray on /objects and as visualization_msgs/MarkerArray on
/objects/markers. Of a recording, each message is published on its topic as it comes, the clouds
of /points and the frames of /tf and /tf_static among them; a recorded file is published as fast
as it is read.

Exit status: 0 at the end of the input, 1 if the input is not as expected or the network cannot be
used, 2 if the command line is invalid.")]
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
