//! `edgepuck preview`: a picture of a scan.

use crate::points::PointsArgs;
use crate::view::files;
use crate::{Outcome, preview};
use formats::outputs::{Overwrite, need_extension};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Points to draw: a scan (.npz, .ply, .csv), a capture (.pcap or .pcapng), of which the first
    /// turn is drawn, or a cloud (.npy, .pcd, .xyz, .txt, .pts, .las, KITTI's or nuScenes' .bin); a
    /// scene (.toml), what its sensors see; the folder of clusters of segment, or another of sweeps,
    /// of which the first is drawn. If a scan is in the folder clean/ of a dataset, its noisy version
    /// is drawn below it
    #[arg(value_name = "SCAN")]
    scan: PathBuf,

    #[command(flatten)]
    points: PointsArgs,

    /// PNG file to write
    #[arg(long, default_value = "scan.png", value_name = "PNG")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["png"])?;
    args.overwrite.check([&*args.out])?;
    let clean = files::first_points(&args.scan, &args.points)?;
    let Some(clean) = clean.filter(|points| !points.scan.is_empty()) else {
        formats::say!("{}: expected points to draw, found none", args.scan.display());
        return Ok(Outcome::SomeRefused);
    };
    let noisy = noisy_twin(&args.scan).map(|file| args.points.read(&file)).transpose()?;
    let title = args.scan.file_stem().unwrap_or_default().to_string_lossy();
    preview::draw(&clean.scan, clean.labels.first(), noisy.as_ref(), &title, &args.out)?;
    formats::say!("{} points: {}", clean.scan.len(), args.out.display());
    Ok(Outcome::Success)
}

/// `SET/noisy/CLASS/SPLIT/NAME` of `SET/clean/CLASS/SPLIT/NAME`, if it is there.
fn noisy_twin(scan: &Path) -> Option<PathBuf> {
    let clean = scan.ancestors().nth(3)?;
    let inside = scan.strip_prefix(clean).ok()?;
    (clean.file_name()? == "clean")
        .then(|| clean.with_file_name("noisy").join(inside))
        .filter(|twin| twin.exists())
}
