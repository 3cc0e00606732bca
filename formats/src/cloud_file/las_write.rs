//! Writes LAS: version 1.2, point format 0.
//!
//! LAS holds coordinates as whole multiples of a step, from an offset. The step
//! is the finest power of ten, a nanometre at least, in which half the cloud's
//! extent fits 32 bits: 1 nm up to 4 m, 10 nm up to 40 m.

use std::io::{self, BufWriter, Write};
use std::path::Path;

use las::raw::Header;

use crate::atomic;
use crate::error::FormatError;

/// The finest step is ten to this power, finer than any sensor or file needs.
const FINEST: i32 = -9;
/// Most steps from the centre of the cloud to its end, somewhat fewer than `i32` can count.
const MOST_STEPS: f64 = 2e9;

/// What a point has besides its coordinates; 0 is unknown.
#[derive(Clone, Copy, Debug, Default)]
pub struct LasPoint {
    /// The intensity, of which 65535 is the most.
    pub intensity: u16,
    /// The ASPRS's code of its class, below 32.
    pub class: u8,
    /// The user's own number.
    pub user_data: u8,
    /// The number of its source.
    pub source: u16,
}

impl LasPoint {
    /// The fields behind the coordinates in point format 0.
    fn bytes(self) -> [u8; 8] {
        // Return 1 of 1 (LAS 1.2, table 5).
        const RETURN_1_OF_1: u8 = 0b001_001;
        let ([i, intensity], [s, source]) =
            (self.intensity.to_le_bytes(), self.source.to_le_bytes());
        [i, intensity, RETURN_1_OF_1, self.class, 0, self.user_data, s, source]
    }
}

#[derive(Clone, Copy)]
struct Axis {
    low: f64,
    high: f64,
    step: f64,
    offset: f64,
}

/// Writes `points` with the other fields that `of` returns for the index of each, atomically.
///
/// # Errors
/// A coordinate that is not finite; errors of the system.
pub fn write_las(
    path: &Path,
    points: &[[f64; 3]],
    of: impl Fn(usize) -> LasPoint,
) -> Result<(), FormatError> {
    let infinite = |point: &[f64; 3]| point.iter().any(|x| !x.is_finite());
    if let Some(i) = points.iter().position(infinite) {
        let cause = format!("{:?} is not finite, and LAS holds whole numbers", points[i]);
        return Err(FormatError::malformed(path, format!("point {i}"), cause));
    }
    let n = u32::try_from(points.len()).map_err(|_| {
        FormatError::malformed(path, "points", format!("{} are too many for LAS", points.len()))
    })?;
    let axes = [0, 1, 2].map(|axis| Axis::around(points.iter().map(|point| point[axis])));
    atomic::write(path, |writer: &mut BufWriter<_>| {
        header(n, &axes).write_to(&mut *writer).map_err(io::Error::other)?;
        for (i, point) in points.iter().enumerate() {
            for (axis, &x) in axes.iter().zip(point) {
                writer.write_all(&axis.steps(x).to_le_bytes())?;
            }
            writer.write_all(&of(i).bytes())?;
        }
        Ok(())
    })
}

impl Axis {
    fn around(coordinates: impl Iterator<Item = f64> + Clone) -> Self {
        let low = coordinates.clone().reduce(f64::min).unwrap_or_default();
        let high = coordinates.reduce(f64::max).unwrap_or_default();
        // Halves first: the extent of all f64 is infinite.
        let (half_extent, middle) = (high / 2.0 - low / 2.0, high / 2.0 + low / 2.0);
        let fits = |step: &f64| half_extent / step <= MOST_STEPS;
        let mut steps = (FINEST..=f64::MAX_10_EXP).map(|k| 10f64.powi(k));
        let step = steps.find(fits).unwrap_or(f64::MAX);
        // A multiple of the step, so that coordinates with few digits keep them.
        let multiple = (middle / step).round() * step;
        let offset = if multiple.is_finite() { multiple } else { middle };
        Self { low, high, step, offset }
    }

    fn steps(&self, x: f64) -> i32 {
        let steps = ((x - self.offset) / self.step).round();
        // Half a step beyond the largest f64 there is infinity.
        let is_finite = (steps * self.step + self.offset).is_finite();
        (if is_finite { steps } else { steps - steps.signum() }) as i32
    }
}

fn header(n: u32, [x, y, z]: &[Axis; 3]) -> Header {
    Header {
        number_of_point_records: n,
        number_of_points_by_return: [n, 0, 0, 0, 0],
        generating_software: padded(concat!("Edgepuck ", env!("CARGO_PKG_VERSION"))),
        x_scale_factor: x.step,
        x_offset: x.offset,
        min_x: x.low,
        max_x: x.high,
        y_scale_factor: y.step,
        y_offset: y.offset,
        min_y: y.low,
        max_y: y.high,
        z_scale_factor: z.step,
        z_offset: z.offset,
        min_z: z.low,
        max_z: z.high,
        ..Header::default()
    }
}

fn padded(text: &str) -> [u8; 32] {
    let mut bytes = [0; 32];
    let n = text.len().min(bytes.len());
    bytes[..n].copy_from_slice(&text.as_bytes()[..n]);
    bytes
}
