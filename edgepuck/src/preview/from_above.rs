use std::path::Path;

use anyhow::Result;
use formats::Scan;
use plotters::prelude::*;

use super::canvas::draw_png;
use super::frame::{Frame, View};
use super::panel::{self, Outline};

const EDGE: u32 = 1200;
const TITLE_HEIGHT: u32 = 44;

/// What is farther from the sensor is left out: the picture would be all road.
const FARTHEST_M: f64 = 50.0;

/// Draws the points of `scan` around its origin, each in its tint, and `outlines` with
/// their classes and scores, to the PNG file `out`, atomically.
pub fn draw_from_above(
    scan: &Scan,
    tints: &[RGBColor],
    outlines: &[Outline<'_>],
    title: &str,
    out: &Path,
) -> Result<()> {
    let finite = scan.positions.iter().flatten().filter(|x| x.is_finite());
    let farthest = finite.fold(1.0, |farthest: f64, x| farthest.max(f64::from(x.abs())));
    let frame = Frame { centre: [0.0; 3], half: farthest.min(FARTHEST_M) };
    let [_, from_above, _] = View::ALL;
    draw_png(out, (EDGE, EDGE + TITLE_HEIGHT), (title, TITLE_HEIGHT), |below| {
        panel::draw(below, from_above, scan, tints, &frame, outlines)
    })
}
