use std::path::{Path, PathBuf};

use anyhow::ensure;
use formats::chamfer::chamfer;
use formats::cloud_file::{Cloud, read_cloud_as};

use super::print;

/// Flags of `compare-points`.
#[derive(clap::Args, Debug)]
pub struct ComparePointsArgs {
    /// One cloud file: PLY, NPZ, NPY, PCD, text, KITTI or LAS
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The other cloud file
    #[arg(value_name = "B")]
    b: PathBuf,
}

pub fn run(args: &ComparePointsArgs) -> anyhow::Result<()> {
    let [a, b] = [read_finite(&args.a)?.points, read_finite(&args.b)?.points];
    let found = chamfer(&a, &b);
    print(&format!("{} and {} points", a.len(), b.len()))?;
    print(&format!("Chamfer distance, squared, sum of both means: {:.9}", found.squared))?;
    print(&format!("Chamfer distance, plain, sum of both means:   {:.9}", found.plain))
}

pub fn read_finite(path: &Path) -> anyhow::Result<Cloud> {
    let cloud = read_cloud_as(path, None)?;
    ensure!(!cloud.points.is_empty(), "{}: expected points, found none", path.display());
    let bad = cloud.points.iter().position(|point| !point.iter().all(|x| x.is_finite()));
    if let Some(i) = bad {
        anyhow::bail!("{}: point {i} is not finite", path.display());
    }
    Ok(cloud)
}
