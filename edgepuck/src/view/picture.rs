//! A picture of the first of what a page shows.

use super::frame::Frame;
use super::{Args, files, panes, preview};
use crate::{Outcome, Usage};
use anyhow::ensure;
use std::path::Path;

/// Draws the first frame of the files as a PNG file, a mesh and its scan together.
pub fn draw(args: &Args, out: &Path) -> anyhow::Result<Outcome> {
    let file = &args.files[0];
    let read = |file: &Path| files::first_frame(file, &args.points);
    let mut panes = panes(&args.files, args.truth.as_deref(), read)?;
    panes.iter_mut().for_each(|pane| pane.frames.truncate(1));
    if panes.len() == 2 {
        let other = panes.pop().and_then(|mut pane| pane.frames.pop());
        panes[0].frames =
            panes[0].frames.pop().zip(other).map(joined).transpose()?.into_iter().collect();
    }
    let (summary, is_empty) = (panes[0].summary(), panes[0].is_empty());
    let Some(shown) = panes[0].frames.pop().filter(|_| !is_empty) else {
        program::say!("{}: expected points, meshes or boxes to draw, found none", file.display());
        return Ok(Outcome::SomeRefused);
    };
    preview::draw(&shown, out)?;
    program::say!("{summary}: {}", out.display());
    Ok(Outcome::Success)
}

/// A mesh and its scan as one frame.
fn joined((one, other): (Frame, Frame)) -> anyhow::Result<Frame> {
    let (mesh, scan) = if one.n_points() == 0 { (one, other) } else { (other, one) };
    ensure!(
        mesh.n_points() == 0 && scan.n_points() > 0,
        Usage(
            "expected one file, or a mesh and its scan, and perhaps boxes, found two others: draw each, \
             or see both in a page"
                .into()
        )
    );
    let meshes = [mesh.meshes, scan.meshes].concat();
    Ok(Frame { meshes, boxes: [mesh.boxes, scan.boxes].concat(), ..scan })
}
