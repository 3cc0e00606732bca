//! `cargo xtask eval`: a model's accuracy on labelled clouds.

use std::path::PathBuf;

use anyhow::ensure;
use formats::atomic;
use formats::split::Split;
use infer_cpu::{Classifier, Options, Precision};
use train::clouds::Clouds;
use train::evaluate::confusion;

use crate::report;

/// Flags of `eval`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The model file
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Labelled clouds: a packed NPZ, or a folder as for `train`, of which the
    /// test half is taken
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Compute in f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// Write the confusion matrix to this file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw it into this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Points of a text file that are read: as many as the baseline's files have.
pub const MOST_POINTS: usize = 10_000;

/// Measures what `args` ask for.
///
/// # Errors
/// A model or data that cannot be used, classes that differ.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let clouds = Clouds::read(&args.data, Split::Test, MOST_POINTS)?;
    let options = Options { precision: args.precision, ..Options::default() };
    let names: Vec<String> = {
        let classifier = Classifier::load(&args.model, &options)?;
        classifier.classes().iter().map(ToString::to_string).collect()
    };
    ensure!(
        names.len() == clouds.classes.len(),
        "{} tells {} classes, {} has {}",
        args.model.display(),
        names.len(),
        args.data.display(),
        clouds.classes.len()
    );
    if let Some(class) = (0..names.len()).find(|&i| names[i] != clouds.classes[i]) {
        eprintln!(
            "class {class} is `{}` to the model and `{}` to the data",
            names[class], clouds.classes[class]
        );
    }
    let found = confusion(&args.model, &clouds, &options)?;
    println!("{}", report::line(&found, &args.data));
    if let Some(path) = &args.csv {
        let csv = report::csv(&found, &names);
        atomic::write_bytes(path, &csv)?;
    }
    if let Some(path) = &args.svg {
        let drawing = report::drawing(&found, &names).to_string();
        atomic::write_bytes(path, &drawing)?;
    }
    Ok(())
}
