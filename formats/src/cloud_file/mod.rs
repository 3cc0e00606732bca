//! Reads and writes clouds of points in the formats of sensors, tools and datasets:
//! coordinates only, in f64, whatever the type in the file.
//!
//! | format | read | written |
//! | --- | --- | --- |
//! | PLY | ASCII, binary of either byte order | binary, little-endian |
//! | NPZ | `positions` (plus `origin`), else `points`, else the only array of points | `positions` |
//! | NPY | `[n, 3]` or wider, any numbers, C or Fortran order; records with `x`, `y`, `z` | `[n, 3]` |
//! | PCD | ASCII, binary, LZF-compressed | binary |
//! | XYZ, TXT, ASC, TSV, PTS, CSV | separated by blanks, tabs, commas or semicolons | blanks, in CSV commas |
//! | KITTI `.bin` | f32, four for each point or as many as the name states | |
//! | nuScenes `.pcd.bin` | f32, five for each point | |
//! | LAS | 1.0 to 1.4 | |
//!
//! NaN and infinities are kept; the caller decides how to treat them. Memory grows
//! with the decompressed bytes of the file, never with a count in a header.

mod columns;
mod format;
mod kitti;
#[cfg(feature = "las")]
mod las;
#[cfg(feature = "pcd")]
mod lzf;
mod npy;
#[cfg(feature = "npz")]
mod npz;
#[cfg(feature = "pcd")]
mod pcd;
#[cfg(feature = "pcd")]
mod pcd_header;
#[cfg(feature = "ply")]
mod ply;
mod precision;
mod text;

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use crate::atomic;
use crate::error::FormatError;
use crate::plausible::{check_sweep, or_foreign_file};
use crate::records;
use crate::scan::Scan;
pub use format::CloudFormat;
#[cfg(feature = "dataset")]
pub(crate) use npz::{read_points as read_npz_points, read_pose as read_npz_pose};
use precision::Precision;

/// Points, and what a file says of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The points, metres.
    pub points: Vec<[f64; 3]>,
    /// One number for each point, if the file has them: the column `intensity`, `i`,
    /// `scalar_intensity` or `reflectivity` in upper or lower case, or the fourth of KITTI and
    /// nuScenes. They are as in the file, except for those of LAS, of which 65535 is 1 unless all are
    /// below 256, and reflectivities of whole numbers up to 255, of which 100 is 1.
    pub intensities: Option<Vec<f32>>,
    /// The ring of each point, if the file has them: the column `ring` or
    /// `scalar_ring`, or nuScenes' fifth. A column with other values than
    /// whole numbers from 0 to 65535 is ignored.
    pub rings: Option<Vec<u16>>,
    /// The pose of the sensor, a matrix of 4 by 4 row by row: `pose` of an NPZ or PLY file, or the
    /// VIEWPOINT of a PCD file, unless it is the identity.
    pub pose: Option<[f64; 16]>,
}

impl Cloud {
    /// Where the sensor stood, in the frame of the points: the position of the pose, or the origin.
    #[must_use]
    pub fn sensor_position_m(&self) -> [f64; 3] {
        Scan { pose: self.pose, ..Scan::default() }.sensor_position_m()
    }
}

/// Reads the cloud at `path` in the format of its extension.
///
/// # Errors
/// An unknown extension, a format that this build does not include, a mesh, a
/// file that cannot be read or is not of its extension's format; raw floats that only the extension
/// makes KITTI's, and that cannot be points of a sweep or have nuScenes' rings. The error names the
/// file and the line, element or key at fault.
pub fn read_cloud(path: &Path) -> Result<Vec<[f64; 3]>, FormatError> {
    read_cloud_as(path, None).map(|cloud| cloud.points)
}

/// Whether the NPZ or PLY file at `path` holds a sensor's measurements beside the positions: ranges,
/// or the numbers of beams or rings. A pipe is never one, since it can be read only
/// once.
#[must_use]
pub fn is_scan(path: &Path) -> bool {
    has_any(path, &["range", "beam", "ring"])
}

/// Whether the NPZ or PLY file at `path` must be one that [`crate::scan_file::read_scan`] reads: a scan, or
/// an archive whose points have the name that they have in scans.
#[cfg(feature = "dataset")]
#[must_use]
pub fn must_be_scan(path: &Path) -> bool {
    has_any(path, &["positions", "range", "beam", "ring"])
}

/// Whether the NPZ or PLY file at `path` has one of these arrays or properties.
#[allow(unused_variables, reason = "a build may leave both formats out")]
fn has_any(path: &Path, keys: &[&str]) -> bool {
    if !path.is_file() {
        return false;
    }
    match CloudFormat::of_path(path) {
        #[cfg(feature = "npz")]
        Ok(CloudFormat::Npz) => crate::archive::NpzReader::open(path)
            .is_ok_and(|npz| keys.iter().any(|key| npz.has(key))),
        #[cfg(feature = "ply")]
        Ok(CloudFormat::Ply) => File::open(path).is_ok_and(|file| {
            let mut found = false;
            // The error ends the reading after the header.
            let choose = |_: usize, vertex: &crate::ply::Element| {
                found = keys.iter().any(|key| vertex.has(key));
                Err(String::new())
            };
            let _ = crate::ply::read_elements(
                &mut BufReader::new(file),
                path,
                &["vertex"],
                choose,
                |_, _| {},
            );
            found
        }),
        _ => false,
    }
}

