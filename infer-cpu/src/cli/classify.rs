//! `infer-cpu classify`: the class of each cloud.

use std::fs::File;
use std::io::{self, BufReader, stdin};
use std::path::{Path, PathBuf};
use std::thread::available_parallelism;
use std::time::Instant;

use anyhow::Context;
use clap::ValueEnum;
use formats::FormatError;
use formats::cloud_file::CloudFormat;
use formats::model_card::{ModelCard, Normalization};
use infer_cpu::kernel::KernelName;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options, Precision, UpAxis};

use super::Outcome;
use super::failure::{of_setup, told_once};
use super::input;
use super::model::ModelArgs;
use super::names;
use super::report::Style;
use super::sampler::SamplerArgs;

/// More threads than a Raspberry Pi has cores were never measured to help.
const MOST_THREADS_BY_DEFAULT: usize = 4;

/// Flags of `classify`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  infer-cpu classify scan.ply more/*.npz
  infer-cpu classify --sampler cpl --points 64 --precision f16 --threads 4 scan.npz
  infer-cpu classify --json --drop-invalid scan.pcd
  producer | infer-cpu classify --format ply -
  find scans -name '*.npz' | infer-cpu classify --json --files-from -

A line is a file's name, its class and the network's confidence, between tabs.
With --json it is an object: file, class (a number), label, confidence (0 to 1),
logits, points, used (by the network), dropped, clipped (activations, by int8),
precision (f32 where another one overflowed), ms (without reading the file); or
file and error. A file that fails does not end the run; the exit code is 1 then.

Formats: PLY, NPZ, NPY, PCD, XYZ, CSV, KITTI's .bin, LAS, as the name tells.")]
pub struct Args {
    /// Clouds; `-` reads one from standard input
    #[arg(value_name = "FILES", required_unless_present = "files_from")]
    files: Vec<PathBuf>,

    /// Read names of files from this one, one a line; `-` is standard input,
    /// where each name is answered before the next is read
    #[arg(long, value_name = "LIST", conflicts_with = "files")]
    files_from: Option<PathBuf>,

    /// Format of all clouds: ply, npz, npy, pcd, xyz, csv, kitti, las [default:
    /// as a file's name tells, or the first bytes of standard input]
    #[arg(long)]
    format: Option<CloudFormat>,

    /// Print one JSON object a line
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    model: ModelArgs,

    /// Drop points that are not finite instead of refusing the cloud
    #[arg(long)]
    drop_invalid: bool,

    /// How clouds are moved and scaled: unit-sphere, none [default: as the model
    /// was trained]
    #[arg(long, value_name = "HOW")]
    normalize: Option<Normalization>,

    /// Compute in f32, f32-fc16, f16 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,

    /// Kernels to use: scalar, avx2, avx512, neon, neon_f16, neon_dot [default:
    /// the fastest of this machine]
    #[arg(long)]
    kernel: Option<KernelName>,

    /// Threads [default: one a core, at most 4]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,

    /// Average the log-probabilities of so many random subsets (of sampler
    /// random, or with --vote-rotations)
    #[arg(long, value_name = "K", default_value_t = 1)]
    #[arg(value_parser = clap::value_parser!(u32).range(1..=1000))]
    votes: u32,

    /// Turn the cloud about its up axis from vote to vote
    #[arg(long)]
    vote_rotations: bool,

    /// The axis that points up
    #[arg(long, value_enum, default_value_t = Axis::Z)]
    up: Axis,

    /// Which points the network sees: all, first, random, fps, voxel, cpl
    /// [default: as the model was trained, else all]
    #[arg(long, value_name = "NAME")]
    sampler: Option<SamplerKind>,

    #[command(flatten)]
    how: SamplerArgs,
}

/// An axis of space.
#[derive(Clone, Copy, ValueEnum)]
enum Axis {
    X,
    Y,
    Z,
}

impl From<Axis> for UpAxis {
    fn from(axis: Axis) -> Self {
        match axis {
            Axis::X => Self::X,
            Axis::Y => Self::Y,
            Axis::Z => Self::Z,
        }
    }
}

/// Classifies what `args` name, one after the other.
///
/// # Errors
/// Options that cannot be met, a model or a list of names that cannot be read,
/// an output that cannot be written to. A cloud that fails is reported instead.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    input::check_names(args.files.iter().map(PathBuf::as_path))?;
    let (model, card) = args.model.open()?;
    let options = args.options(&model, &card)?;
    let classifier = Classifier::load(&model, &options).map_err(of_setup)?;
    let style = if args.json { Style::Json } else { Style::Text };
    let mut session = Session { classifier, precision: args.precision, style, failed: false };
    match &args.files_from {
        Some(list) => {
            for_each_name(list, |name| session.answer(name, input::read_file(name, args.format)))?
        }
        None => {
            for name in &args.files {
                session.answer(name, input::read(name, args.format))?;
            }
        }
    }
    Ok(if session.failed { Outcome::SomeFailed } else { Outcome::Success })
}

fn for_each_name(list: &Path, take: impl FnMut(&Path) -> io::Result<()>) -> anyhow::Result<()> {
    if list.as_os_str() == "-" {
        return Ok(names::for_each(stdin().lock(), take)?);
    }
    let file = File::open(list).with_context(|| list.display().to_string())?;
    names::for_each(BufReader::new(file), take).with_context(|| list.display().to_string())
}

impl Args {
    fn options(&self, model: &Path, card: &ModelCard) -> anyhow::Result<Options> {
        let trained = SamplerSpec::as_trained(model, card)?;
        let cores = || available_parallelism().map_or(1, usize::from);
        Ok(Options {
            precision: self.precision,
            kernel: self.kernel,
            threads: match self.threads {
                Some(threads) => threads.into(),
                None => cores().min(MOST_THREADS_BY_DEFAULT),
            },
            sampler: Some(self.how.apply(self.sampler, trained)?),
            normalization: self.normalize,
            drop_invalid: self.drop_invalid,
            votes: self.votes,
            vote_rotations: self.vote_rotations,
            up: self.up.into(),
            ..Options::default()
        })
    }
}

/// A model at work, and whether a cloud failed.
struct Session {
    classifier: Classifier,
    precision: Precision,
    style: Style,
    failed: bool,
}

impl Session {
    /// Classifies the cloud `name`, which was `read`, and says what came out.
    fn answer(&mut self, name: &Path, read: Result<Vec<[f64; 3]>, FormatError>) -> io::Result<()> {
        let points = match read {
            Ok(points) => points,
            Err(error) => return self.fail(name, error.into()),
        };
        let start = Instant::now();
        match self.classifier.classify_f64(&points) {
            Ok(prediction) => {
                self.style.classified(name, prediction, self.precision, start.elapsed())
            }
            Err(error) => {
                let error = anyhow::Error::from(error).context(name.display().to_string());
                self.fail(name, error)
            }
        }
    }

    fn fail(&mut self, name: &Path, error: anyhow::Error) -> io::Result<()> {
        self.failed = true;
        self.style.failed(name, &told_once(&error))
    }
}
