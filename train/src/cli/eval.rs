//! `eval`: measures a model's accuracy on labelled clouds.

use std::path::PathBuf;

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
    /// Labelled clouds: a packed NPZ file, or data with a test part in any form
    /// that `train --data` accepts
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Precision of the inference: f32, f32-fc16, f16 or i8
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
    // Also checks that model and data have equally many classes.
    let found = confusion(&args.model, &clouds, &options)?;
    let mut pairs = names.iter().zip(&clouds.classes).enumerate();
    if let Some((class, (model, data))) = pairs.find(|(_, (model, data))| model != data) {
        eprintln!(
            "warning: class {class} is called `{model}` by the model and `{data}` by the data"
        );
    }
    super::print(&accuracy_report::summary(&found, &args.data))?;
    if let Some(path) = &args.csv {
        atomic::write_bytes(path, accuracy_report::to_csv(&found, &names))?;
    }
    if let Some(path) = &args.svg {
        atomic::write_bytes(path, accuracy_report::drawing(&found, &names).to_string())?;
    }
    Ok(())
}
