//! `edgepuck gen-dataset --save-meshes`: writes procedural shapes as mesh files.

use crate::{Outcome, Usage};
use anyhow::Context;
use edgepuck_shapes as shapes;
use formats::atomic::UnfinishedFolder;
use program::outputs::Overwrite;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(next_help_heading = "The built-in shapes")]
pub(crate) struct ShapeArgs {
    /// Only write the built-in shapes as meshes, CLASS/{train,test}/NAME.off in this folder
    #[arg(long, value_name = "DIR", hide_short_help = true)]
    #[arg(conflicts_with_all = ["meshes", "out", "resume", "shard", "card"])]
    pub save_meshes: Option<PathBuf>,

    /// Number of training shapes of each class
    #[arg(long, default_value_t = TRAIN_PER_CLASS, value_name = "N", requires = "save_meshes")]
    #[arg(hide_short_help = true)]
    train: u32,

    /// Number of test shapes of each class
    #[arg(long, default_value_t = TEST_PER_CLASS, value_name = "N", requires = "save_meshes")]
    #[arg(hide_short_help = true)]
    test: u32,
}

/// The default number of training shapes of each class.
pub const TRAIN_PER_CLASS: u32 = 40;

/// The default number of test shapes of each class.
pub const TEST_PER_CLASS: u32 = 10;

impl ShapeArgs {
    /// Writes the shapes of `seed` into the folder `out`.
    pub(crate) fn write(&self, out: &Path, seed: u64, overwrite: bool) -> anyhow::Result<Outcome> {
        if self.train == 0 && self.test == 0 {
            return Err(Usage("--train and --test: expected a number above 0".to_owned()).into());
        }
        let classes = shapes::ShapeClass::ALL.map(|class| out.join(class.name()));
        Overwrite::of(overwrite).clear(classes.iter().map(PathBuf::as_path), is_shape)?;
        let begun: Vec<_> = classes.iter().map(|class| UnfinishedFolder::begin(class)).collect();
        shapes::write_tree(out, seed, self.train, self.test).context("cannot write the shapes")?;
        begun.into_iter().for_each(UnfinishedFolder::finish);
        let classes = shapes::ShapeClass::ALL.len() as u32;
        let meshes = classes * (self.train + self.test);
        program::say!("{meshes} meshes of {classes} classes: {}", out.display());
        Ok(Outcome::Success)
    }
}

/// Whether `file` has the name of a shape: CLASS/SPLIT/CLASS_NUMBER.off.
fn is_shape(file: &Path) -> bool {
    let class = file.ancestors().nth(2).and_then(Path::file_name).unwrap_or_default();
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let number = stem.strip_prefix(&format!("{}_", class.to_string_lossy()));
    file.extension().is_some_and(|extension| extension == "off")
        && number.is_some_and(|number| number.parse::<u32>().is_ok())
}
