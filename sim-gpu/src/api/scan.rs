//! A scan of a scene.

use super::{Error, Sensor};
use crate::effects::Effects;
use crate::packets;
use crate::scan::Tally;
use formats::FormatError;
use formats::hash::Hashing;
use formats::scan_file::{ScanFormat, write_scan};
use formats::vlp32c;
use std::ops::Deref;
use std::path::Path;

/// What a sensor measured of a scene. It dereferences to [`formats::Scan`], which has the columns:
///
/// | field | type | of each point |
/// | --- | --- | --- |
/// | `positions` | `Vec<[f32; 3]>` | metres in the world, less `origin` |
/// | `origin` | `[f64; 3]` | what to add to each position, metres; 0 near the world's origin |
/// | `pose` | `Option<[f64; 16]>` | from the sensor's frame to the world's, 4 by 4 row by row; `None` is the identity |
/// | `range_m`, `time_s`, `intensity` | `Option<Vec<f32>>` | distance, seconds since the scan began, 0 to 1 |
/// | `beam`, `object`, `triangle` | `Option<Vec<u32>>` | number of the beam, instance and triangle |
/// | `ring` | `Option<Vec<u16>>` | row of the beam, from below |
/// | `normal` | `Option<Vec<[f32; 3]>>` | unit normal of the surface |
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Scan {
    /// The points, with a column for each attribute that was asked for.
    pub points: formats::Scan,
    /// What became of the returns.
    pub tally: Tally,
    /// Whether the CPU cast because a mesh exceeds the adapter's largest binding.
    pub cast_on_cpu: bool,
    sensor: Sensor,
    effects: Effects,
}

impl Scan {
    pub(super) fn new(
        points: formats::Scan,
        tally: Tally,
        cast_on_cpu: bool,
        sensor: Sensor,
        effects: Effects,
    ) -> Self {
        Self { points, tally, cast_on_cpu, sensor, effects }
    }

    /// Writes the scan in the format that the extension names: `.npz` (NumPy, Open3D), `.ply`,
    /// `.csv`, `.pcd`, or `.pcap`, the packets of a VLP-32C. Missing folders are created.
    ///
    /// # Errors
    /// The extension names no format, or the file cannot be written. For `.pcap`: the sensor is
    /// not what [`Sensor::with_packet_geometry`] gives; the scan lacks the attributes `beam` and
    /// `range`; an effect moves points off their beams.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        match ScanFormat::of_path(path)? {
            ScanFormat::Pcap => {
                let of_file = |cause: String| FormatError::malformed(path, "packets", cause);
                let returns = packets::returns(&self.effects, None);
                let returns = returns.map_err(|invalid| of_file(invalid.to_string()))?;
                let revolution = packets::revolution(self.sensor.profile()).map_err(|invalid| {
                    of_file(format!(
                        "expected the beams of Sensor::with_packet_geometry: {invalid}"
                    ))
                })?;
                if self.beam.is_none() || self.range_m.is_none() {
                    let cause = "expected a scan with the attributes beam and range";
                    return Err(of_file(cause.to_owned()).into());
                }
                vlp32c::write(path, Hashing::None, &revolution, returns, &self.points)?;
            }
            format => {
                write_scan(path, format, Hashing::None, &self.points)?;
            }
        }
        Ok(())
    }
}

impl Deref for Scan {
    type Target = formats::Scan;

    fn deref(&self) -> &formats::Scan {
        &self.points
    }
}
