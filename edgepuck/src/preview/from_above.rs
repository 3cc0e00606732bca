use std::path::Path;

use anyhow::Result;
use formats::Scan;
use plotters::prelude::*;

use super::canvas::draw_png;
use super::frame::{Frame, View};
use super::panel::{self, Outline};

/// Pixels of the panel of a sweep, from one edge to the other.
pub const EDGE: u32 = 1200;
const TITLE_HEIGHT: u32 = 44;

/// Draws the points of `scan` around its origin, each in its tint, and `outlines` with
/// their classes and scores, to the PNG file `out`, atomically.
pub fn draw_from_above(
    scan: &Scan,
    tints: &[RGBColor],
    outlines: &[Outline<'_>],
    title: &str,
    out: &Path,
) -> Result<()> {
    let frame = Frame::near_sensor(scan);
    let [_, from_above, _] = View::ALL;
    draw_png(out, (EDGE, EDGE + TITLE_HEIGHT), (title, TITLE_HEIGHT), |below| {
        panel::draw(below, from_above, (scan, tints), &frame, &[], outlines)
    })
}
