//! The file formats of clouds, recognised by name or by first bytes.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use crate::error::FormatError;
use crate::npy_header;

/// How many first bytes [`CloudFormat::of_content`] looks at.
pub(super) const SNIFFED_SIZE: usize = 512;

/// A file format of clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum CloudFormat {
    /// Stanford's polygon format.
    Ply,
    /// NumPy's archive of arrays.
    Npz,
    /// NumPy's array.
    Npy,
    /// The Point Cloud Library's format.
    Pcd,
    /// Text, a point a line.
    Text,
    /// Text with commas and a line of column names.
    Csv,
    /// KITTI's raw little-endian f32: x, y, z, intensity.
    Kitti,
    /// The ASPRS's format of airborne scans.
    Las,
}

impl CloudFormat {
    /// All formats, whether or not this build reads them.
    pub const ALL: [Self; 8] =
        [Self::Ply, Self::Npz, Self::Npy, Self::Pcd, Self::Text, Self::Csv, Self::Kitti, Self::Las];

    /// The format's name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Npz => "npz",
            Self::Npy => "npy",
            Self::Pcd => "pcd",
            Self::Text => "xyz",
            Self::Csv => "csv",
            Self::Kitti => "kitti",
            Self::Las => "las",
        }
    }

    /// The format that `path`'s extension names, in whichever case.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] if the extension is unknown or a mesh's.
    pub fn of(path: &Path) -> Result<Self, FormatError> {
        let refuse = |cause: String| Err(FormatError::malformed(path, "extension", cause));
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        match extension.as_str() {
            "ply" => Ok(Self::Ply),
            "npz" => Ok(Self::Npz),
            "npy" => Ok(Self::Npy),
            "pcd" => Ok(Self::Pcd),
            "xyz" | "txt" | "asc" | "tsv" => Ok(Self::Text),
            "csv" => Ok(Self::Csv),
            "bin" => Ok(Self::Kitti),
            "las" => Ok(Self::Las),
            "laz" => refuse(COMPRESSED_LAS.to_owned()),
            "off" | "obj" | "stl" => refuse(MESH.to_owned()),
            _ => {
                refuse(format!("unknown cloud format `{extension}`, expected one of {EXTENSIONS}"))
            }
        }
    }

    /// The format whose files begin with `start`. Errors call the file `name`.
    /// Bytes without a zero that no other format begins with are text.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] for a mesh and for unknown binary data.
    pub fn of_content(start: &[u8], name: &Path) -> Result<Self, FormatError> {
        let refuse = |cause: &str| Err(FormatError::malformed(name, "format", cause));
        let begins = |sign: &[u8]| start.starts_with(sign);
        match () {
            () if begins(b"ply\n") || begins(b"ply\r") => Ok(Self::Ply),
            // An archive without entries begins with the end of its contents.
            () if begins(b"PK\x03\x04") || begins(b"PK\x05\x06") => Ok(Self::Npz),
            () if begins(npy_header::MAGIC) => Ok(Self::Npy),
            () if begins(b"# .PCD") || begins(b"VERSION") => Ok(Self::Pcd),
            () if begins(b"LASF") => Ok(Self::Las),
            () if begins(b"OFF") || begins(b"solid ") => refuse(MESH),
            () if start.contains(&0) => refuse(UNKNOWN),
            () => Ok(Self::Text),
        }
    }
}

/// Why `.laz` is not read.
pub(super) const COMPRESSED_LAS: &str =
    "LAZ is compressed LAS: decompress it first (`laszip`, or `pdal translate in.laz out.las`)";
const MESH: &str = "expected a cloud, found a mesh: scan it first";
const UNKNOWN: &str = "the first bytes are of no known binary format; name the format";
const EXTENSIONS: &str = "ply, npz, npy, pcd, xyz, txt, asc, tsv, csv, bin, las";

impl fmt::Display for CloudFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for CloudFormat {
    type Err = FormatError;

    fn from_str(word: &str) -> Result<Self, FormatError> {
        Self::ALL.into_iter().find(|format| format.name() == word).ok_or_else(|| {
            FormatError::UnknownName {
                word: word.to_owned(),
                what: "cloud format",
                choices: Self::ALL.map(Self::name).join(", "),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_found_by_its_name() {
        for format in CloudFormat::ALL {
            assert_eq!(format.to_string().parse::<CloudFormat>().unwrap(), format);
        }
        let error = "e57".parse::<CloudFormat>().unwrap_err().to_string();
        assert!(error.starts_with("unknown cloud format `e57`, expected one of ply, npz,"));
    }

    #[test]
    fn a_name_tells_the_format() {
        for (name, format) in [
            ("a/b.PLY", CloudFormat::Ply),
            ("b.tar.npz", CloudFormat::Npz),
            ("000000.bin", CloudFormat::Kitti),
            ("lidar.pcd.bin", CloudFormat::Kitti),
            ("c.txt", CloudFormat::Text),
        ] {
            assert_eq!(CloudFormat::of(Path::new(name)).unwrap(), format);
        }
        let refusal = |name: &str| CloudFormat::of(Path::new(name)).unwrap_err().to_string();
        assert_eq!(
            refusal("chair.off"),
            "chair.off: extension: expected a cloud, found a mesh: scan it first"
        );
        assert!(refusal("a.laz").starts_with("a.laz: extension: LAZ is compressed LAS: "));
        assert!(
            refusal("a").starts_with("a: extension: unknown cloud format ``, expected one of ply,")
        );
    }

    #[test]
    fn the_first_bytes_tell_the_format() {
        let of = |start: &[u8]| CloudFormat::of_content(start, Path::new("-"));
        assert_eq!(of(b"plywood 1 2").unwrap(), CloudFormat::Text);
        assert_eq!(of(b"").unwrap(), CloudFormat::Text);
        let mesh = of(b"OFF\n8 6 12\n").unwrap_err().to_string();
        assert_eq!(mesh, "-: format: expected a cloud, found a mesh: scan it first");
        let raw = of(&[0, 0, 0x80, 0x3f]).unwrap_err().to_string();
        assert_eq!(
            raw,
            "-: format: the first bytes are of no known binary format; name the format"
        );
    }
}
