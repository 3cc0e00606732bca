//! `edgepuck view`: a page or a picture that shows points, meshes, boxes and scenes in three dimensions.

mod boxes;
pub mod files;
pub mod frame;
mod packed;
mod page;
mod picture;
pub mod preview;
#[cfg(feature = "mcap")]
mod recording;
mod scene;

use crate::flags::copy_among;
use crate::points::PointsArgs;
use crate::{Outcome, Usage};
use anyhow::{bail, ensure};
use files::Content;
use formats::hash::of_bytes;
use frame::{Pane, Placed};
use program::outputs::{Overwrite, need_extension};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The most points of a page: of a longer drive, every second or third sweep is shown, and so on.
const MOST_POINTS: usize = 3_000_000;

/// The most clouds of a packed set or a recording, turns of a capture and files of a folder that are shown.
const MOST_FRAMES: usize = 500;

#[derive(clap::Args)]
pub struct Args {
    /// What to show: scans, sweeps and clouds of any format; captures and recordings (.mcap); meshes,
    /// robots and scenes (.toml), with what their sensors see; packed sets; folders of sweeps, scans,
    /// meshes or clusters, of a data set or of a sequence of SemanticKITTI. A mesh lies under its scan,
    /// and two others stand side by side. Boxes, as of detect (.json) and live (.jsonl), are drawn in
    /// what is named before them
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,

    /// Boxes to draw as truth: the JSON file of a sweep of gen-scenes, or as of detect
    #[arg(long, value_name = "FILE")]
    truth: Option<PathBuf>,

    #[command(flatten)]
    points: PointsArgs,

    /// Page (.html) or picture (.png) to write [default: a page in the folder for temporary files, which is
    /// opened]. A picture shows the first frame, or the first with boxes
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if let Some(out) = &args.out {
        need_extension("--out", out, &["html", "png"])?;
        args.overwrite.check([&**out])?;
        if out.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("png")) {
            return picture::draw(args, out);
        }
    }
    let mut panes =
        panes(&args.files, args.truth.as_deref(), |file| files::read(file, &args.points))?;
    let most = MOST_POINTS / panes.len();
    panes.iter_mut().for_each(|pane| pane.thin(most));
    if panes.iter().all(Pane::is_empty) {
        let files = args.files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>();
        bail!("{}: expected something to show, found no point, mesh or box", files.join(", "));
    }
    let out = args.out.clone().unwrap_or_else(|| temporary(&args.files[0]));
    page::write(&panes, &out)?;
    let summary = panes.iter().map(Pane::summary).collect::<Vec<_>>();
    program::say!("{}: {}", summary.join(" | "), out.display());
    if args.out.is_none() {
        open(&out);
    }
    Ok(Outcome::Success)
}

/// What `files` hold by `read`, with the boxes among them and those of `truth` in their frames.
pub fn panes(
    files: &[PathBuf],
    truth: Option<&Path>,
    read: impl Fn(&Path) -> anyhow::Result<Content>,
) -> anyhow::Result<Vec<Pane>> {
    if let Some(copy) = copy_among(files)? {
        program::say!("warning: {copy}, and shows the same");
    }
    let (mut panes, mut boxes) = (Vec::<Pane>::new(), Vec::new());
    for file in files {
        let n = panes.len();
        match read(file)? {
            Content::Frames(frames) => {
                panes.push(Pane::new(n, file, frames));
                if files.len() > 1 && panes[n].is_empty() {
                    let file = file.display();
                    program::say!("warning: {file}: nothing is there: no point, mesh or box");
                }
            }
            // Before the first pane, they belong to it.
            Content::Boxes(found) => boxes.push((n.max(1) - 1, file, found)),
        }
    }
    lay_meshes_under_scans(&mut panes);
    ensure!(
        panes.len() <= 2,
        Usage(format!("expected at most two files side by side, found {}", panes.len()))
    );
    if panes.is_empty() {
        panes.push(Pane::new(0, &files[0], Vec::new()));
    }
    for (number, file, found) in boxes {
        // Those of a mesh that lies under its scan belong to the scan.
        let pane = panes.iter().position(|pane| pane.number >= number).unwrap_or(panes.len() - 1);
        panes[pane].add(found, file)?;
    }
    if let Some(file) = truth {
        let truth = |placed| Placed { truth: true, ..placed };
        let found: Vec<_> = boxes::read(file)?.into_iter().map(truth).collect();
        for pane in &mut panes {
            pane.add(found.clone(), file)?;
        }
    }
    Ok(panes)
}

/// Lays each mesh or scene under the points of other files that are its scan, and leaves it out as a pane.
fn lay_meshes_under_scans(panes: &mut Vec<Pane>) {
    let (meshes, mut others): (Vec<_>, Vec<_>) =
        std::mem::take(panes).into_iter().partition(Pane::has_meshes);
    for mesh in meshes {
        let mut lies = false;
        others.iter_mut().for_each(|scan| lies |= scan.lay_over(&mesh));
        if !lies {
            mesh.warn_of_size();
            panes.push(mesh);
        }
    }
    panes.extend(others);
    panes.sort_by_key(|pane| pane.number);
}

/// A page in the folder for temporary files. The same file of the same user has the same page, so that
/// few pile up.
fn temporary(file: &Path) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy();
    let file = file.canonicalize().unwrap_or_else(|_| file.to_path_buf());
    let own = of_bytes(format!("{:?} {}", std::env::home_dir(), file.display()).as_bytes());
    std::env::temp_dir().join(format!("edgepuck-view-{stem}-{}.html", &own[..8]))
}

/// Opens `page` in the browser, if this machine has one; its path is printed anyway.
fn open(page: &Path) {
    let (program, words): (_, &[&str]) = match std::env::consts::OS {
        "windows" => ("cmd", &["/c", "start", ""]),
        "macos" => ("open", &[]),
        _ => ("xdg-open", &[]),
    };
    let mut command = Command::new(program);
    command.args(words).arg(page);
    let _ = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
}
