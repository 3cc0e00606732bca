//! PLY files as clouds: the x, y and z of the element `vertex`.

use std::io::{self, BufRead, Write};
use std::path::Path;

use super::precision::Precision;
use crate::error::FormatError;
use crate::ply::read_elements;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads the position of every vertex, with the file's `origin` added.
pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Vec<[f64; 3]>, FormatError> {
    let mut points = Vec::new();
    let frame = read_elements(
        reader,
        name,
        &["vertex"],
        |_, vertex| AXES.iter().map(|axis| vertex.scalar(axis)).collect(),
        |_, row| points.push([row[0], row[1], row[2]]),
    )?;
    if let Some([x, y, z]) = frame.origin {
        points.iter_mut().for_each(|p| *p = [p[0] + x, p[1] + y, p[2] + z]);
    }
    Ok(points)
}

/// The pose of a scan's sensor, row by row.
pub(super) fn read_pose(
    reader: &mut impl BufRead,
    name: &Path,
) -> Result<Option<[f64; 16]>, FormatError> {
    let frame = read_elements(reader, name, &["vertex"], |_, _| Ok(Vec::new()), |_, _| {})?;
    Ok(frame.pose)
}

/// Writes `points` as binary PLY, little-endian.
pub(super) fn write(
    writer: &mut impl Write,
    points: &[[f64; 3]],
    precision: Precision,
) -> io::Result<()> {
    let number = match precision {
        Precision::Single => "float",
        Precision::Double => "double",
    };
    write!(writer, "ply\nformat binary_little_endian 1.0\nelement vertex {}\n", points.len())?;
    AXES.iter().try_for_each(|axis| writeln!(writer, "property {number} {axis}"))?;
    writeln!(writer, "end_header")?;
    precision.write(writer, points)
}
