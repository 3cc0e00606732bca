use crate::Outcome;
use crate::gen_dataset::{listed, print_notes, report_failures};
use edgepuck_dataset::{Progress, SurfaceConfig, write_surfaces};
use formats::outputs::Overwrite;
use sim_gpu::internals::mesh::frame::{Normalize, Up};
use sim_gpu::internals::sensor::Views;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct SampleSurfacesArgs {
    /// Folder of meshes, as for gen-dataset
    #[arg(value_name = "MESHES")]
    meshes: PathBuf,

    /// Folder for surface-{train,test}.npz (points of whole meshes) and seen-{train,test}.npz
    /// (those points that are visible from each of gen-dataset's default viewpoints)
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Number of points in each cloud
    #[arg(long, default_value_t = 1024, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    points: u32,

    /// Smallest number of visible points for a viewpoint, out of six times --points samples
    #[arg(long, default_value_t = 64, value_name = "N",
          value_parser = clap::value_parser!(u32).range(1..))]
    min_points: u32,

    /// The meshes' upward axis: y or z [default: y for OBJ and glTF, z for others]
    #[arg(long, value_name = "AXIS")]
    up: Option<Up>,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,

    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &SampleSurfacesArgs) -> anyhow::Result<Outcome> {
    let outputs = ["surface-train", "surface-test", "seen-train", "seen-test"]
        .map(|set| args.out.join(set).with_extension("npz"));
    args.overwrite.check(outputs.iter().map(PathBuf::as_path))?;
    let meshes = listed(&args.meshes, args.seed)?;
    let config = SurfaceConfig {
        seed: args.seed,
        normalize: Normalize::default(),
        up: args.up,
        points: args.points,
        min_points: args.min_points,
        views: Views::ROTATING,
    };
    let progress = Progress::default();
    let failures = write_surfaces(&args.out, &config, &meshes, &progress)?;
    print_notes(&progress.notes());
    report_failures(&failures);
    formats::say!("{} meshes: {}", meshes.len() - failures.len(), args.out.display());
    Ok(if failures.is_empty() { Outcome::Success } else { Outcome::SomeRefused })
}
