//! The file formats of clouds, recognised by their extension or their first bytes.

use std::path::Path;

use crate::error::FormatError;
use crate::lines::BYTE_ORDER_MARK;
use crate::npy;
use crate::plausible::foreign;
use crate::records;

/// The number of first bytes that [`CloudFormat::of_content`] examines.
pub(super) const SNIFFED_SIZE: usize = 512;

crate::named! {
    /// A file format of clouds. A build need not include all of them.
    #[non_exhaustive]
    pub enum CloudFormat: "cloud format" {
        /// Stanford's polygon format.
        Ply = "ply",
        /// NumPy's archive of arrays.
        Npz = "npz",
        /// NumPy's array.
        Npy = "npy",
        /// The Point Cloud Library's format.
        Pcd = "pcd",
        /// Text with a line for each point.
        Text = "xyz",
        /// Text with commas and a line of column names.
        Csv = "csv",
        /// KITTI's raw little-endian f32: x, y, z, intensity.
        Kitti = "kitti",
        /// nuScenes' raw little-endian f32: x, y, z, intensity, ring.
        Nuscenes = "nuscenes",
        /// The ASPRS's format of airborne scans.
        Las = "las",
    }
}

impl CloudFormat {
    /// The format of the extension of `path`, in upper or lower case.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] for an unknown extension or that of a mesh.
    pub fn of_path(path: &Path) -> Result<Self, FormatError> {
        let refuse = |cause: String| Err(FormatError::malformed(path, "extension", cause));
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        match extension.as_str() {
            "ply" => Ok(Self::Ply),
            "npz" => Ok(Self::Npz),
            "npy" => Ok(Self::Npy),
            "pcd" => Ok(Self::Pcd),
            "xyz" | "txt" | "asc" | "tsv" | "pts" => Ok(Self::Text),
            "csv" => Ok(Self::Csv),
            "bin" if stem.to_lowercase().ends_with(".pcd") => Ok(Self::Nuscenes),
            "bin" => Ok(Self::Kitti),
            "las" => Ok(Self::Las),
            "laz" => refuse(COMPRESSED_LAS.to_owned()),
            "off" | "obj" | "stl" => refuse(MESH.to_owned()),
            "pcap" | "pcapng" | "cap" => refuse(CAPTURE.to_owned()),
            _ => {
                refuse(format!("unknown cloud format `{extension}`, expected one of {EXTENSIONS}"))
            }
        }
    }

    /// As [`CloudFormat::of_path`], of a cloud to write: LAS and raw floats are only read.
    ///
    /// # Errors
    /// As [`CloudFormat::of_path`]; a format that is only read.
    pub fn of_output(path: &Path) -> Result<Self, FormatError> {
        match Self::of_path(path)? {
            Self::Kitti | Self::Nuscenes | Self::Las => {
                let cause = "expected a format to write: .ply, .npz, .npy, .pcd, .xyz or .csv";
                Err(FormatError::malformed(path, "extension", cause))
            }
            format => Ok(format),
        }
    }

    /// The format of the file at `path` by its first bytes, if these are unmistakable.
    pub(super) fn of_signature(path: &Path) -> Option<Self> {
        let mut start = [0; SIGNED_SIZE];
        // Opening a named pipe would wait for a writer.
        let mut file = path.is_file().then(|| std::fs::File::open(path).ok()).flatten()?;
        let n = records::fill(&mut file, &mut start).ok()?;
        let found = Self::of_content(&start[..n], path).ok()?;
        // Of other archives than NumPy's, the first file has another name.
        let is_whole = found != Self::Npz || start.windows(4).any(|name| name == b".npy");
        (is_whole && found != Self::Text).then_some(found)
    }

    /// The format whose files begin with `start`, or text if no format does and no byte is zero.
    /// Errors call the file `name`.
    ///
    /// # Errors
    /// [`FormatError::Malformed`] for a mesh and for unknown binary data.
    pub fn of_content(start: &[u8], name: &Path) -> Result<Self, FormatError> {
        let refuse = |cause: &str| Err(FormatError::malformed(name, "format", cause));
        let text = start.strip_prefix(BYTE_ORDER_MARK).unwrap_or(start);
        let begins = |sign: &[u8]| text.starts_with(sign);
        match () {
            () if begins(b"ply\n") || begins(b"ply\r") => Ok(Self::Ply),
            // An archive without entries begins with the end of its directory.
            () if begins(b"PK\x03\x04") || begins(b"PK\x05\x06") => Ok(Self::Npz),
            () if begins(npy::MAGIC) => Ok(Self::Npy),
            () if begins(b"# .PCD") || begins(b"VERSION") => Ok(Self::Pcd),
            () if begins(b"LASF") => Ok(Self::Las),
            () if begins(b"OFF") || begins(b"solid ") => refuse(MESH),
            () => match foreign(start) {
                Some(found) => refuse(&format!("expected a cloud, found {found}")),
                None if start.contains(&0) => refuse(UNKNOWN),
                None => Ok(Self::Text),
            },
        }
    }
}

/// Bytes at the start of a file that are examined for [`CloudFormat::of_signature`]: enough for the
/// name of an archive's first file.
const SIGNED_SIZE: usize = 128;

pub(super) const COMPRESSED_LAS: &str =
    "LAZ is compressed LAS: decompress it first (`laszip`, or `pdal translate in.laz out.las`)";
pub(super) const MESH: &str = "expected a cloud, found a mesh: scan it first";
const CAPTURE: &str = "expected a cloud, found a capture: `edgepuck detect --segment-only` cuts its first turn into clouds";
const UNKNOWN: &str =
    "the first bytes are of no known binary format; name the format by --input-format";
const EXTENSIONS: &str = "ply, npz, npy, pcd, xyz, txt, asc, tsv, pts, csv, bin, las";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_tells_the_format() {
        for (name, format) in [
            ("a/b.PLY", CloudFormat::Ply),
            ("b.tar.npz", CloudFormat::Npz),
            ("000000.bin", CloudFormat::Kitti),
            ("LIDAR.PCD.BIN", CloudFormat::Nuscenes),
            ("c.txt", CloudFormat::Text),
            ("c.pts", CloudFormat::Text),
        ] {
            assert_eq!(CloudFormat::of_path(Path::new(name)).unwrap(), format);
        }
        let refusal = |name: &str| CloudFormat::of_path(Path::new(name)).unwrap_err().to_string();
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
        assert_eq!(of(b"\xef\xbb\xbfply\n").unwrap(), CloudFormat::Ply);
        let mesh = of(b"OFF\n8 6 12\n").unwrap_err().to_string();
        assert_eq!(mesh, "-: format: expected a cloud, found a mesh: scan it first");
        let raw = of(&[0, 0, 0x80, 0x3f]).unwrap_err().to_string();
        assert_eq!(
            raw,
            "-: format: the first bytes are of no known binary format; name the format by --input-format"
        );
    }
}
