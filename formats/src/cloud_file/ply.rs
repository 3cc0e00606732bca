//! PLY files as clouds: the x, y and z of the element `vertex`.

use std::cell::RefCell;
use std::io::{self, BufRead, Write};
use std::path::Path;

use super::Cloud;
use super::columns::{self, Rows};
use super::format::MESH;
use super::precision::Precision;
use crate::error::FormatError;
use crate::ply::{Element, read_elements};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Reads the position of every vertex, with the file's `origin` added, and what else there is of it.
pub(super) fn read(reader: &mut impl BufRead, name: &Path) -> Result<Cloud, FormatError> {
    let rows = RefCell::new(Rows::default());
    let choose = |kind: usize, element: &Element| match kind {
        0 => {
            let (columns, extras): (Vec<_>, Vec<_>) =
                columns::find(|name| element.scalar(name).ok()).into_iter().unzip();
            *rows.borrow_mut() = Rows::new(extras);
            let axes = AXES.iter().map(|axis| element.scalar(axis));
            axes.chain(columns.into_iter().map(Ok)).collect()
        }
        _ if element.is_empty() => Ok(Vec::new()),
        _ => Err(MESH.to_owned()),
    };
    let kinds = ["vertex", "face", "tristrips"];
    let frame = read_elements(reader, name, &kinds, choose, |_, row| {
        rows.borrow_mut().push(row);
    })?;
    let mut cloud = Cloud { pose: frame.pose, ..rows.into_inner().cloud() };
    if let Some([x, y, z]) = frame.origin {
        cloud.points.iter_mut().for_each(|p| *p = [p[0] + x, p[1] + y, p[2] + z]);
    }
    Ok(cloud)
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
