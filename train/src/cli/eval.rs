//! `eval`: measures a model's accuracy on labelled clouds.

use std::path::PathBuf;

use anyhow::ensure;
use formats::atomic;
use formats::split::Split;
use infer_cpu::{Classifier, Options, Precision};
use train::accuracy_report;
use train::clouds::Clouds;
use train::evaluate::confusion;
use train::run::MOST_POINTS;

/// Flags of `eval`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The model file
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// Labelled clouds: a packed NPZ file, or data with a test half, as `train`
    /// takes it
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Arithmetic of the inference: f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,
    /// Write the confusion matrix to this CSV file
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw the confusion matrix into this SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Measures the model that `args` name.
///
/// # Errors
/// A model or data that cannot be used, other numbers of classes.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let clouds = Clouds::read(&args.data, Split::Test, MOST_POINTS)?;
    let options = Options { precision: args.precision, ..Options::default() };
    let names: Vec<String> = {
        let classifier = Classifier::load(&args.model, &options)?;
        classifier.classes().iter().map(ToString::to_string).collect()
    };
    ensure!(
        names.len() == clouds.classes.len(),
        "{}: expected {} classes, as the model {} has, found {}",
        args.data.display(),
        names.len(),
        args.model.display(),
        clouds.classes.len()
    );
    if let Some(class) = (0..names.len()).find(|&i| names[i] != clouds.classes[i]) {
        eprintln!(
            "warning: class {class} is called `{}` by the model and `{}` by the data",
            names[class], clouds.classes[class]
        );
    }
    let found = confusion(&args.model, &clouds, &options)?;
    super::print(&accuracy_report::summary(&found, &args.data))?;
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, accuracy_report::to_csv(&found, &names))?;
    }
    if let Some(path) = &args.svg {
        atomic::write_bytes(path, accuracy_report::drawing(&found, &names).to_string())?;
    }
    Ok(())
}
