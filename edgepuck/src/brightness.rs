use crate::{Usage, flags};
use formats::Scan;
use std::path::Path;

/// Flags about the meaning of a file's intensities.
#[derive(clap::Args)]
pub struct BrightnessArgs {
    /// Intensity of a white surface that faces the sensor [default: 1, which is 65535 in LAS]
    #[arg(long, value_name = "I", value_parser = flags::positive)]
    white: Option<f64>,

    /// Reflectivity of all points, from 0 (black) to 1 (white), in place of their intensities
    #[arg(long, value_name = "R", conflicts_with = "white", value_parser = flags::probability)]
    reflectivity: Option<f64>,
}

impl BrightnessArgs {
    /// The brightness of each point of `scan`: the share of the light that it returns in clear air.
    pub fn brightness_of(&self, scan: &Scan, sweep: &Path) -> anyhow::Result<Vec<f32>> {
        if let Some(reflectivity) = self.reflectivity {
            return Ok(vec![reflectivity as f32; scan.len()]);
        }
        let white = self.white.unwrap_or(1.0) as f32;
        let intensities = match (&scan.intensity, &scan.reflectivity) {
            (Some(intensities), _) => intensities.clone(),
            (None, Some(bytes)) => bytes.iter().map(|&byte| f32::from(byte) / 100.0).collect(),
            (None, None) => {
                let sweep = sweep.display();
                let cause = format!("{sweep}: its points have no intensity: give --reflectivity");
                return Err(Usage(cause).into());
            }
        };
        if let Some((i, found)) = (0..).zip(&intensities).find(|(_, i)| !(0.0..).contains(*i)) {
            let sweep = sweep.display();
            anyhow::bail!("{sweep}: point {i}: expected an intensity of 0 or more, found {found}");
        }
        let most = intensities.iter().copied().fold(0.0, f32::max);
        let (sweep, expected) = (sweep.display(), "expected intensities around 0 to");
        if self.white.is_none() && most > 2.55 {
            let cause = format!("{sweep}: {expected} 1, found {most}: give --white");
            return Err(Usage(cause).into());
        }
        if self.white.is_some() && most > 0.0 && white > 255.0 * most {
            let cause = format!("{sweep}: {expected} {white} by --white, found {most} at most");
            return Err(Usage(cause).into());
        }
        Ok(intensities.iter().map(|intensity| intensity / white).collect())
    }

    /// Converts the intensities of `scan`, which are brightnesses, back to the file's units.
    pub fn restore(&self, scan: &mut Scan) {
        let white = self.white.unwrap_or(1.0) as f32;
        scan.intensity.iter_mut().flatten().for_each(|intensity| *intensity *= white);
    }
}
