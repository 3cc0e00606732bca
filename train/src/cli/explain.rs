use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Error, ensure};
use clap::value_parser;
use formats::atomic;
use formats::cloud_file::{Cloud, read_cloud_as};
use formats::plausible::{Unlike, is_lost, judge_object};
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Normalization, Options};
use program::outcome::say;
use program::outputs::{Overwrite, need_extension};

use super::print;
use crate::explanation_drawing;
use crate::lime::{SAMPLES, explain};

/// Flags of `explain`.
#[derive(clap::Args, Debug)]
pub struct ExplainArgs {
    /// The model file, or the name of a bundled model
    #[arg(long, value_name = "MODEL")]
    model: PathBuf,
    /// The cloud file: PLY, NPZ, NPY, PCD, text, KITTI or LAS
    #[arg(long, value_name = "FILE")]
    cloud: PathBuf,
    /// Largest number of critical points
    #[arg(long, default_value = "64", value_name = "N", value_parser = value_parser!(u32).range(1..))]
    points: u32,
    /// Number of parts into which LIME-3D divides the cloud
    #[arg(long, default_value = "20", value_name = "K", value_parser = value_parser!(u32).range(2..))]
    clusters: u32,
    /// Draw the cloud, with the points that both methods mark, into this SVG file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &ExplainArgs) -> anyhow::Result<()> {
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
    let n_points = args.points as usize;
    let cpl = SamplerSpec { kind: SamplerKind::Cpl, points: n_points, ..SamplerSpec::default() };
    let critical: Vec<usize> = load(cpl)?.sample(&wide)?.iter().map(|&i| i as usize).collect();
    // The network sees all points; the sampler only finds the critical points.
    let mut classifier = load(SamplerSpec { kind: SamplerKind::All, ..SamplerSpec::default() })?;
    let started = Instant::now();
    let class = classifier.classify(&points)?;
    // On average, half of the points remain.
    let about_s = 0.5 * SAMPLES as f64 * started.elapsed().as_secs_f64();
    let like = match class.answer() {
        answer if answer != &*class.label => format!("{answer}, most like "),
        _ => String::new(),
    };
    print(&format!("{like}{}: {:.1} %", class.label, 100.0 * class.confidence()))?;
    if about_s > 5.0 {
        let n = cloud.len();
        say(format!("LIME-3D classifies {SAMPLES} parts of {n} points: about {about_s:.0} s"));
    }
    let found = explain(&mut classifier, &points, args.clusters as usize)?;
    let (n_parts, r_squared) = (found.attribution.len(), found.r_squared);
    print(&format!("LIME-3D: {n_parts} parts, R² of its linear model {r_squared:.3}"))?;
    print(&format!("critical points: {}", critical.len()))?;
    if let Some(path) = &args.svg {
        atomic::write_bytes(path, explanation_drawing::draw(&points, &found, &critical))?;
        say(format!("drawing: {}", path.display()));
    }
    Ok(())
}

fn read_finite(path: &Path) -> anyhow::Result<Cloud> {
    let mut cloud = read_cloud_as(path, None)?;
    let is_bad = |p: &[f64; 3]| !is_lost(*p) && !p.iter().all(|x| x.is_finite());
    if let Some(i) = cloud.points.iter().position(is_bad) {
        anyhow::bail!("{}: point {i} is not finite", path.display());
    }
    cloud.points.retain(|point| !is_lost(*point));
    ensure!(!cloud.points.is_empty(), "{}: expected points, found none", path.display());
    Ok(cloud)
}
