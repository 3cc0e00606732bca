//! `edgepuck preview`: a picture of a scan.

use crate::{Outcome, preview};
use formats::scan_file::read_scan;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// Scan to draw, .npz or .ply; if it is in the folder clean/ of a dataset, its noisy version is
    /// drawn below it
    #[arg(value_name = "SCAN")]
    scan: PathBuf,

    /// Second scan, drawn below the first
    #[arg(long, value_name = "SCAN")]
    noisy: Option<PathBuf>,

    /// PNG file to write
    #[arg(long, default_value = "scan.png", value_name = "PNG")]
    out: PathBuf,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let clean = read_scan(&args.scan)?;
    let noisy = match &args.noisy {
        Some(file) => Some(read_scan(file)?),
        None => noisy_twin(&args.scan).map(|file| read_scan(&file)).transpose()?,
    };
    let title = args.scan.file_stem().unwrap_or_default().to_string_lossy();
    preview::draw(&clean, noisy.as_ref(), &title, &args.out)?;
    eprintln!("{} points: {}", clean.len(), args.out.display());
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
