//! Scans as CSV, for spreadsheets and eyes.

use std::fmt::Write as _;
use std::io::{self, BufWriter};
use std::path::Path;

use csv::Writer;

use crate::atomic::{self, HashingFile};
use crate::error::FormatError;
use crate::scan::{Column, Scan};

/// Writes `scan` to `path`, atomically: the header `x,y,z` and the attributes'
/// names (`nx,ny,nz` for normals), then one point a line. Returns the SHA-256 of
/// the file.
///
/// Numbers are the shortest that read back as the same f32. Text has room for
/// any coordinate, so that the origin is added to the positions.
///
/// # Errors
/// An attribute of another length than the positions; what the system reports.
pub fn write_scan(path: &Path, scan: &Scan) -> Result<String, FormatError> {
    scan.check_lengths()?;
    atomic::write_hashed(path, |writer| {
        let mut csv = Writer::from_writer(writer);
        csv.write_record(header(scan)).map_err(into_io)?;
        let mut text = String::new();
        for i in 0..scan.len() {
            write_point(&mut csv, &mut text, scan, i).map_err(into_io)?;
        }
        csv.flush()
    })
}

fn header(scan: &Scan) -> Vec<&'static str> {
    let mut names = vec!["x", "y", "z"];
    names.extend(scan.columns().flat_map(|(attribute, _)| attribute.column_names()));
    names
}

fn write_point(
    csv: &mut Writer<&mut BufWriter<HashingFile>>,
    text: &mut String,
    scan: &Scan,
    i: usize,
) -> csv::Result<()> {
    let mut field = |value: &dyn std::fmt::Display| {
        text.clear();
        // Writing to a String never fails.
        let _ = write!(text, "{value}");
        csv.write_field(text.as_bytes())
    };
    for axis in 0..3 {
        match scan.origin[axis] {
            0.0 => field(&scan.positions[i][axis])?,
            origin => field(&(origin + f64::from(scan.positions[i][axis])))?,
        }
    }
    for (_, column) in scan.columns() {
        match column {
            Column::F32(values) => field(&values[i])?,
            Column::U16(values) => field(&values[i])?,
            Column::U32(values) => field(&values[i])?,
            Column::Vector(values) => {
                values[i].iter().try_for_each(|component| field(component))?;
            }
        }
    }
    csv.write_record(None::<&[u8]>)
}

fn into_io(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}
