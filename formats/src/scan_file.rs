//! Scans on disk: as binary PLY or PCD, as CSV, or as NPZ files that NumPy and Open3D load
//! without conversion:
//!
//! | key | type | shape |
//! | --- | --- | --- |
//! | `positions` | f32 | `[n, 3]` |
//! | `range`, `time`, `intensity`, `power` | f32 | `[n, 1]` |
//! | `beam`, `triangle`, `object` | u32 | `[n, 1]` |
//! | `ring` | u16 | `[n, 1]` |
//! | `reflectivity`, `return`, `medium` | u8 | `[n, 1]` |
//! | `sensor`, `attitude`, `normal` | f32 | `[n, 3]` |
//! | `origin`, only if it is not 0 | f64 | `[3]` |
//! | `pose` of the sensor, only if it is not the identity | f64 | `[4, 4]` |
//!
//! Attributes are columns, not vectors: Open3D 0.20 loads either, but voxel
//! down-sampling and PLY writing fail on a vector. It keeps `origin` and `pose`
//! as attributes too; delete them there before joining or thinning clouds.

use std::io::{self, Seek, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::archive::{NpzReader, NpzWriter, Values, write_archive};
use crate::cloud_file::read_npz_pose;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::number::Number;
use crate::scan::{Attribute, Column, ColumnSlot, Scan};
use crate::{csv, ply, rows};

crate::named! {
    /// A file format of scans; its name is the extension.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ScanFormat: "scan format" {
        /// NumPy archive: see the module.
        Npz = "npz",
        /// Binary PLY.
        Ply = "ply",
        /// Text with a header, which is written but not read.
        Csv = "csv",
        /// The Point Cloud Library's format, binary, with the columns of PLY, the pose as its
        /// VIEWPOINT, and no origin; it is read as a cloud.
        Pcd = "pcd",
        /// A sensor's packets: see `vlp32c`. They hold ranges along beams instead of points, so
        /// that writing them requires the sensor.
        Pcap = "pcap",
    }
}

impl ScanFormat {
    /// The formats of points with an origin.
    pub const POINTS: [Self; 3] = [Self::Npz, Self::Ply, Self::Csv];

    /// The format of the extension of `path`, in upper or lower case.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] for an unknown extension.
    pub fn of_path(path: &Path) -> Result<Self, FormatError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        extension.parse().map_err(|error| FormatError::malformed(path, "extension", error))
    }
}

/// Writes `scan` to `path`, atomically, and returns the file's hash. Equal scans give equal bytes.
///
/// # Errors
/// An attribute of another length than the positions; [`ScanFormat::Pcap`], whose
/// packets hold no points; errors of the system.
pub fn write_scan(
    path: &Path,
    format: ScanFormat,
    hashing: Hashing,
    scan: &Scan,
) -> Result<Option<FileHash>, FormatError> {
    match format {
        ScanFormat::Npz => {
            scan.check_lengths()?;
            write_archive(path, hashing, |npz| write_npz(npz, scan))
        }
        ScanFormat::Pcd if scan.origin != [0.0; 3] => {
            let cause =
                "PCD has no place for the origin of the points: expected .npz, .ply or .csv";
            Err(FormatError::malformed(path, "origin", cause))
        }
        ScanFormat::Ply | ScanFormat::Pcd => {
            let names = |attribute| match (format, attribute) {
                // As PCL and Open3D call them.
                (ScanFormat::Pcd, Attribute::Normal) => vec!["normal_x", "normal_y", "normal_z"],
                _ => attribute.column_names(),
            };
            let attributes = scan.columns().map(|(attribute, of)| (names(attribute), of));
            let positions = (rows::AXES.to_vec(), Column::Vector(&scan.positions));
            let columns: Vec<_> = std::iter::once(positions).chain(attributes).collect();
            let header = match format {
                ScanFormat::Pcd => rows::pcd_header(scan.pose, &columns),
                _ => rows::ply_header(scan.origin, scan.pose, &columns),
            };
            rows::write(path, hashing, &header, &columns)
        }
        ScanFormat::Csv => csv::write_scan(path, hashing, scan),
        ScanFormat::Pcap => {
            let cause = "packets hold a sensor's ranges, not points: `edgepuck scan` writes them";
            Err(FormatError::malformed(path, "extension", cause))
        }
    }
}

