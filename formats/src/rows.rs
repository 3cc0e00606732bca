//! Points as binary rows of numbers, little-endian, behind a header of PLY, of PCD, or none.

use std::io::Write;
use std::path::Path;

use crate::atomic;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::scan::Column;

/// Columns with their names, of which a vector has three.
pub type Columns<'a> = [(Vec<&'static str>, Column<'a>)];

/// The names of positions.
pub const AXES: [&str; 3] = ["x", "y", "z"];

/// Writes `columns` to `path` behind `header`, atomically, and returns the file's hash.
///
/// # Errors
/// Columns of different lengths; errors of the system.
pub fn write(
    path: &Path,
    hashing: Hashing,
    header: &str,
    columns: &Columns<'_>,
) -> Result<Option<FileHash>, FormatError> {
    let n = n_points(columns);
    if let Some((names, column)) = columns.iter().find(|(_, column)| column.len() != n) {
        let (attribute, found) = (names[0], column.len());
        return Err(FormatError::Length { attribute, expected: n, found });
    }
    atomic::write_hashed(path, hashing, |writer| {
        writer.write_all(header.as_bytes())?;
        for i in 0..n {
            for (_, column) in columns {
                match column {
                    Column::F32(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::U8(values) => writer.write_all(&[values[i]])?,
                    Column::U16(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::U32(values) => writer.write_all(&values[i].to_le_bytes())?,
                    Column::Vector(values) => {
                        values[i].iter().try_for_each(|x| writer.write_all(&x.to_le_bytes()))?;
                    }
                }
            }
        }
        Ok(())
    })
}

/// The header of PLY, with an origin other than 0 and a sensor's pose as comments.
#[must_use]
pub fn ply_header(origin: [f64; 3], pose: Option<[f64; 16]>, columns: &Columns<'_>) -> String {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    if origin != [0.0; 3] {
        let [x, y, z] = origin;
        header += &format!("comment origin {x} {y} {z}\n");
    }
    if let Some(pose) = pose {
        header += &format!("comment pose {}\n", pose.map(|x| x.to_string()).join(" "));
    }
    header += &format!("element vertex {}\n", n_points(columns));
    for (names, column) in columns {
        let [number, ..] = types(column);
        names.iter().for_each(|name| header += &format!("property {number} {name}\n"));
    }
    header + "end_header\n"
}

/// The header of PCD 0.7.
#[must_use]
pub fn pcd_header(columns: &Columns<'_>) -> String {
    let lines = ["FIELDS", "SIZE", "TYPE", "COUNT"].map(|key| {
        let words = columns.iter().flat_map(|(names, column)| {
            let [_, kind, size] = types(column);
            names.iter().map(move |name| match key {
                "FIELDS" => *name,
                "SIZE" => size,
                "TYPE" => kind,
                _ => "1",
            })
        });
        format!("{key} {}\n", words.collect::<Vec<_>>().join(" "))
    });
    let n = n_points(columns);
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n{}WIDTH {n}\nHEIGHT 1\n\
         VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA binary\n",
        lines.concat()
    )
}

/// The type of a column's numbers in PLY, and the type and the size in PCD.
fn types(column: &Column<'_>) -> [&'static str; 3] {
    match column {
        Column::F32(_) | Column::Vector(_) => ["float", "F", "4"],
        Column::U8(_) => ["uchar", "U", "1"],
        Column::U16(_) => ["ushort", "U", "2"],
        Column::U32(_) => ["uint", "U", "4"],
    }
}

fn n_points(columns: &Columns<'_>) -> usize {
    columns.first().map_or(0, |(_, column)| column.len())
}
