//! Images of materials.

use crate::mesh::ColourMap;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Texture {
    map: ColourMap,
    width: usize,
    /// By row, from the top.
    luminance: Vec<f32>,
}

impl Texture {
    /// Reads the BMP, JPEG, PNG or TGA file of `map`; `luminance` is that of an sRGB colour.
    #[cfg(feature = "textures")]
    pub fn load(map: &ColourMap, luminance: impl Fn([f64; 3]) -> f64) -> Result<Self, String> {
        let failed = |error: &dyn std::error::Error| format!("cannot be read: {error}");
        let reader = image::ImageReader::open(&map.image).map_err(|error| failed(&error))?;
        let reader = reader.with_guessed_format().map_err(|error| failed(&error))?;
        let pixels = reader.decode().map_err(|error| failed(&error))?.into_rgb8();
        // A table of the 256 values of each channel.
        let weight = |channel: usize| -> [f64; 256] {
            std::array::from_fn(|value| {
                let mut colour = [0.0; 3];
                let part = map.base + map.gain * value as f64 / 255.0;
                colour[channel] = part.clamp(0.0, 1.0);
                luminance(colour)
            })
        };
        let [red, green, blue] = [0, 1, 2].map(weight);
        let of = |image::Rgb([r, g, b]): &image::Rgb<u8>| {
            (red[usize::from(*r)] + green[usize::from(*g)] + blue[usize::from(*b)]) as f32
        };
        let luminance = pixels.pixels().map(of).collect();
        Ok(Self { map: map.clone(), width: pixels.width() as usize, luminance })
    }

    /// An error: this build reads no images.
    #[cfg(not(feature = "textures"))]
    pub fn load(_: &ColourMap, _: impl Fn([f64; 3]) -> f64) -> Result<Self, String> {
        Err("this build reads no images: build with `--features textures`".to_owned())
    }

    /// The luminance at the texture coordinates `u` to the right and `v` upwards, interpolated
    /// between the centres of pixels. The sides of the image are 1; it repeats unless it is clamped.
    pub fn at(&self, u: f64, v: f64) -> f64 {
        let (width, height) = (self.width, self.luminance.len() / self.width);
        let ColourMap { scale, offset, is_clamped, .. } = self.map;
        let between = |at: f64, n: usize| {
            let margin = 0.5 / n as f64;
            between(if is_clamped { at.clamp(margin, 1.0 - margin) } else { at }, n)
        };
        let (column, right) = between(u * scale[0] + offset[0], width);
        let (row, down) = between(1.0 - (v * scale[1] + offset[1]), height);
        let pixel = |row: usize, column: usize| {
            f64::from(self.luminance[row % height * width + column % width])
        };
        let along = |row| pixel(row, column) * (1.0 - right) + pixel(row, column + 1) * right;
        along(row) * (1.0 - down) + along(row + 1) * down
    }
}

/// The last of `n` pixel centres before `at`, and the fraction of the way to the next.
fn between(at: f64, n: usize) -> (usize, f64) {
    let from_first = (at - at.floor()) * n as f64 - 0.5;
    let before = from_first.floor();
    // The last pixel of the neighbouring image lies before the first.
    let pixel = if before < 0.0 { n - 1 } else { (before as usize).min(n - 1) };
    (pixel, from_first - before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_is_read_between_its_pixels_and_repeats() {
        let map = ColourMap::of("".into());
        let mut image = Texture { map, width: 2, luminance: vec![0.0, 1.0, 0.5, 0.25] };
        // At the centres of pixels: the upper row is at v = 0.75.
        for ([u, v], expected) in [
            ([0.25, 0.75], 0.0),
            ([0.75, 0.75], 1.0),
            ([0.25, 0.25], 0.5),
            ([0.75, 0.25], 0.25),
            ([0.5, 0.75], 0.5),
            ([0.5, 0.5], 0.4375),
            ([0.0, 0.75], 0.5),
            ([1.75, -0.75], 0.25),
            ([-0.25, 0.75], 1.0),
        ] {
            assert_eq!(image.at(u, v), expected, "at {u}, {v}");
        }
        let edge = image.at(1.0 - f64::EPSILON / 2.0, 1e300);
        assert!((0.0..=1.0).contains(&edge), "{edge}");
        image.map.is_clamped = true;
        for ([u, v], expected) in [([-9.0, 9.0], 0.0), ([9.0, 0.5], 0.625), ([0.5, 0.75], 0.5)] {
            assert_eq!(image.at(u, v), expected, "at {u}, {v}");
        }
    }
}
