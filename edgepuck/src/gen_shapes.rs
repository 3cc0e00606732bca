//! `edgepuck gen-shapes`: writes procedural shapes as mesh files.

use crate::{Outcome, Usage};
use anyhow::Context;
use edgepuck_shapes as shapes;
use formats::atomic::UnfinishedFolder;
use formats::outputs::Overwrite;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder to write CLASS/{train,test}/NAME.off into
    #[arg(long, default_value = "data/shapes", value_name = "DIR")]
    out: PathBuf,

    /// Seed of all shapes
    #[arg(long, default_value_t = 0)]
    seed: u64,

    /// Number of training shapes of each class
    #[arg(long, default_value_t = TRAIN_PER_CLASS, value_name = "N")]
    train: u32,

    /// Number of test shapes of each class
    #[arg(long, default_value_t = TEST_PER_CLASS, value_name = "N")]
    test: u32,

    #[command(flatten)]
    overwrite: Overwrite,
}

/// The default number of training shapes of each class.
pub const TRAIN_PER_CLASS: u32 = 40;

/// The default number of test shapes of each class.
pub const TEST_PER_CLASS: u32 = 10;

pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.train == 0 && args.test == 0 {
        return Err(Usage("--train and --test: expected a number above 0".to_owned()).into());
    }
    let classes = shapes::ShapeClass::ALL.map(|class| args.out.join(class.name()));
    let is_shape = |file: &Path| {
        // CLASS/SPLIT/CLASS_NUMBER.off
        let class = file.ancestors().nth(2).and_then(Path::file_name).unwrap_or_default();
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let number = stem.strip_prefix(&format!("{}_", class.to_string_lossy()));
        file.extension().is_some_and(|extension| extension == "off")
            && number.is_some_and(|number| number.parse::<u32>().is_ok())
    };
    args.overwrite.clear(classes.iter().map(PathBuf::as_path), is_shape)?;
    let begun = classes.iter().map(|class| UnfinishedFolder::begin(class));
    let begun = begun.collect::<Result<Vec<_>, _>>()?;
    shapes::write_tree(&args.out, args.seed, args.train, args.test)
        .context("cannot write the shapes")?;
    begun.into_iter().for_each(UnfinishedFolder::finish);
    let classes = shapes::ShapeClass::ALL.len() as u32;
    let meshes = classes * (args.train + args.test);
    formats::say!("{meshes} meshes of {classes} classes: {}", args.out.display());
    Ok(Outcome::Success)
}
