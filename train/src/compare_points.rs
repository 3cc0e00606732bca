//! `cargo xtask compare-points`: the Chamfer distance of two clouds.

use std::path::PathBuf;

use anyhow::ensure;
use formats::chamfer::chamfer;
use formats::cloud_file::read_cloud;

/// Flags of `compare-points`.
#[derive(clap::Args, Debug)]
pub struct Args {
    /// One cloud: PLY, NPZ, NPY, PCD, text, KITTI or LAS
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The other
    #[arg(value_name = "B")]
    b: PathBuf,
}

/// Compares what `args` name.
///
/// # Errors
/// A cloud that cannot be read, has no points, or has some that are not finite.
pub fn run(args: &Args) -> anyhow::Result<()> {
    let [a, b] = [&args.a, &args.b].map(|path| -> anyhow::Result<_> {
        let cloud = read_cloud(path)?;
        ensure!(!cloud.is_empty(), "{}: no points", path.display());
        let bad = cloud.iter().position(|point| !point.iter().all(|x| x.is_finite()));
        if let Some(i) = bad {
            anyhow::bail!("{}: point {i} is not finite", path.display());
        }
        Ok(cloud)
    });
    let (a, b) = (a?, b?);
    let found = chamfer(&a, &b);
    println!("{} and {} points", a.len(), b.len());
    println!("Chamfer distance, squared, sum of both means: {:.9}", found.squared);
    println!("Chamfer distance, plain, sum of both means:   {:.9}", found.plain);
    Ok(())
}
