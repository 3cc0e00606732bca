//! `infer-cpu classify`: the class of each cloud.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;
use edgepuck_kernels::KernelName;
use formats::FormatError;
use formats::cloud_file::{Cloud, CloudFormat};
use formats::model_card::{ModelCard, Normalization};
use formats::plausible::{Unlike, check_sweep, judge_object};
use program::outcome::{joined_causes, say};

use super::default_model::{Kind, Kinds, SCANS};
use super::input;
use super::model::ModelArgs;
use super::report::Style;
use super::sampler::SamplerArgs;
use super::{Outcome, n_threads, of_setup};
use crate::model::network::open;
use crate::sampler::{SamplerKind, SamplerSpec};
use crate::{Classifier, Options, Precision};

/// Flags of `classify`.
#[derive(clap::Args)]
#[command(after_help = include_str!("classify.txt"))]
pub struct ClassifyArgs {
    /// Files of clouds; `-` reads one cloud from standard input
    #[arg(value_name = "FILES", required = true)]
    files: Vec<PathBuf>,

    /// Format of all clouds: ply, npz, npy, pcd, xyz, csv, kitti, nuscenes, las [default: detected
    /// from the file extension, or from the first bytes of standard input]
    #[arg(long, value_name = "FORMAT")]
    input_format: Option<CloudFormat>,

    /// Print one JSON object per line
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    model: ModelArgs,

    /// Drop points with NaN or infinite coordinates instead of rejecting the cloud; lost returns (0, 0, 0
    /// or no finite coordinate) are always dropped
    #[arg(long)]
    drop_invalid: bool,

    /// Normalization of clouds: unit-sphere, metric (metres, from the mean of x and y and the
    /// lowest z), metric-sight (the same, turned to the line of sight), none [default: as in
    /// training]
    #[arg(long, value_name = "HOW")]
    normalize: Option<Normalization>,

    /// Precision of the network: f32 or i8
    #[arg(long, default_value = "f32")]
    precision: Precision,

    /// Kernels to use: scalar, avx2, avx512, neon, neon_dot [default: the fastest that this machine
    /// supports]
    #[arg(long)]
    kernel: Option<KernelName>,

    /// Number of threads [default: one per core, at most 4]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,

    /// Sampler that chooses the points that the network sees: all, first, random, fps, cpl
    /// [default: as in training, else all]
    #[arg(long, value_name = "NAME")]
    sampler: Option<SamplerKind>,

    #[command(flatten)]
    how: SamplerArgs,
}

pub fn run(args: &ClassifyArgs) -> anyhow::Result<Outcome> {
    input::check_names(args.files.iter().map(PathBuf::as_path))?;
    let (model, card) = args.model.open()?;
    let classifier = args.load(&model, &card)?;
    let kinds = (!args.model.is_named()).then(Kinds::new).transpose()?;
    let style = if args.json { Style::Json } else { Style::Text };
    let mut session =
        Session { args, classifier, kinds, scans: None, warned: Vec::new(), style, failed: false };
    for name in &args.files {
        session.answer(name, input::read(name, args.input_format))?;
    }
    Ok(if session.failed { Outcome::SomeFailed } else { Outcome::Success })
}

impl ClassifyArgs {
    fn load(&self, model: &Path, card: &ModelCard) -> anyhow::Result<Classifier> {
        let trained = SamplerSpec::as_trained(model, card)?;
        let options = Options {
            precision: self.precision,
            kernel: self.kernel,
            threads: n_threads(self.threads),
            sampler: Some(self.how.apply(self.sampler, trained)?),
            normalization: self.normalize,
            drop_invalid: self.drop_invalid,
            ..Options::default()
        };
        Classifier::load(model, &options).map_err(of_setup)
    }
}

/// A loaded classifier, and whether a cloud has failed.
struct Session<'a> {
    args: &'a ClassifyArgs,
    classifier: Classifier,
    /// If the user named no model, the kinds of clouds, and the classifier of scans once there is
    /// one.
    kinds: Option<Kinds>,
    scans: Option<Classifier>,
    /// The kinds of which the user was warned.
    warned: Vec<Kind>,
    style: Style,
    failed: bool,
}

impl Session<'_> {
    /// Classifies the cloud `name`, if it could be `read`, and prints the result.
    fn answer(&mut self, name: &Path, read: Result<Cloud, FormatError>) -> anyhow::Result<()> {
        let judged = read.map_err(anyhow::Error::from).and_then(|cloud| {
            let sensor_m = cloud.sensor_position_m();
            if self.classifier.card().normalization.is_metric() {
                let from = |p: &[f64; 3]| [0, 1, 2].map(|axis| p[axis] - sensor_m[axis]);
                // The classifier judges points that are not finite.
                let is_finite = |p: &[f64; 3]| p.iter().all(|x| x.is_finite());
                let points = cloud.points.iter().map(from).filter(is_finite);
                if points.clone().next().is_some() {
                    check_sweep(points, name, "are they in millimetres? Scale them")?;
                }
            }
            let unlike = judge_object(&cloud.points, sensor_m).map_err(anyhow::Error::msg);
            Ok((cloud.points, unlike.with_context(|| name.display().to_string())?))
        });
        let (points, unlike) = match judged {
            Ok(judged) => judged,
            Err(error) => return Ok(self.fail(name, error)?),
        };
        let kind = match (self.kinds.as_mut().map(|kinds| kinds.of(name)), unlike) {
            (_, Some(Unlike::Sweep)) => Kind::Unlike(Unlike::Sweep),
            (Some(Kind::Other), Some(unlike)) => Kind::Unlike(unlike),
            (kind, _) => kind.unwrap_or(Kind::Other),
        };
        self.tell(name, kind);
        let classifier = match (kind, &mut self.scans) {
            (Kind::KnownScan, Some(scans)) => scans,
            (Kind::KnownScan, scans) => {
                let model = Path::new(SCANS);
                scans.insert(self.args.load(model, &open(model)?.1)?)
            }
            _ => &mut self.classifier,
        };
        let start = Instant::now();
        match classifier.classify_f64(&points) {
            Ok(prediction) => {
                self.style.classified(name, prediction, self.args.precision, start.elapsed())?;
            }
            Err(error) => {
                let error = anyhow::Error::from(error).context(name.display().to_string());
                self.fail(name, error)?;
            }
        }
        Ok(())
    }

    /// Tells the user once that a cloud is not what the default model has learnt.
    fn tell(&mut self, name: &Path, kind: Kind) {
        if kind == Kind::Other || self.warned.contains(&kind) {
            return;
        }
        self.warned.push(kind);
        let name = name.display();
        say(match kind {
            Kind::Unlike(unlike) => format!("warning: {name} {unlike}"),
            _ => format!(
                "note: {name} is a scan of one side: {SCANS}, which learnt such scans of the same \
                 classes, names it; --model chooses another"
            ),
        });
    }

    fn fail(&mut self, name: &Path, error: anyhow::Error) -> io::Result<()> {
        self.failed = true;
        self.style.failed(name, &joined_causes(&error))
    }
}
