//! PLY files as clouds: the x, y and z of the element `vertex`.

use std::io::{self, BufRead, Write};
use std::path::Path;

use super::Cloud;
use super::format::MESH;
use super::intensity::{self, Rows};
use super::precision::Precision;
use crate::error::FormatError;
use crate::ply::{Element, read_elements};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads the position of every vertex, with the file's `origin` added, and its intensity.
pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Cloud, FormatError> {
    let (mut rows, mut unit) = (Rows::default(), None);
    let choose = |kind: usize, element: &Element| match kind {
        0 => {
            let intensity = intensity::find(|name| element.scalar(name).ok());
            unit = intensity.map(|(_, unit)| unit);
            let axes = AXES.iter().map(|axis| element.scalar(axis));
            axes.chain(intensity.map(|(at, _)| Ok(at))).collect()
        }
        _ if element.is_empty() => Ok(Vec::new()),
        _ => Err(MESH.to_owned()),
    };
    let kinds = ["vertex", "face", "tristrips"];
    let frame = read_elements(reader, name, &kinds, choose, |_, row| rows.push(row))?;
    let mut cloud = rows.cloud(unit);
    if let Some([x, y, z]) = frame.origin {
        cloud.points.iter_mut().for_each(|p| *p = [p[0] + x, p[1] + y, p[2] + z]);
    }
    Ok(cloud)
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
