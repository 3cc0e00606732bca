//! PCD, the Point Cloud Library's format: text, binary or LZF-compressed.
//!
//! The crate `pcd-rs` is not used: it indexes beyond its buffers if a compressed
//! file is shorter than its header states, and allocates a vector for every field
//! of every point.

use std::io::{self, BufRead, Read, Write};
use std::path::Path;

use super::columns::Rows;
use super::pcd_header::{Coordinate, Encoding, Header, read_header};
use super::precision::Precision;
use super::{Cloud, lzf};
use crate::decoding::{error_in, invalid};
use crate::error::FormatError;
use crate::lines::Lines;
use crate::number::{ByteOrder, NumberType};
use crate::records;

pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Cloud, FormatError> {
    let mut lines = Lines::new(reader, name);
    let mut header = read_header(&mut lines, name)?;
    let (columns, extras) =
        header.columns().map_err(|cause| FormatError::malformed(name, "FIELDS", cause))?;
    let mut rows = Rows::new(extras);
    match header.encoding {
        Encoding::Ascii => read_ascii(&mut lines, header.n, &columns, &mut rows)?,
        Encoding::Binary => {
            let size = usize::try_from(header.point_size()).unwrap_or(usize::MAX);
            let mut row = vec![0.0; columns.len()];
            let read = records::read(lines.reader, size, header.n, |point| {
                for (value, column) in row.iter_mut().zip(&columns) {
                    *value = column.decode(&point[column.offset as usize..]);
                }
                rows.push(&row);
            });
            read.and_then(|()| records::check_end(lines.reader, size, header.n))
                .map_err(|error| error_in(name, "points", error))?;
        }
        Encoding::Compressed => read_compressed(lines.reader, &mut header, &mut rows)
            .map_err(|error| error_in(name, "points", error))?,
    }
    Ok(Cloud { pose: header.viewpoint.and_then(pose_of_viewpoint), ..rows.cloud() })
}

/// The pose of a VIEWPOINT, from the sensor's frame to that of the points; `None` if it is the identity.
/// A quaternion of zeros is no rotation, as in PCL, whose matrix of it is the identity.
fn pose_of_viewpoint([tx, ty, tz, w, x, y, z]: [f64; 7]) -> Option<[f64; 16]> {
    let square = w * w + x * x + y * y + z * z;
    let s = if square > 0.0 { 2.0 / square } else { 0.0 };
    let pose = [
        [1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y), tx],
        [s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x), ty],
        [s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y), tz],
        [0.0, 0.0, 0.0, 1.0],
    ];
    let pose: [f64; 16] = std::array::from_fn(|i| pose[i / 4][i % 4]);
    let is_identity = (0..16).all(|i| pose[i] == f64::from(u8::from(i % 5 == 0)));
    (!is_identity && pose.iter().all(|x| x.is_finite())).then_some(pose)
}

fn read_ascii<R: BufRead>(
    lines: &mut Lines<'_, R>,
    n: u64,
    columns: &[Coordinate],
    rows: &mut Rows,
) -> Result<(), FormatError> {
    let mut row = vec![0.0; columns.len()];
    for i in 0..n {
        let line = lines.next_of(i, n)?;
        for (value, coordinate) in row.iter_mut().zip(columns) {
            let word = line.text.split_ascii_whitespace().nth(coordinate.column as usize);
            let word = word.ok_or_else(|| {
                line.error(format!(
                    "expected a number in column {}",
                    coordinate.column.saturating_add(1)
                ))
            })?;
            *value = line.number(word)?;
        }
        rows.push(&row);
    }
    lines.check_end(n)
}

/// Reads compressed points, whose numbers are stored field by field.
fn read_compressed(reader: &mut impl Read, header: &mut Header, rows: &mut Rows) -> io::Result<()> {
    let mut sizes = [0; 8];
    reader.read_exact(&mut sizes)?;
    let [compressed, uncompressed] =
        [0, 4].map(|at| NumberType::U32.decode(&sizes[at..], ByteOrder::Little) as u64);
    let is_promised =
        |header: &Header| header.n.checked_mul(header.point_size()) == Some(uncompressed);
    if !is_promised(header) {
        // The Point Cloud Library compresses no padding.
        header.drop_padding();
    }
    if !is_promised(header) {
        let (n, size) = (header.n, header.point_size());
        return Err(invalid(format!(
            "expected {n} points of {size} bytes, found {uncompressed} bytes in all"
        )));
    }
    let mut bytes = Vec::new();
    if reader.take(compressed).read_to_end(&mut bytes)? as u64 != compressed {
        return Err(records::truncated(bytes.len() as u64, compressed));
    }
    let bytes = lzf::decompress(&bytes, uncompressed)?;
    let (columns, _) = header.columns().map_err(invalid)?;
    let mut row = vec![0.0; columns.len()];
    for i in 0..header.n {
        for (value, column) in row.iter_mut().zip(&columns) {
            let at = column.offset * header.n + i * column.number.size() as u64;
            *value = column.decode(&bytes[at as usize..]);
        }
        rows.push(&row);
    }
    Ok(())
}

/// Writes `points` as binary PCD 0.7.
pub(super) fn write(
    writer: &mut impl Write,
    points: &[[f64; 3]],
    precision: Precision,
) -> io::Result<()> {
    let (n, size) = (points.len(), precision.size());
    write!(
        writer,
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z\n\
         SIZE {size} {size} {size}\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {n}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n"
    )?;
    precision.write(writer, points)
}
