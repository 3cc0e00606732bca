//! Scans on disk, in whichever format the user asked for.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::FormatError;
use crate::scan::Scan;
use crate::{csv, npz, ply};

/// A format in which scans are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScanFormat {
    /// NumPy archive: see [`npz`].
    Npz,
    /// Binary PLY: see [`ply`].
    Ply,
    /// Text: see [`csv`]. It is written, not read.
    Csv,
    /// A sensor's packets: see `vlp32c`. They hold ranges along beams, not
    /// points, so that writing them takes the sensor, too.
    Pcap,
}

impl ScanFormat {
    /// All formats.
    pub const ALL: [Self; 4] = [Self::Npz, Self::Ply, Self::Csv, Self::Pcap];

    /// The formats of points, which [`write_scan`] writes.
    pub const POINTS: [Self; 3] = [Self::Npz, Self::Ply, Self::Csv];

    /// The file name's extension, without the dot.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Ply => "ply",
            Self::Csv => "csv",
            Self::Pcap => "pcap",
        }
    }

    /// The format that `path`'s extension names, in whichever case.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] if it names none.
    pub fn of(path: &Path) -> Result<Self, FormatError> {
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        extension.parse().map_err(|error| FormatError::malformed(path, "extension", error))
    }
}

impl fmt::Display for ScanFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.extension())
    }
}

impl FromStr for ScanFormat {
    type Err = FormatError;

    fn from_str(word: &str) -> Result<Self, FormatError> {
        Self::ALL.into_iter().find(|format| format.extension() == word).ok_or_else(|| {
            FormatError::UnknownName {
                word: word.to_owned(),
                what: "scan format",
                choices: Self::ALL.map(Self::extension).join(", "),
            }
        })
    }
}

/// What is said to whoever takes packets for points.
const PACKETS: &str = "packets hold a sensor's ranges, not points";

/// Writes `scan` to `path`, atomically, and returns the SHA-256 of the file. The
/// name is taken as it is.
///
/// # Errors
/// An attribute of another length than the positions; packets, which are no
/// points; what the system reports.
pub fn write_scan(path: &Path, format: ScanFormat, scan: &Scan) -> Result<String, FormatError> {
    match format {
        ScanFormat::Npz => npz::write_scan(path, scan),
        ScanFormat::Ply => ply::write_scan(path, scan),
        ScanFormat::Csv => csv::write_scan(path, scan),
        ScanFormat::Pcap => Err(FormatError::malformed(path, "extension", PACKETS)),
    }
}

/// Reads the scan at `path`, an NPZ or PLY file by its extension.
///
/// # Errors
/// A file that cannot be read or is not what its extension says.
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    match ScanFormat::of(path)? {
        ScanFormat::Npz => npz::read_scan(path),
        ScanFormat::Ply => ply::read_scan(path),
        ScanFormat::Csv => {
            Err(FormatError::malformed(path, "extension", "CSV is written but not read"))
        }
        ScanFormat::Pcap => Err(FormatError::malformed(path, "extension", PACKETS)),
    }
}
