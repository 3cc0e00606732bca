//! The picture in memory, its text and its way into a PNG file.

use std::path::Path;

use anyhow::{Context, Result};
use formats::atomic;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Hack, under the MIT and Bitstream Vera licences. It comes with the program,
/// since a bare machine has no fonts.
const FONT: &[u8] = epaint_default_fonts::HACK_REGULAR;
const FONT_NAME: &str = "preview";

/// Draws a picture of 8-bit RGB pixels to the PNG file `out`, atomically: `title` in a heading
/// `title_height` pixels high, and below it what `draw` adds.
pub fn draw_png(
    out: &Path,
    (width, height): (u32, u32),
    (title, title_height): (&str, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<()>,
) -> Result<()> {
    register_font(FONT_NAME, FontStyle::Normal, FONT)
        .ok()
        .context("invariant: the font that comes with the program can be read")?;
    let mut pixels = vec![0; (width * height * 3) as usize];
    {
        let area = BitMapBackend::with_buffer(&mut pixels, (width, height)).into_drawing_area();
        area.fill(&WHITE)?;
        let (heading, below) = area.split_vertically(title_height);
        heading.draw_text(title, &text(24), (16, 16))?;
        draw(&below)?;
        area.present()?;
    }
    atomic::write(out, |writer| {
        let mut encoder = png::Encoder::new(writer, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&pixels)?;
        Ok(writer.finish()?)
    })
    .with_context(|| format!("drawing {}", out.display()))
}

/// Black text `height` pixels high.
pub fn text(height: u32) -> TextStyle<'static> {
    TextStyle::from((FONT_NAME, height).into_font())
}

/// A number of metres, with the digits that tell it from its neighbour one `step` away.
pub fn metres(value: f64, step: f64) -> String {
    if !(1e-3..1e5).contains(&step) {
        return format!("{value:.1e}");
    }
    let decimals = (-libm::log10(step).floor()).max(0.0) as usize;
    // What would be written as -0 is 0.
    let value = if value.abs() < step * 1e-6 { 0.0 } else { value };
    format!("{value:.decimals$}")
}
