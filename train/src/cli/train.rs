use std::path::PathBuf;

use crate::clouds::Clouds;
use crate::error::Error;
use crate::job::{Job, Progress};
use crate::recipe::Recipe;
use formats::split::Split;
use program::outputs::{Overwrite, check_place, need_extension};

use super::Usage;

/// Flags of `train`.
#[derive(clap::Args, Debug)]
pub struct TrainArgs {
    /// Training data: a packed NPZ file; the common prefix of two packed files, such as
    /// `rotational-noisy` for rotational-noisy-train.npz and rotational-noisy-test.npz; or a
    /// folder with train.npz and test.npz
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Test data, on which the accuracy is measured once, after training [default: the test part of
    /// --data, if there is one]
    #[arg(long, value_name = "PATH")]
    test: Option<PathBuf>,
    /// Recipe, which the flags below override: a TOML file, or the name of a built-in one: edge-64,
    /// cpl-64, street-128 or lidar-64 [default: the settings of the baseline]
    #[arg(long, value_name = "NAME|TOML")]
    recipe: Option<PathBuf>,
    /// Model file, or bundled model, from whose weights training starts. Its layers must be those of the recipe. The
    /// last layer is taken only if the model's classes are those of the data [default: random numbers]
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,
    /// Number of points of each cloud for the network or its Critical Points Layer
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Number of passes over the training set
    #[arg(long, value_name = "N")]
    epochs: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Name of the training set on the model's card [default: the path]
    #[arg(long, value_name = "TEXT")]
    data_name: Option<String>,
    /// Model file to write (.safetensors). The folder of the run is beside it, with the extension
    /// `.run`; a run that is in it goes on
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Replace the model file, and the run in that folder
    #[arg(long)]
    overwrite: bool,
}

pub fn run(args: &TrainArgs) -> anyhow::Result<()> {
    let recipe = recipe(args)?;
    check_output(args)?;
    let clouds = Clouds::read(recipe.normalization, &args.data, Split::Train)?;
    // A single file has no test part.
    let test_part = (!args.data.is_file()).then(|| args.data.clone());
    let name = args.data.display().to_string();
    let data_name = args.data_name.as_ref().unwrap_or(&name);
    let test = args.test.clone().or(test_part);
    let (out, overwrite) = (&*args.out, args.overwrite);
    let job = Job { recipe, clouds: &clouds, data: &name, data_name, out, overwrite };
    if let Some(accuracy) = job.run(test.as_deref(), &mut show)? {
        super::print(&accuracy)?;
    }
    super::print(&args.out.display().to_string())
}

fn show(progress: Progress<'_>) {
    match progress {
        Progress::Resumed { epoch, epochs } => {
            program::say!("resuming after epoch {epoch} of {epochs}");
        }
        Progress::Epoch(epoch) => program::say!("{epoch}"),
    }
}

/// Checks the name of the model, and that only a model of the run beside it is replaced.
fn check_output(args: &TrainArgs) -> anyhow::Result<()> {
    need_extension("--out", &args.out, &["safetensors"])?;
    if args.out.is_dir() {
        let out = args.out.display();
        return Err(Usage(format!("--out: expected a file, found the folder {out}")).into());
    }
    let checkpoint = args.out.with_extension("run").join("checkpoint.safetensors");
    if !args.overwrite && !checkpoint.is_file() {
        Overwrite::default().check([&*args.out])?;
    }
    Ok(check_place(&args.out)?)
}

fn recipe(args: &TrainArgs) -> anyhow::Result<Recipe> {
    let mut recipe = match &args.recipe {
        Some(path) => Recipe::read(path)?,
        None => Recipe::default(),
    };
    recipe.points = args.points.unwrap_or(recipe.points);
    recipe.epochs = args.epochs.unwrap_or(recipe.epochs);
    recipe.seed = args.seed.unwrap_or(recipe.seed);
    recipe.init = args.init.clone().or(recipe.init);
    recipe.check().map_err(Error::from)?;
    Ok(recipe)
}
