//! Raw little-endian f32, the format of KITTI's scans: x, y, z and intensity of
//! each point, without a header.
//!
//! The name can state another number of columns: `NAME.f32x5.bin` has five, and
//! nuScenes's `NAME.pcd.bin` has five as well (x, y, z, intensity, ring).

use std::io::{BufRead, Write};
use std::path::Path;

use crate::atomic;
use crate::error::FormatError;
use crate::number::{ByteOrder, NumberType};
use crate::records;

/// x, y, z, intensity.
const KITTI_COLUMNS: usize = 4;
const NUSCENES_COLUMNS: usize = 5;
const COLUMN_SIZE: usize = size_of::<f32>();

pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut points = Vec::new();
    read_points(reader, name, |number| points.push([0, 1, 2].map(number)))?;
    Ok(points)
}

/// The fourth number of every point, its intensity; `None` if the points have three.
pub(super) fn read_intensities(
    reader: &mut impl BufRead,
    name: &Path,
) -> Result<Option<Vec<f32>>, FormatError> {
    if columns(name) < KITTI_COLUMNS {
        return Ok(None);
    }
    let mut intensities = Vec::new();
    read_points(reader, name, |number| intensities.push(number(3) as f32))?;
    Ok(Some(intensities))
}

/// Passes the numbers of every point, by their index, to `take`.
fn read_points(
    reader: &mut impl BufRead,
    name: &Path,
    mut take: impl FnMut(&dyn Fn(usize) -> f64),
) -> Result<(), FormatError> {
    let start = reader.fill_buf().map_err(|source| FormatError::io(name, source))?;
    if is_velodyne_packets(start) {
        let cause = "expected points, found raw Velodyne packets: decode them first";
        return Err(FormatError::malformed(name, "format", cause));
    }
    let columns = columns(name);
    let mut count = 0;
    let rest = records::read_to_end(reader, columns * COLUMN_SIZE, |record| {
        count += 1;
        take(&|column| NumberType::F32.decode(&record[column * COLUMN_SIZE..], ByteOrder::Little));
    });
    match rest.map_err(|source| FormatError::io(name, source))? {
        0 => Ok(()),
        rest => {
            let cause =
                format!("expected {} bytes, {columns} f32, found {rest}", columns * COLUMN_SIZE);
            Err(FormatError::malformed(name, format!("point {count}"), cause))
        }
    }
}

/// The number of columns by the file's name, at least three.
fn columns(name: &Path) -> usize {
    let name = name.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let stem = name.strip_suffix(".bin").unwrap_or(&name);
    let stated = stem.rsplit_once(".f32x").and_then(|(_, columns)| columns.parse().ok());
    match stated {
        Some(columns @ 3..=64) => columns,
        _ if stem.ends_with(".pcd") => NUSCENES_COLUMNS,
        _ => KITTI_COLUMNS,
    }
}

/// Whether `start` begins with two blocks of a Velodyne data packet, which could be mistaken for
/// points: each has 100 bytes and begins with the flag 0xFFEE (VLP-16 user manual, 9.3).
fn is_velodyne_packets(start: &[u8]) -> bool {
    const FLAG: &[u8] = &[0xff, 0xee];
    start.starts_with(FLAG) && start.get(100..102) == Some(FLAG)
}

/// Writes `points` with intensity 0.
pub(super) fn write(path: &Path, points: &[[f64; 3]]) -> Result<(), FormatError> {
    let columns = columns(path);
    if columns != KITTI_COLUMNS {
        let cause = format!("files of {columns} columns are read but not written");
        return Err(FormatError::malformed(path, "extension", cause));
    }
    let fits = |x: &f64| !x.is_finite() || (*x as f32).is_finite();
    if let Some(i) = points.iter().position(|point| !point.iter().all(fits)) {
        let cause = format!("{:?} does not fit f32, the format's only type", points[i]);
        return Err(FormatError::malformed(path, format!("point {i}"), cause));
    }
    atomic::write(path, |writer| {
        points.iter().try_for_each(|&[x, y, z]| {
            let record = [x, y, z, 0.0].map(|number| (number as f32).to_le_bytes());
            writer.write_all(record.as_flattened())
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_tells_the_columns() {
        for (name, expected) in [
            ("000000.bin", 4),
            ("a/frame.f32x5.bin", 5),
            ("frame.F32X3.BIN", 3),
            ("frame.f32x2.bin", 4),
            ("frame.f32x99999999999999999999.bin", 4),
            ("n015__LIDAR_TOP__1533.pcd.bin", 5),
            ("-", 4),
            ("", 4),
        ] {
            assert_eq!(columns(Path::new(name)), expected, "{name}");
        }
    }
}
