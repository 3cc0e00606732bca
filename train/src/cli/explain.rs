use std::path::PathBuf;

use crate::explanation_drawing;
use crate::lime::{Explanation, Lime, explain};
use crate::random_baseline::RandomBaseline;
use anyhow::{Context, Error};
use formats::atomic;
use formats::cloud_file::{Unlike, judge_object};
use formats::outcome::say;
use formats::outputs::{Overwrite, need_extension};
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Normalization, Options};

use super::compare_points::read_finite;
use super::{Usage, print};

/// Flags of `explain`.
#[derive(clap::Args, Debug)]
pub struct ExplainArgs {
    /// The model file, or the name of a bundled model
    #[arg(long, value_name = "MODEL")]
    model: PathBuf,
    /// The cloud file: PLY, NPZ, NPY, PCD, text, KITTI or LAS
    #[arg(long, value_name = "FILE")]
    cloud: PathBuf,
    /// Largest number of critical points. LIME-3D marks as many points as were found, since a point
    /// can be critical several times
    #[arg(long, default_value_t = 64, value_name = "N")]
    points: usize,
    /// Number of parts into which LIME-3D divides the cloud
    #[arg(long, default_value_t = 20, value_name = "K")]
    clusters: usize,
    /// Number of copies of the cloud, each with some parts removed, that LIME-3D classifies
    #[arg(long, default_value_t = 1000, value_name = "N")]
    samples: usize,
    /// Seed of all random numbers
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Draw the cloud, with the points that both methods mark, into this SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// Number of random subsets to compare the distance with.
const DRAWS: u32 = 1000;

pub fn run(args: &ExplainArgs) -> anyhow::Result<()> {
    check(args)?;
    args.svg.iter().try_for_each(|file| need_extension("--svg", file, &["svg"]))?;
    args.overwrite.check(args.svg.iter().map(PathBuf::as_path))?;
    let cloud = read_finite(&args.cloud)?;
    let sensor_m = cloud.sensor_position_m();
    let cloud = cloud.points;
    let file = || args.cloud.display().to_string();
    let unlike = judge_object(&cloud, sensor_m).map_err(Error::msg).with_context(file)?;
    if unlike == Some(Unlike::Sweep) {
        say(format!("warning: {} {}", file(), Unlike::Sweep));
    }
    let spec =
        SamplerSpec { kind: SamplerKind::Cpl, points: args.points, ..SamplerSpec::default() };
    // The network sees all points; the sampler only finds the critical points.
    let whole = SamplerSpec { kind: SamplerKind::All, ..SamplerSpec::default() };
    // A cloud with parts removed must keep the normalisation of the whole cloud.
    let load = |sampler| {
        let (sampler, normalization) = (Some(sampler), Some(Normalization::None));
        Classifier::load(&args.model, &Options { sampler, normalization, ..Options::default() })
    };
    let mut points = Vec::new();
    let normalization = match infer_cpu::model_file::open(&args.model)?.1.normalization {
        // Clouds of any size are drawn in the same frame.
        Normalization::None => Normalization::UnitSphere,
        other => other,
    };
    infer_cpu::normalize(normalization, &cloud, None, &mut points);
    let wide: Vec<[f64; 3]> = points.iter().map(|point| point.map(f64::from)).collect();
    let critical: Vec<usize> = load(spec)?.sample(&wide)?.iter().map(|&i| i as usize).collect();
    let lime =
        Lime { clusters: args.clusters, samples: args.samples, seed: args.seed, ..Lime::default() };
    let mut classifier = load(whole)?;
    let class = classifier.classify(&points)?;
    let like = match class.answer() {
        answer if answer != &*class.label => format!("{answer}, most like "),
        _ => String::new(),
    };
    print(&format!("{like}{}: {:.1} %", class.label, 100.0 * class.confidence()))?;
    let found = explain(&mut classifier, &points, &lime)?;
    let strongest = found.strongest(critical.len());
    print(&report(&points, &found, &critical, &strongest, args.seed))?;
    if let Some(path) = &args.svg {
        let drawing = explanation_drawing::draw(&points, &found, &critical);
        atomic::write_bytes(path, drawing)?;
    }
    Ok(())
}

fn check(args: &ExplainArgs) -> Result<(), Usage> {
    let least =
        [("points", args.points, 1), ("clusters", args.clusters, 2), ("samples", args.samples, 2)];
    match least.into_iter().find(|(_, found, least)| found < least) {
        Some((flag, found, least)) => {
            Err(Usage(format!("--{flag}: expected {least} or more, found {found}")))
        }
        None => Ok(()),
    }
}

/// The distance between the critical points and the points that LIME-3D finds strongest, as text.
fn report(
    points: &[[f32; 3]],
    found: &Explanation,
    critical: &[usize],
    strongest: &[usize],
    seed: u64,
) -> String {
    let n = critical.len();
    let baseline = RandomBaseline::new(points, (critical, strongest), DRAWS, seed);
    let RandomBaseline { ours, random } = &baseline;
    let [low, middle, high] =
        [DRAWS / 40, DRAWS / 2, DRAWS - 1 - DRAWS / 40].map(|i| random[i as usize]);
    format!(
        "LIME-3D: {} parts, R² of its linear model {:.3}\n\
         Chamfer distance to the {n} points that LIME finds strongest (squared, and plain):\n  \
         critical points  squared {:.5}, plain {:.5}\n  \
         random points    squared {:.5} (95 % of {DRAWS} draws: {:.5} to {:.5}), plain {:.5}\n  \
         {:.1} % of the random draws are nearer than the critical points",
        found.attribution.len(),
        found.r_squared,
        ours.squared,
        ours.plain,
        middle.squared,
        low.squared,
        high.squared,
        middle.plain,
        100.0 * baseline.nearer() as f64 / f64::from(DRAWS),
    )
}
