//! `infer-cpu sample`: reduces a cloud by a sampler.

use std::io::{Write, stdout};
use std::path::PathBuf;

use crate::sampler::{SamplerKind, SamplerSpec};
use crate::{Classifier, Options};
use anyhow::Context;
use formats::cloud_file::{Cloud, CloudFormat, write_cloud};
use program::outcome::say;
use program::outputs::Overwrite;

use super::input;
use super::model::ModelArgs;
use super::sampler::SamplerArgs;
use super::{Outcome, Usage, of_setup};

/// Flags of `sample`.
#[derive(clap::Args)]
#[command(after_help = include_str!("sample.txt"))]
pub struct SampleArgs {
    /// Sampler that chooses the points: all, first, random, fps, cpl
    #[arg(long, value_name = "NAME")]
    sampler: SamplerKind,

    #[command(flatten)]
    how: SamplerArgs,

    /// Drop points with NaN or infinite coordinates instead of rejecting the cloud
    #[arg(long)]
    drop_invalid: bool,

    /// Format of the input: ply, npz, npy, pcd, xyz, csv, kitti, nuscenes, las [default: detected
    /// from the file extension, or from the first bytes of standard input]
    #[arg(long, value_name = "FORMAT")]
    input_format: Option<CloudFormat>,

    #[command(flatten)]
    model: ModelArgs,

    /// File with the cloud; `-` reads standard input
    input: PathBuf,

    /// File to write
    output: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &SampleArgs) -> anyhow::Result<Outcome> {
    // An unknown extension fails before a long computation.
    CloudFormat::of_output(&args.output).map_err(|error| Usage(error.to_string()))?;
    args.overwrite.check([&*args.output])?;
    let Cloud { mut points, .. } = input::read(&args.input, args.input_format)?;
    if args.drop_invalid {
        let n = points.len();
        points.retain(|point| point.iter().all(|x| x.is_finite()));
        if points.len() < n {
            let n_dropped = n - points.len();
            say(format!("{}: dropped {n_dropped} of {n} points", args.input.display()));
        }
    }
    let indices = choose(args, &points)?;
    let chosen: Vec<[f64; 3]> = indices.iter().map(|&index| points[index as usize]).collect();
    write_cloud(&args.output, &chosen)?;
    let (n, of) = (chosen.len(), points.len());
    writeln!(stdout(), "{}: {n} of {of} points", args.output.display())?;
    Ok(Outcome::Success)
}

fn choose(args: &SampleArgs, points: &[[f64; 3]]) -> anyhow::Result<Vec<u32>> {
    let here = || args.input.display().to_string();
    if args.sampler != SamplerKind::Cpl {
        let spec = args.how.apply(Some(args.sampler), SamplerSpec::default())?;
        spec.check().map_err(|error| of_setup(error.into()))?;
        return crate::choose(points, &spec).with_context(here);
    }
    let (model, card) = args.model.open()?;
    let spec = args.how.apply(Some(args.sampler), SamplerSpec::as_trained(&model, &card)?)?;
    let options = Options { sampler: Some(spec), ..Options::default() };
    let mut classifier = Classifier::load(&model, &options).map_err(of_setup)?;
    Ok(classifier.sample(points).with_context(here)?.to_vec())
}
