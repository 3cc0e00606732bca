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
//! | `object_names`, `object_labels`, only if known: UTF-8, a line for each object | u8 | `[k]` |
//!
//! Attributes are columns, not vectors: Open3D 0.20 loads either, but voxel
//! down-sampling and PLY writing fail on a vector. It keeps `origin`, `pose` and the objects'
//! names as attributes too, and it reads no letters; delete them there before joining or thinning clouds.

use std::io::{self, Seek, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::archive::{NpzReader, NpzWriter, write_archive};
use crate::cloud_file::{read_npz_points, read_npz_pose};
use crate::decoding::invalid;
use crate::error::FormatError;
use crate::hash::{FileHash, Hashing};
use crate::number::Number;
use crate::number::NumberType::{F16, F32, F64};
use crate::scan::{Attribute, Column, OBJECT_TEXTS, Scan};
use crate::{csv, npy, ply, rows};

crate::named! {
    /// A file format of scans; its name is the extension.
    #[derive(Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ScanFormat: "scan format" {
        /// NumPy archive: see the module.
        Npz = "npz",
        /// Binary PLY.
        Ply = "ply",
        /// Text with a header; it is read as a cloud with intensities and rings.
        Csv = "csv",
        /// The Point Cloud Library's format, binary, with the columns of PLY, the pose as its
        /// VIEWPOINT, and no origin; it is read as a cloud with intensities and rings.
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
                _ => rows::ply_header(scan.origin, scan.pose, &scan.object_texts, &columns),
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
        ScanFormat::Csv | ScanFormat::Pcd => {
            refuse("it is read as a cloud, with no attributes but the intensity and the ring")
        }
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
    for (key, texts) in OBJECT_TEXTS.iter().zip(&scan.object_texts).filter(|of| !of.1.is_empty()) {
        let lines = texts.join("\n");
        npz.array(key, &[lines.len()], lines.bytes())?;
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

/// Attributes may be columns or vectors, compressed or not, of any type that holds their values. Other
/// keys are ignored.
fn read_npz(path: &Path) -> Result<Scan, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let (cloud, origin) = read_npz_points(&mut npz)?;
    let n = cloud.points.len();
    let fits_single = |x: &f64| f64::from(*x as f32) == *x || x.is_nan();
    let mut scan = if cloud.points.as_flattened().iter().all(fits_single) {
        let positions = cloud.points.iter().map(|point| point.map(|x| x as f32));
        Scan { positions: positions.collect(), ..Scan::default() }
    } else {
        Scan::of_points(&cloud.points)
    };
    scan.origin.iter_mut().zip(origin).for_each(|(sum, x)| *sum += x);
    scan.pose = read_npz_pose(&mut npz)?;
    for (key, texts) in OBJECT_TEXTS.iter().zip(&mut scan.object_texts) {
        // In other archives, they may be anything.
        if let Some(Ok(lines)) = npz.has(key).then(|| npz.array::<u8>(key)) {
            let lines = String::from_utf8_lossy(&lines.elements).into_owned();
            *texts = lines.split('\n').map(str::to_owned).collect();
        }
    }
    for attribute in Attribute::ALL {
        if !npz.has(attribute.name()) {
            continue;
        }
        let stored = read_column(&mut npz, attribute, n).and_then(|numbers| {
            let stored = scan.slot(attribute).set(&numbers);
            stored.map_err(|cause| npz.error(attribute.name(), cause))
        });
        // Other reflectivities are intensities.
        if attribute != Attribute::Reflectivity {
            stored?;
        }
    }
    Ok(scan)
}

/// The numbers of an attribute of `n` points.
fn read_column(
    npz: &mut NpzReader,
    attribute: Attribute,
    n: usize,
) -> Result<Vec<f64>, FormatError> {
    npz.entry(attribute.name(), |header, _, elements| {
        npy::check_columns(&header, attribute.column_names().len(), n)?;
        let is_whole = !matches!(header.number(), Some((F16 | F32 | F64, _)));
        // Whole numbers are probably milliseconds or millimetres.
        if is_whole && matches!(attribute, Attribute::Time | Attribute::Range) {
            let found = &header.descr;
            let cause = format!("expected seconds or metres of a floating type, found {found}");
            return Err(invalid(cause));
        }
        npy::read_numbers(elements, &header, |x| x)
    })
}
