//! Raw little-endian f32 without a header, the format of KITTI's scans (x, y, z and intensity of
//! each point) and nuScenes' (the same and the ring).
//!
//! The name can state another number of columns: `NAME.f32x6.bin` has six.

use std::fs::File;
use std::io::{BufRead, Read, Write};
use std::path::Path;

use super::columns::{Extra, Rows, Unit};
use super::precision::{self, Precision};
use super::{Cloud, CloudFormat};
use crate::atomic;
use crate::error::FormatError;
use crate::foreign::foreign;
use crate::number::{ByteOrder, NumberType};
use crate::records;

/// x, y, z, intensity.
const KITTI_COLUMNS: usize = 4;
const NUSCENES_COLUMNS: usize = 5;
const COLUMN_SIZE: usize = size_of::<f32>();

/// Columns of fewer points could be so by chance.
const FEWEST: usize = 5;

/// What to do where the format may not be KITTI's.
pub(super) const REMEDY: &str = "name the format by --format: kitti has four f32 for each point, nuscenes five; a file called \
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
    let points = start.as_chunks::<{ KITTI_COLUMNS * COLUMN_SIZE }>().0;
    let intensity = |point: &[u8]| NumberType::F32.decode(&point[12..], ByteOrder::Little);
    let negative = points.iter().filter(|point| intensity(&point[..]) < 0.0).count();
    points.len() >= FEWEST && negative > points.len() / 10
}

/// Whether a tenth of the fifth numbers, at least, is not whole.
fn has_fractions(start: &[u8]) -> bool {
    let points = start.as_chunks::<{ NUSCENES_COLUMNS * COLUMN_SIZE }>().0;
    let fifth = |point: &[u8]| NumberType::F32.decode(&point[16..], ByteOrder::Little);
    let broken = points.iter().filter(|point| fifth(&point[..]).fract() != 0.0).count();
    points.len() >= FEWEST && broken > points.len() / 10
}

/// Whether each fifth number is a small whole number, as the rings of nuScenes are, and others are
/// not.
fn has_rings(start: &[u8]) -> bool {
    let points = start.as_chunks::<{ NUSCENES_COLUMNS * COLUMN_SIZE }>().0;
    let number = |point: &[u8], at: usize| {
        NumberType::F32.decode(&point[at * COLUMN_SIZE..], ByteOrder::Little)
    };
    let is_whole = |x: f64| x.fract() == 0.0;
    let is_ring = |x: f64| is_whole(x) && (0.0..256.0).contains(&x);
    points.len() >= FEWEST
        && points.iter().all(|point| is_ring(number(point, 4)))
        && points.iter().any(|point| number(point, 4) != number(&points[0], 4))
        && points.iter().any(|point| (0..3).any(|axis| !is_whole(number(point, axis))))
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

/// What f32 may always change in a coordinate, metres.
const COARSEST_M: f64 = 1e-3;

/// Writes `points` with intensity 0.
pub(super) fn write(
    path: &Path,
    format: CloudFormat,
    points: &[[f64; 3]],
) -> Result<(), FormatError> {
    let columns = columns(format, path);
    if columns != KITTI_COLUMNS {
        let cause = format!("files of {columns} columns are read but not written");
        return Err(FormatError::malformed(path, "extension", cause));
    }
    let fits = |x: &f64| !x.is_finite() || (*x as f32).is_finite();
    if let Some(i) = points.iter().position(|point| !point.iter().all(fits)) {
        let cause = format!("{:?} does not fit f32, the format's only type", points[i]);
        return Err(FormatError::malformed(path, format!("point {i}"), cause));
    }
    let loss_m = precision::loss(points);
    if loss_m > COARSEST_M && Precision::tolerable(points) == Precision::Double {
        let cause = format!(
            "f32, the format's only type, changes coordinates by {loss_m:.4} m: move the origin near the \
             points, or choose another format"
        );
        return Err(FormatError::malformed(path, "points", cause));
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
