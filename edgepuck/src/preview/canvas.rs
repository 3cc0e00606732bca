//! The picture in memory, its text and its way into a PNG file.

use std::path::Path;

use anyhow::{Context, Result};
use formats::atomic;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::register_font;

/// A part of the picture.
pub type Area<'a> = DrawingArea<BitMapBackend<'a>, Shift>;

/// Hack, under the MIT and Bitstream Vera licences. It comes with the program,
/// since a bare machine has no fonts.
const FONT: &[u8] = epaint_default_fonts::HACK_REGULAR;
const FONT_NAME: &str = "preview";

/// A picture of 8-bit RGB pixels.
pub struct Canvas {
    width: u32,
    height: u32,
    pixels: Vec<u8>,
}

impl Canvas {
    /// A black picture of `width` x `height` pixels.
    pub fn new(width: u32, height: u32) -> Result<Self> {
        register_font(FONT_NAME, FontStyle::Normal, FONT)
            .ok()
            .context("invariant: the font that comes with the program can be read")?;
        Ok(Self { width, height, pixels: vec![0; (width * height * 3) as usize] })
    }

    /// The whole picture, to draw on.
    pub fn area(&mut self) -> Area<'_> {
        BitMapBackend::with_buffer(&mut self.pixels, (self.width, self.height)).into_drawing_area()
    }

    /// Writes the picture to the PNG file `out`, atomically.
    pub fn write_png(&self, out: &Path) -> Result<()> {
        atomic::write(out, |writer| {
            let mut encoder = png::Encoder::new(writer, self.width, self.height);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(&self.pixels)?;
            Ok(writer.finish()?)
        })?;
        Ok(())
    }
}

/// Black text `height` pixels high.
pub fn text(height: u32) -> TextStyle<'static> {
    TextStyle::from((FONT_NAME, height).into_font())
}

/// A number of metres, with the digits that tell it from its neighbour one
/// `step` away.
pub fn metres(value: f64, step: f64) -> String {
    if !(1e-3..1e5).contains(&step) {
        return format!("{value:.1e}");
    }
    let decimals = (-step.log10().floor()).max(0.0) as usize;
    // What would be written as -0 is 0.
    let value = if value.abs() < step * 1e-6 { 0.0 } else { value };
    format!("{value:.decimals$}")
}
