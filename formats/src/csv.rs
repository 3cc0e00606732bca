//! Writes scans as CSV.

use std::io::{self, Write};
use std::path::Path;

use crate::atomic;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::scan::{Column, Scan};

/// Writes `scan` to `path`, atomically: the header `x,y,z` and the names of the attributes
/// (`nx,ny,nz` for normals), then one point in each line.
///
/// Numbers have the fewest digits that read back as the same f32. The origin is added to the
/// positions, since text can represent any coordinate.
pub fn write_scan(
    path: &Path,
    hashing: Hashing,
    scan: &Scan,
) -> Result<Option<FileHash>, FormatError> {
    scan.check_lengths()?;
    atomic::write_hashed(path, hashing, |writer| {
        write!(writer, "x,y,z")?;
        let mut names = scan.columns().flat_map(|(attribute, _)| attribute.column_names());
        names.try_for_each(|name| write!(writer, ",{name}"))?;
        writeln!(writer)?;
        (0..scan.len()).try_for_each(|i| write_point(writer, scan, i))
    })
}

fn write_point(writer: &mut impl Write, scan: &Scan, i: usize) -> io::Result<()> {
    for (axis, separator) in ["", ",", ","].into_iter().enumerate() {
        let position = scan.positions[i][axis];
        match scan.origin[axis] {
            0.0 => write!(writer, "{separator}{position}")?,
            origin => write!(writer, "{separator}{}", origin + f64::from(position))?,
        }
    }
    for (_, column) in scan.columns() {
        match column {
            Column::F32(values) => write!(writer, ",{}", values[i])?,
            Column::U8(values) => write!(writer, ",{}", values[i])?,
            Column::U16(values) => write!(writer, ",{}", values[i])?,
            Column::U32(values) => write!(writer, ",{}", values[i])?,
            Column::Vector(values) => {
                values[i].iter().try_for_each(|component| write!(writer, ",{component}"))?;
            }
        }
    }
    writeln!(writer)
}