/// As [`read_cloud`], in `format` if it is given, with what the file says of the points.
///
/// # Errors
/// As [`read_cloud`]; intensities or rings of another number than the points.
pub fn read_cloud_as(path: &Path, format: Option<CloudFormat>) -> Result<Cloud, FormatError> {
    read_file(path, format).map_err(|error| {
        let expected = format.or(CloudFormat::of_path(path).ok());
        match CloudFormat::of_signature(path) {
            Some(found) if expected.is_some_and(|expected| expected != found) => {
                let cause = format!(
                    "expected {}, found {found} by the first bytes: call the file .{found}, or name \
                     the format by --input-format {found}",
                    expected.map_or("a cloud", CloudFormat::name)
                );
                FormatError::malformed(path, "format", cause)
            }
            _ => or_foreign_file(path, expected.map_or("a cloud", CloudFormat::name), error),
        }
    })
}

fn read_file(path: &Path, format: Option<CloudFormat>) -> Result<Cloud, FormatError> {
    let (mut file, found) = open(path, format)?;
    match found {
        #[cfg(feature = "npz")]
        CloudFormat::Npz => npz::read(BufReader::new(file), path),
        CloudFormat::Kitti if format.is_none() => {
            kitti::check_columns(&mut file, path, found, false)?;
            let cloud = kitti::read(&mut BufReader::new(file), found, path)?;
            let remedy = format!("are they in millimetres? Scale them, or {}", kitti::REMEDY);
            check_sweep(cloud.points.iter().copied(), path, &remedy)?;
            Ok(cloud)
        }
        CloudFormat::Kitti | CloudFormat::Nuscenes if path.is_file() => {
            kitti::check_columns(&mut file, path, found, true)?;
            read_as(&mut BufReader::new(file), found, path)
        }
        _ => read_as(&mut BufReader::new(file), found, path),
    }
}

fn open(path: &Path, format: Option<CloudFormat>) -> Result<(File, CloudFormat), FormatError> {
    if path.is_dir() {
        let cause = "expected a file, found a folder: name the files in it";
        return Err(FormatError::malformed(path, "name", cause));
    }
    // A file that is missing is told before its name is judged.
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    Ok((file, format.map_or_else(|| CloudFormat::of_path(path), Ok)?))
}

/// Reads a cloud from `reader`, which errors call `name`.
///
/// Without a `format`, the first bytes decide. Raw floats (KITTI) cannot be recognised and must be
/// named. An NPZ archive is held in memory, because its directory is at the end.
///
/// # Errors
/// As [`read_cloud`]; bytes of an unknown format.
pub fn read_cloud_from(
    mut reader: impl Read,
    format: Option<CloudFormat>,
    name: &Path,
) -> Result<Cloud, FormatError> {
    let mut start = [0; format::SNIFFED_SIZE];
    let n = records::fill(&mut reader, &mut start);
    let start = &start[..n.map_err(|source| FormatError::io(name, source))?];
    let format = match format {
        Some(format) => format,
        None => CloudFormat::of_content(start, name)?,
    };
    read_as(&mut BufReader::new(start.chain(reader)), format, name)
}

fn read_as(
    reader: &mut impl BufRead,
    format: CloudFormat,
    name: &Path,
) -> Result<Cloud, FormatError> {
    match format {
        CloudFormat::Text | CloudFormat::Csv => text::read(reader, name),
        CloudFormat::Npy => npy::read(reader, name),
        CloudFormat::Kitti | CloudFormat::Nuscenes => kitti::read(reader, format, name),
        #[cfg(feature = "ply")]
        CloudFormat::Ply => ply::read(reader, name),
        #[cfg(feature = "pcd")]
        CloudFormat::Pcd => pcd::read(reader, name),
        #[cfg(feature = "las")]
        CloudFormat::Las => las::read(reader, name),
        #[cfg(feature = "npz")]
        CloudFormat::Npz => {
            let mut archive = Vec::new();
            let read = reader.read_to_end(&mut archive);
            read.map_err(|source| FormatError::io(name, source))?;
            npz::read(std::io::Cursor::new(archive), name)
        }
        #[allow(unreachable_patterns, reason = "a build may leave no format out")]
        left_out => Err(not_in_this_build(left_out, name)),
    }
}

/// Writes `points` to `path`, atomically, in the format of its extension.
///
/// Coordinates are written as f32 if that is exact, as for clouds that were read as f32, and
/// otherwise as f64. The same points give the same bytes. PCD gets f64 only if f32 would lose more than
/// a millionth of the cloud's extent, because the usual clouds of PCL and Open3D read no other type.
///
/// # Errors
/// As [`CloudFormat::of_output`]; errors of the system.
pub fn write_cloud(path: &Path, points: &[[f64; 3]]) -> Result<(), FormatError> {
    let precision = Precision::lossless(points);
    match CloudFormat::of_output(path)? {
        CloudFormat::Text => atomic::write(path, |writer| text::write(writer, points)),
        CloudFormat::Csv => atomic::write(path, |writer| text::write_csv(writer, points)),
        CloudFormat::Npy => atomic::write(path, |writer| npy::write(writer, points, precision)),
        #[cfg(feature = "ply")]
        CloudFormat::Ply => atomic::write(path, |writer| ply::write(writer, points, precision)),
        #[cfg(feature = "pcd")]
        CloudFormat::Pcd => {
            let precision = Precision::tolerable(points);
            atomic::write(path, |writer| pcd::write(writer, points, precision))
        }
        #[cfg(feature = "npz")]
        CloudFormat::Npz => atomic::write(path, |writer| npz::write(writer, points, precision)),
        left_out => Err(not_in_this_build(left_out, path)),
    }
}

#[allow(dead_code, reason = "a build may leave no format out")]
fn not_in_this_build(format: CloudFormat, name: &Path) -> FormatError {
    FormatError::malformed(name, "format", format!("this build does not include {format}"))
}
