//! `cargo xtask explain`: what a network's answer rests on, by LIME-3D and by
//! its critical points, side by side.

pub mod drawing;

use std::path::{Path, PathBuf};

use anyhow::{bail, ensure};
use formats::atomic;
use formats::cloud_file::read_cloud;
use infer_cpu::sampler::{Resize, SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Normalization, Options};
use train::beside_random::BesideRandom;
use train::lime::{Explanation, Lime, explain};

/// Flags of `explain`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// The model file
    #[arg(long, value_name = "FILE")]
    model: PathBuf,
    /// The cloud: PLY, NPZ, NPY, PCD, text, KITTI or LAS
    #[arg(long, value_name = "FILE")]
    cloud: PathBuf,
    /// Points that either side may show
    #[arg(long, default_value_t = 64, value_name = "N")]
    points: usize,
    /// Parts that LIME takes away
    #[arg(long, default_value_t = 20, value_name = "K")]
    clusters: usize,
    /// Clouds with parts taken away
    #[arg(long, default_value_t = 1000, value_name = "N")]
    samples: usize,
    /// What all draws depend on
    #[arg(long, default_value_t = 0, value_name = "N")]
    seed: u64,
    /// Draw the cloud with both into this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Random subsets that the distance is set beside.
const DRAWS: u32 = 1000;

/// Explains what `args` name.
///
/// # Errors
/// A model or a cloud that cannot be used.
pub fn run(args: &Args) -> anyhow::Result<()> {
    ensure!(args.points > 0 && args.clusters > 1 && args.samples > 1, "too few to explain by");
    let cloud = read_cloud(&args.cloud)?;
    ensure!(!cloud.is_empty(), "{}: no points", args.cloud.display());
    let spec = SamplerSpec {
        kind: SamplerKind::Cpl,
        points: args.points,
        resize: Resize::Truncate,
        ..SamplerSpec::default()
    };
    // The network sees all points; only the choice of critical ones is made by
    // the sampler.
    let whole = SamplerSpec { kind: SamplerKind::All, ..SamplerSpec::default() };
    // A part of a cloud is not normalised anew.
    let load = |sampler| {
        let (sampler, normalization) = (Some(sampler), Some(Normalization::None));
        Classifier::load(&args.model, &Options { sampler, normalization, ..Options::default() })
    };
    let points = unit_sphere(&cloud, &args.cloud)?;
    let wide: Vec<[f64; 3]> = points.iter().map(|point| point.map(f64::from)).collect();
    let critical: Vec<usize> = load(spec)?.sample(&wide)?.iter().map(|&i| i as usize).collect();
    let lime =
        Lime { clusters: args.clusters, samples: args.samples, seed: args.seed, ..Lime::default() };
    let mut classifier = load(whole)?;
    let class = classifier.classify(&points)?;
    println!("{}: {:.1} %", class.label, 100.0 * class.confidence());
    let found = explain(&mut classifier, &points, &lime)?;
    let strongest = found.strongest(critical.len());
    report(&points, &found, &critical, &strongest, args.seed);
    if let Some(path) = &args.svg {
        let drawing = drawing::of(&points, &found, &critical).to_string();
        atomic::write_bytes(path, &drawing)?;
    }
    Ok(())
}

fn unit_sphere(cloud: &[[f64; 3]], path: &Path) -> anyhow::Result<Vec<[f32; 3]>> {
    if let Some(i) = cloud.iter().position(|point| !point.iter().all(|x| x.is_finite())) {
        bail!("{}: point {i} is not finite", path.display());
    }
    let mut points = Vec::new();
    infer_cpu::to_unit_sphere(cloud, &mut points);
    Ok(points)
}

fn report(
    points: &[[f32; 3]],
    found: &Explanation,
    critical: &[usize],
    strongest: &[usize],
    seed: u64,
) {
    let n = critical.len();
    let beside = BesideRandom::of(points, (critical, strongest), DRAWS, seed);
    let BesideRandom { ours, random } = &beside;
    println!("LIME-3D: {} parts, R² {:.3}", found.attribution.len(), found.r_squared);
    println!("Chamfer distance to the {n} points that LIME finds strongest:");
    println!("  critical points  squared {:.5}, plain {:.5}", ours.squared, ours.plain);
    let [low, middle, high] =
        [DRAWS / 40, DRAWS / 2, DRAWS - 1 - DRAWS / 40].map(|i| random[i as usize]);
    println!(
        "  random points    squared {:.5} (95 % of {DRAWS} draws: {:.5} to {:.5}), plain {:.5}",
        middle.squared, low.squared, high.squared, middle.plain
    );
    println!(
        "  of the random draws, {:.1} % are nearer",
        100.0 * beside.nearer() as f64 / f64::from(DRAWS)
    );
}
