//! Points as binary rows of numbers, little-endian, behind a header of PLY, of PCD, or none.

use std::io::Write;
use std::path::Path;

use crate::atomic;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::npy;
use crate::scan::{Column, OBJECT_TEXTS};

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
    header: impl AsRef<[u8]>,
    columns: &Columns<'_>,
) -> Result<Option<FileHash>, FormatError> {
    let n = n_points(columns);
    if let Some((names, column)) = columns.iter().find(|(_, column)| column.len() != n) {
        let (attribute, found) = (names[0], column.len());
        return Err(FormatError::Length { attribute, expected: n, found });
    }
    atomic::write_hashed(path, hashing, |writer| {
        writer.write_all(header.as_ref())?;
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

/// The header of NPY for rows of `width` numbers of f32.
#[must_use]
pub fn npy_header(n_rows: usize, width: usize) -> Vec<u8> {
    npy::header_bytes("<f4", &[n_rows, width])
}

/// The header of PLY, with an origin other than 0, a sensor's pose and the objects' names as comments.
#[must_use]
pub fn ply_header(
    origin: [f64; 3],
    pose: Option<[f64; 16]>,
    object_texts: &[Vec<String>; 2],
    columns: &Columns<'_>,
) -> String {
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    if origin != [0.0; 3] {
        let [x, y, z] = origin;
        header += &format!("comment origin {x} {y} {z}\n");
    }
    if let Some(pose) = pose {
        header += &format!("comment pose {}\n", pose.map(|x| x.to_string()).join(" "));
    }
    for (key, texts) in OBJECT_TEXTS.iter().zip(object_texts) {
        let comment = |(i, text)| header += &format!("comment {key} {i} {text}\n");
        texts.iter().enumerate().for_each(comment);
    }
    header += &format!("element vertex {}\n", n_points(columns));
    for (names, column) in columns {
        let [number, ..] = types(column);
        names.iter().for_each(|name| header += &format!("property {number} {name}\n"));
    }
    header + "end_header\n"
}

/// The header of PCD 0.7. The `pose` of the sensor is its VIEWPOINT, a translation and a quaternion
/// w, x, y, z; PCL leaves the points where they are.
#[must_use]
pub fn pcd_header(pose: Option<[f64; 16]>, columns: &Columns<'_>) -> String {
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
    let viewpoint = pose.map_or([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], viewpoint_of);
    let viewpoint = viewpoint.map(|x| x.to_string()).join(" ");
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n{}WIDTH {n}\nHEIGHT 1\n\
         VIEWPOINT {viewpoint}\nPOINTS {n}\nDATA binary\n",
        lines.concat()
    )
}

/// The position of a pose and its rotation as a quaternion w, x, y, z.
fn viewpoint_of(pose: [f64; 16]) -> [f64; 7] {
    let m = |row: usize, column: usize| pose[4 * row + column];
    let trace = m(0, 0) + m(1, 1) + m(2, 2);
    let largest = (0..3).fold(0, |best, i| if m(i, i) > m(best, best) { i } else { best });
    // Shepperd's method: divides by the largest of the four.
    let mut q = [0.0; 4];
    if trace > m(largest, largest) {
        let s = 2.0 * (1.0 + trace).sqrt();
        q = [s / 4.0, (m(2, 1) - m(1, 2)) / s, (m(0, 2) - m(2, 0)) / s, (m(1, 0) - m(0, 1)) / s];
    } else {
        let [i, j, k] = [0, 1, 2].map(|step| (largest + step) % 3);
        let s = 2.0 * (1.0 + m(i, i) - m(j, j) - m(k, k)).sqrt();
        q[0] = (m(k, j) - m(j, k)) / s;
        q[1 + i] = s / 4.0;
        q[1 + j] = (m(j, i) + m(i, j)) / s;
        q[1 + k] = (m(k, i) + m(i, k)) / s;
    }
    [m(0, 3), m(1, 3), m(2, 3), q[0], q[1], q[2], q[3]]
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
