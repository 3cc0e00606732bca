//! `edgepuck preview`: a picture of points, meshes and boxes.

use crate::points::PointsArgs;
use crate::view::{files, panes};
use crate::{Outcome, Usage, preview};
use anyhow::ensure;
use formats::outputs::{Overwrite, need_extension};
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
pub struct Args {
    /// What to draw: points, meshes and boxes of all kinds that view takes. Of a capture, a folder or
    /// a packed set, the first is drawn; of a scene (.toml), what its sensors see. If a scan is in
    /// the folder clean/ of a dataset, its noisy version is drawn below it. Boxes, as of detect
    /// (.json) and live (.jsonl), are drawn in what is named before them
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Boxes to draw as truth: the JSON file of a sweep of gen-scenes, or as of detect
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,

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
    let file = &args.files[0];
    let read = |file: &Path| files::first_frame(file, &args.points);
    let mut panes = panes(&args.files, args.truth.as_deref(), read)?;
    ensure!(
        panes.len() == 1,
        Usage(
            "expected one file and perhaps boxes, found two files: draw each, or see both by view"
                .into()
        )
    );
    panes[0].frames.truncate(1);
    // Meshes are drawn where there are no points.
    for frame in panes[0].frames.iter_mut().filter(|frame| frame.n_points() > 0) {
        frame.meshes.clear();
    }
    let (told, is_empty) = (panes[0].told(), panes[0].is_empty());
    let Some(shown) = panes[0].frames.pop().filter(|_| !is_empty) else {
        formats::say!("{}: expected points, meshes or boxes to draw, found none", file.display());
        return Ok(Outcome::SomeRefused);
    };
    let noisy = noisy_twin(file).map(|file| args.points.read(&file)).transpose()?;
    let title = file.file_stem().unwrap_or_default().to_string_lossy();
    preview::draw(&shown, noisy.as_ref(), &title, &args.out)?;
    formats::say!("{told}: {}", args.out.display());
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
