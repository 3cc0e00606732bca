use std::path::PathBuf;

use crate::clouds::Clouds;
use crate::recipe::Recipe;
use crate::run::{Job, points_to_read};
use formats::outputs::{Overwrite, check_place, need_extension};
use formats::split::Split;

use super::Usage;
use super::progress::shown;

/// Flags of `train`.
#[derive(clap::Args, Debug)]
pub struct TrainArgs {
    /// Training data: a packed NPZ file; the common prefix of two packed files, such as
    /// `rotational-noisy` for rotational-noisy-train.npz and rotational-noisy-test.npz; a folder
    /// with train.npz and test.npz; a folder of ModelNet40's HDF5 files; or a folder of text files
    /// as in yanx27/Pointnet_Pointnet2_pytorch
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Test data, on which the accuracy is measured once, after training [default: the test part of
    /// --data, if there is one]
    #[arg(long, value_name = "PATH")]
    test: Option<PathBuf>,
    /// Recipe, which the flags below override: a TOML file, or the name of a built-in one: edge-64,
    /// set-64, street-128 or lidar-64 [default: the settings of the baseline]
    #[arg(long, value_name = "NAME|TOML")]
    recipe: Option<PathBuf>,
    /// Model file, or bundled model, from whose weights training starts. Its layers must be those of the recipe. The
    /// last layer is taken only if the model's classes are the first classes of the data; the
    /// weights of further classes start from random numbers [default: random numbers]
    #[arg(long, value_name = "MODEL")]
    init: Option<PathBuf>,
    /// Network: pointnet, or cpl (pointnet after a Critical Points Layer) [default: the recipe's]
    #[arg(long, value_name = "NAME", value_parser = ["pointnet", "cpl"])]
    arch: Option<String>,
    /// Number of points of each cloud for the network or its Critical Points Layer
    #[arg(long, value_name = "N")]
    points: Option<usize>,
    /// Widths of the layers of the Critical Points Layer's point encoder, beginning with the 3
    /// coordinates
    #[arg(long, value_name = "3-W-W", value_parser = parse_widths)]
    front: Option<Widths>,
    /// Number of points that the Critical Points Layer selects
    #[arg(long, value_name = "M")]
    keep: Option<usize>,
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

/// Widths of a point encoder's layers, without the 3 coordinates.
#[derive(Clone, Debug)]
struct Widths(Vec<usize>);

fn parse_widths(word: &str) -> Result<Widths, String> {
    let widths: Option<Vec<usize>> = word.split('-').map(|width| width.parse().ok()).collect();
    match widths.as_deref().and_then(<[usize]>::split_first) {
        Some((3, widths)) if widths.len() >= 2 => Ok(Widths(widths.to_vec())),
        _ => Err("expected widths such as 3-64-128-1024, the 3 coordinates first".to_owned()),
    }
}

pub fn run(args: &TrainArgs) -> anyhow::Result<()> {
    let recipe = recipe(args)?;
    check_output(args)?;
    let most_points = points_to_read(&recipe);
    let clouds = Clouds::read_for(recipe.normalization, &args.data, Split::Train, most_points)?;
    // A single file has no test part.
    let test_part = (!args.data.is_file()).then(|| args.data.clone());
    let name = args.data.display().to_string();
    let data_name = args.data_name.as_ref().unwrap_or(&name);
    let test = args.test.clone().or(test_part);
    let job = Job {
        recipe,
        clouds: &clouds,
        data: &name,
        data_name,
        out: &args.out,
        overwrite: args.overwrite,
    };
    if let Some(accuracy) = job.run(test.as_deref(), &mut shown())? {
        super::print(&accuracy)?;
    }
    super::print(&args.out.display().to_string())
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
    match args.arch.as_deref() {
        Some("pointnet") => recipe.cpl = None,
        Some(_) => recipe.cpl = Some(recipe.cpl.unwrap_or_default()),
        None => {}
    }
    if let Some(cpl) = &mut recipe.cpl {
        if let Some(Widths(widths)) = &args.front {
            cpl.front.clone_from(widths);
        }
        cpl.keep = args.keep.unwrap_or(cpl.keep);
    } else if args.front.is_some() || args.keep.is_some() {
        return Err(Usage("--front and --keep need --arch cpl".to_owned()).into());
    }
    recipe.points = args.points.unwrap_or(recipe.points);
    recipe.epochs = args.epochs.unwrap_or(recipe.epochs);
    recipe.seed = args.seed.unwrap_or(recipe.seed);
    recipe.init = args.init.clone().or(recipe.init);
    recipe.check()?;
    Ok(recipe)
}
