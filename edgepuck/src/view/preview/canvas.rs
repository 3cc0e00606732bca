//! A picture in memory, in which near things hide far ones, and its way into a PNG file.

use anyhow::{Context, Result};
use formats::atomic;
use sim_gpu::glam::{DVec2, DVec3};
use std::path::Path;

use crate::colours::Rgb;

/// Samples along each edge of a pixel; their mean makes edges smooth.
const FINE: usize = 2;

/// A white picture. Places are (x to the right, y downwards, nearness), in pixels.
pub struct Canvas {
    /// Samples from the left to the right and from the top to the bottom.
    size: [usize; 2],
    samples: Vec<(f64, Rgb)>,
}

impl Canvas {
    /// A picture of this width and height, pixels.
    pub fn new(size: DVec2) -> Self {
        let size = size.to_array().map(|pixels| pixels as usize * FINE);
        Self { size, samples: vec![(f64::NEG_INFINITY, [255; 3]); size[0] * size[1]] }
    }

    pub fn disc(&mut self, at: DVec3, radius: f64, tint: Rgb) {
        let reach = DVec3::new(radius, radius, 0.0);
        self.fill([at - reach, at + reach], tint, |place| {
            (place.distance(at.truncate()) <= radius).then_some(at.z)
        });
    }

    pub fn triangle(&mut self, [a, b, c]: [DVec3; 3], tint: Rgb) {
        let side = |from: DVec3, to: DVec3, place: DVec2| {
            (to - from).truncate().perp_dot(place - from.truncate())
        };
        let area = side(a, b, c.truncate());
        if area == 0.0 || !area.is_finite() {
            return;
        }
        self.fill([a.min(b).min(c), a.max(b).max(c)], tint, |place| {
            let shares = [side(b, c, place), side(c, a, place), side(a, b, place)];
            let [of_a, of_b, of_c] = shares.map(|share| share / area);
            let is_inside = of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0;
            is_inside.then_some(of_a * a.z + of_b * b.z + of_c * c.z)
        });
    }

    /// A line of discs, over all that is drawn.
    pub fn line(&mut self, from: DVec3, to: DVec3, tint: Rgb) {
        /// This many steps cross any picture.
        const MOST_STEPS: f64 = 10_000.0;
        let steps = (2.0 * from.truncate().distance(to.truncate())).clamp(1.0, MOST_STEPS).ceil();
        for step in 0..=steps as usize {
            let at = from.lerp(to, step as f64 / steps);
            self.disc(at.with_z(f64::MAX), 1.2, tint);
        }
    }

    /// Gives each sample in a rectangle where `nearness` is known its tint, unless a nearer thing is there.
    fn fill(
        &mut self,
        [low, high]: [DVec3; 2],
        tint: Rgb,
        nearness: impl Fn(DVec2) -> Option<f64>,
    ) {
        // Casts saturate: what lies outside the picture has an empty range.
        let range = |axis: usize| {
            let [low, high] = [low[axis], high[axis]].map(|at| at * FINE as f64);
            (low.floor() as usize).min(self.size[axis])..(high.ceil() as usize).min(self.size[axis])
        };
        let (across, down) = (range(0), range(1));
        for y in down {
            for x in across.clone() {
                let place = (DVec2::new(x as f64, y as f64) + 0.5) / FINE as f64;
                let sample = &mut self.samples[y * self.size[0] + x];
                if let Some(nearness) = nearness(place).filter(|nearness| *nearness >= sample.0) {
                    *sample = (nearness, tint);
                }
            }
        }
    }

    /// The mean of the samples of each pixel of a row.
    fn row(&self, y: usize) -> impl Iterator<Item = u8> {
        let of_pixel = move |x: usize| {
            let inside = (0..FINE * FINE).map(move |i| {
                let (y, x) = (FINE * y + i / FINE, FINE * x + i % FINE);
                self.samples[y * self.size[0] + x].1.map(usize::from)
            });
            let sum = inside.reduce(|sum, tint| [0, 1, 2].map(|of| sum[of] + tint[of]));
            sum.unwrap_or_default().map(|sum| (sum / (FINE * FINE)) as u8)
        };
        (0..self.size[0] / FINE).flat_map(of_pixel)
    }

    /// Writes it to the PNG file `out`, atomically.
    pub fn save(&self, out: &Path) -> Result<()> {
        let [width, height] = self.size.map(|samples| samples / FINE);
        let pixels: Vec<u8> = (0..height).flat_map(|y| self.row(y)).collect();
        atomic::write(out, |writer| {
            let mut encoder = png::Encoder::new(writer, width as u32, height as u32);
            encoder.set_color(png::ColorType::Rgb);
            encoder.set_depth(png::BitDepth::Eight);
            let mut writer = encoder.write_header()?;
            writer.write_image_data(&pixels)?;
            Ok(writer.finish()?)
        })
        .with_context(|| format!("drawing {}", out.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Rgb = [200, 0, 0];
    const BLUE: Rgb = [0, 0, 200];

    fn pixel(canvas: &Canvas, [x, y]: [usize; 2]) -> Rgb {
        let row: Vec<u8> = canvas.row(y).collect();
        [0, 1, 2].map(|channel| row[3 * x + channel])
    }

    /// The triangle with the legs x = 0 and y = 0, 20 pixels long, this near.
    fn half(nearness: f64) -> [DVec3; 3] {
        [[0.0, 0.0], [20.0, 0.0], [0.0, 20.0]].map(|at| DVec2::from(at).extend(nearness))
    }

    #[test]
    fn nearer_things_hide_farther_ones_in_either_order() {
        for order in [[(1.0, RED), (2.0, BLUE)], [(2.0, BLUE), (1.0, RED)]] {
            let mut canvas = Canvas::new(DVec2::splat(20.0));
            order.into_iter().for_each(|(nearness, tint)| canvas.triangle(half(nearness), tint));
            canvas.disc(DVec3::new(5.0, 5.0, 0.0), 3.0, RED);
            assert_eq!(pixel(&canvas, [5, 5]), BLUE);
            canvas.disc(DVec3::new(5.0, 5.0, 3.0), 3.0, RED);
            assert_eq!(pixel(&canvas, [5, 5]), RED);
        }
    }

    #[test]
    fn slanted_triangles_hide_by_the_nearness_of_each_pixel() {
        let mut canvas = Canvas::new(DVec2::splat(20.0));
        // Its nearness is 0 at the left and 20 at the right; the other's is 5 everywhere.
        let slanted = half(0.0).map(|at| at.with_z(at.x));
        canvas.triangle(slanted, RED);
        canvas.triangle(half(5.0), BLUE);
        assert_eq!([[2, 2], [8, 2]].map(|at| pixel(&canvas, at)), [BLUE, RED]);
    }
}
