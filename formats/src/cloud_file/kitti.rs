//! Raw little-endian f32 without a header, the format of KITTI's scans (x, y, z and intensity of
//! each point) and nuScenes' (the same and the ring).
//!
//! The name can state another number of columns: `NAME.f32x6.bin` has six.

use std::fs::File;
use std::io::{BufRead, Read};
use std::path::Path;

use super::columns::{Extra, Rows, Unit};
use super::{Cloud, CloudFormat};
use crate::error::FormatError;
use crate::number::{ByteOrder, NumberType};
use crate::plausible::foreign;
use crate::records;

/// x, y, z, intensity.
const KITTI_COLUMNS: usize = 4;
const NUSCENES_COLUMNS: usize = 5;
const COLUMN_SIZE: usize = size_of::<f32>();

/// Columns of fewer points could be so by chance.
const FEWEST: usize = 5;

/// What to do where the format may not be KITTI's.
pub(super) const REMEDY: &str = "name the format by --input-format: kitti has four f32 for each point, nuscenes five; a file called \
     NAME.f32x6.bin has six";

pub(super) fn read(
    reader: &mut impl BufRead,
    format: CloudFormat,
    name: &Path,
) -> Result<Cloud, FormatError> {
    let columns = columns(format, name);
    let has_ring = format == CloudFormat::Nuscenes && columns == NUSCENES_COLUMNS;
    let extras = [Extra::Intensity(Unit::Own), Extra::Ring];
    let n_extras = if has_ring { 2 } else { usize::from(columns >= KITTI_COLUMNS) };
    let mut rows = Rows::new(extras.into_iter().take(n_extras));
    let mut row = vec![0.0; 3 + n_extras];
    read_points(reader, columns, name, |number| {
        row.iter_mut().enumerate().for_each(|(column, value)| *value = number(column));
        rows.push(&row);
    })?;
    Ok(rows.cloud())
}

/// Checks that a file of KITTI has no fifth column of rings, or intensities that are coordinates, where
/// its name alone makes it KITTI's, and both where a user named the format; and that one of nuScenes
/// has rings.
pub(super) fn check_columns(
    file: &mut File,
    path: &Path,
    format: CloudFormat,
    is_named: bool,
) -> Result<(), FormatError> {
    /// Bytes at the start of the file that are examined.
    const EXAMINED: u64 = 1 << 16;
    let mut start = Vec::new();
    let size = file.metadata().map(|metadata| metadata.len());
    let size = size.and_then(|size| {
        file.take(EXAMINED).read_to_end(&mut start)?;
        std::io::Seek::rewind(file)?;
        Ok(size)
    });
    let size = size.map_err(|source| FormatError::io(path, source))?;
    let are_rings = size % (NUSCENES_COLUMNS * COLUMN_SIZE) as u64 == 0 && has_rings(&start);
    let are_negative = has_negative_intensities(&start);
    let seem = match format {
        CloudFormat::Nuscenes if has_fractions(&start) => {
            "the fifth numbers are not whole, as rings are"
        }
        CloudFormat::Nuscenes => return Ok(()),
        _ if are_rings && (are_negative || !is_named) => {
            "the fifth numbers look like rings of nuScenes"
        }
        _ if are_negative && !is_named => "the fourth numbers are negative, as intensities are not",
        _ => return Ok(()),
    };
    match stated_columns(path) {
        None if !is_velodyne_packets(&start) => {
            Err(FormatError::malformed(path, "format", format!("{seem}: {REMEDY}")))
        }
        _ => Ok(()),
    }
}

/// Whether a tenth of the fourth numbers, at least, is below 0: of coordinates around a sensor, half
/// is.
fn has_negative_intensities(start: &[u8]) -> bool {
    let negative = points(start, KITTI_COLUMNS).filter(|point| point[3] < 0.0).count();
    let n = points(start, KITTI_COLUMNS).count();
    n >= FEWEST && negative > n / 10
}

/// Whether a tenth of the fifth numbers, at least, is not whole.
fn has_fractions(start: &[u8]) -> bool {
    let broken = points(start, NUSCENES_COLUMNS).filter(|point| point[4].fract() != 0.0).count();
    let n = points(start, NUSCENES_COLUMNS).count();
    n >= FEWEST && broken > n / 10
}

/// Whether each fifth number is a small whole number, as the rings of nuScenes are, and others are
/// not.
fn has_rings(start: &[u8]) -> bool {
    let points = || points(start, NUSCENES_COLUMNS);
    let first = points().next().map_or(0.0, |point| point[4]);
    points().count() >= FEWEST
        && points().all(|point| point[4].fract() == 0.0 && (0.0..256.0).contains(&point[4]))
        && points().any(|point| point[4] != first)
        && points().any(|point| point[..3].iter().any(|x| x.fract() != 0.0))
}

/// The points at the start of a file with this number of columns, without one that is cut off.
fn points(start: &[u8], columns: usize) -> impl Iterator<Item = Vec<f32>> {
    let point = |bytes: &[u8]| bytes.as_chunks().0.iter().map(|x| f32::from_le_bytes(*x)).collect();
    start.chunks_exact(columns * COLUMN_SIZE).map(point)
}

/// Passes the numbers of every point, by their index, to `take`.
fn read_points(
    reader: &mut impl BufRead,
    columns: usize,
    name: &Path,
    mut take: impl FnMut(&dyn Fn(usize) -> f64),
) -> Result<(), FormatError> {
    let start = reader.fill_buf().map_err(|source| FormatError::io(name, source))?;
    let packets = is_velodyne_packets(start).then_some("raw Velodyne packets: decode them first");
    // Of other kinds, the first bytes can be those of a number.
    let is_text = start.iter().take(16).all(|byte| (b' '..127).contains(byte));
    if let Some(found) = packets.or(foreign(start).filter(|_| is_text)) {
        let cause = format!("expected points, found {found}");
        return Err(FormatError::malformed(name, "format", cause));
    }
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

/// The number of columns, by the file's name if that states it.
fn columns(format: CloudFormat, name: &Path) -> usize {
    let of_format = if format == CloudFormat::Nuscenes { NUSCENES_COLUMNS } else { KITTI_COLUMNS };
    stated_columns(name).unwrap_or(of_format)
}

/// The number of columns that the file's name states, at least three.
fn stated_columns(name: &Path) -> Option<usize> {
    let name = name.file_name()?.to_string_lossy().to_lowercase();
    let columns = name.strip_suffix(".bin")?.rsplit_once(".f32x")?.1.parse().ok();
    columns.filter(|columns| (3..=64).contains(columns))
}

/// Whether `start` begins with two blocks of a Velodyne data packet, which could be mistaken for
/// points: each has 100 bytes and begins with the flag 0xFFEE (VLP-16 user manual, 9.3).
fn is_velodyne_packets(start: &[u8]) -> bool {
    const FLAG: &[u8] = &[0xff, 0xee];
    start.starts_with(FLAG) && start.get(100..102) == Some(FLAG)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_tells_the_columns() {
        for (name, expected) in [
            ("000000.bin", None),
            ("a/frame.f32x5.bin", Some(5)),
            ("frame.F32X3.BIN", Some(3)),
            ("frame.f32x2.bin", None),
            ("frame.f32x99999999999999999999.bin", None),
            ("n015__LIDAR_TOP__1533.pcd.bin", None),
            ("-", None),
            ("", None),
        ] {
            assert_eq!(stated_columns(Path::new(name)), expected, "{name}");
        }
    }
}