/// Reads the scan at `path`, an NPZ or PLY file by its extension.
///
/// # Errors
/// A file that cannot be read or is not what its extension says:
/// [`FormatError::Malformed`] with the file and the key, element or line at fault.
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    let refuse = |cause: &str| Err(FormatError::malformed(path, "extension", cause));
    match ScanFormat::of_path(path)? {
        ScanFormat::Npz => read_npz(path),
        ScanFormat::Ply => ply::read_scan(path),
        ScanFormat::Csv => refuse("CSV is written but not read"),
        ScanFormat::Pcd => refuse("PCD is read as a cloud, without attributes"),
        ScanFormat::Pcap => refuse("packets hold a sensor's ranges, not points"),
    }
}

pub(crate) fn write_npz<W: Write + Seek>(npz: &mut NpzWriter<W>, scan: &Scan) -> io::Result<()> {
    write_columns(npz, "positions", scan.positions.as_flattened(), 3)?;
    for (attribute, column) in scan.columns() {
        let key = attribute.name();
        match column {
            Column::F32(values) => write_columns(npz, key, values, 1)?,
            Column::U8(values) => write_columns(npz, key, values, 1)?,
            Column::U16(values) => write_columns(npz, key, values, 1)?,
            Column::U32(values) => write_columns(npz, key, values, 1)?,
            Column::Vector(values) => write_columns(npz, key, values.as_flattened(), 3)?,
        }
    }
    if scan.origin != [0.0; 3] {
        npz.array("origin", &[3], scan.origin.into_iter())?;
    }
    if let Some(pose) = scan.pose {
        npz.array("pose", &[4, 4], pose.into_iter())?;
    }
    Ok(())
}

fn write_columns<W: Write + Seek, A: Number>(
    npz: &mut NpzWriter<W>,
    key: &str,
    values: &[A],
    width: usize,
) -> io::Result<()> {
    npz.array(key, &[values.len() / width, width], values.iter().copied())
}

/// Attributes may be columns or vectors, compressed or not. Other keys are ignored.
fn read_npz(path: &Path) -> Result<Scan, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let positions = read_columns::<f32>(&mut npz, "positions", 3, None)?;
    let n = positions.len() / 3;
    let mut scan = Scan { positions: as_vectors(&positions), ..Scan::default() };
    if npz.has("origin") {
        let origin = npz.array::<f64>("origin")?.elements;
        scan.origin =
            origin.try_into().map_err(|_| npz.error("origin", "expected three numbers"))?;
    }
    scan.pose = read_npz_pose(&mut npz)?;
    for attribute in Attribute::ALL {
        let key = attribute.name();
        if !npz.has(key) {
            continue;
        }
        match scan.slot(attribute) {
            ColumnSlot::F32(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::U8(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::U16(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::U32(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::Vector(slot) => {
                *slot = Some(as_vectors(&read_columns(&mut npz, key, 3, Some(n))?));
            }
        }
    }
    Ok(scan)
}

/// The elements of an array of shape `[n, width]`, or `[n]` if `width` is 1.
fn read_columns<A: Number>(
    npz: &mut NpzReader,
    key: &str,
    width: usize,
    expected: Option<usize>,
) -> Result<Vec<A>, FormatError> {
    let Values { shape, elements } = npz.array(key)?;
    let n = match shape[..] {
        [n] if width == 1 => n,
        [n, columns] if columns == width => n,
        _ => {
            let cause = format!("expected shape [n, {width}], found {shape:?}");
            return Err(npz.error(key, cause));
        }
    };
    match expected {
        Some(expected) if n != expected => {
            Err(npz
                .error(key, format!("expected {expected} values, one for each point, found {n}")))
        }
        _ => Ok(elements),
    }
}

fn as_vectors(elements: &[f32]) -> Vec<[f32; 3]> {
    elements.as_chunks::<3>().0.to_vec()
}
