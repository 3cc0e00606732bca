//! `cargo xtask gen-shapes`: the parametric shapes as files.

use crate::Outcome;
use anyhow::Context;
use edgepuck_shapes as shapes;
use std::path::PathBuf;

/// Flags of `gen-shapes`.
#[derive(clap::Args)]
pub struct Args {
    /// Folder to write CLASS/{train,test}/NAME.off into
    #[arg(long, default_value = "data/shapes", value_name = "DIR")]
    out: PathBuf,

    /// Seed of every shape
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Shapes of each class to train on
    #[arg(long, default_value_t = TRAIN_PER_CLASS, value_name = "N")]
    train: u32,

    /// Shapes of each class to test with
    #[arg(long, default_value_t = TEST_PER_CLASS, value_name = "N")]
    test: u32,
}

/// Shapes of each class to train on, unless asked otherwise.
pub const TRAIN_PER_CLASS: u32 = 40;

/// Shapes of each class to test with, unless asked otherwise.
pub const TEST_PER_CLASS: u32 = 10;

/// Writes the shapes.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    shapes::write_tree(&args.out, args.seed, args.train, args.test)
        .context("cannot write the shapes")?;
    let meshes = shapes::CLASSES.len() as u32 * (args.train + args.test);
    eprintln!("{meshes} meshes of {} classes: {}", shapes::CLASSES.len(), args.out.display());
    Ok(Outcome::Success)
}
