//! A picture of the first of what a page shows.

use super::{Args, files, panes, preview};
use crate::{Outcome, Usage};
use anyhow::ensure;
use std::path::Path;

/// Draws a frame of the files as a PNG file, the first or the first with boxes.
pub fn draw(args: &Args, out: &Path) -> anyhow::Result<Outcome> {
    let file = &args.files[0];
    // The others may be boxes, of any turn.
    let asks = args.truth.is_some() || args.files.len() > 1;
    let read = if asks { files::read } else { files::read_first };
    let mut panes = panes(&args.files, args.truth.as_deref(), |file| read(file, &args.points))?;
    let cause = "expected one file, or a mesh and its scan, and perhaps boxes, found two others: draw \
                 each, or see both in a page";
    ensure!(panes.len() == 1, Usage(cause.into()));
    for frame in &mut panes[0].frames {
        // What a file beside a sweep describes is not asked for.
        let boxes = &mut frame.boxes;
        let is_asked = args.truth.is_some() || asks && boxes.iter().all(|placed| placed.truth);
        boxes.retain(|placed| !placed.truth || is_asked);
    }
    panes[0].keep_one();
    let (summary, is_empty) = (panes[0].summary(), panes[0].is_empty());
    let Some(shown) = panes[0].frames.pop().filter(|_| !is_empty) else {
        program::say!("{}: expected points, meshes or boxes to draw, found none", file.display());
        return Ok(Outcome::SomeRefused);
    };
    preview::draw(&shown, out)?;
    program::say!("{summary}: {}", out.display());
    Ok(Outcome::Success)
}
