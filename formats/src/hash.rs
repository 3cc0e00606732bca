//! SHA-256 of files, so that datasets can be checked with common tools.

use crate::error::FormatError;
use sha2::{Digest, Sha256};
use std::fmt::Write;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// The SHA-256 of a file's bytes, as `sha256sum` prints it.
///
/// # Errors
/// If the file cannot be read.
pub fn of_file(path: &Path) -> Result<String, FormatError> {
    digest(path).map_err(|error| FormatError::io(path, error))
}

/// The SHA-256 of `bytes`, in hexadecimal digits.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn digest(path: &Path) -> io::Result<String> {
    let mut file = File::open(path)?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block)? {
            0 => return Ok(hexadecimal(&hash.finalize())),
            n => hash.update(&block[..n]),
        }
    }
}

/// A file as it was written, and the SHA-256 of its bytes in hexadecimal digits.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct HashedFile {
    /// Where the file is.
    pub path: PathBuf,
    /// Its hash.
    pub sha256: String,
}

/// Lower-case hexadecimal digits, two a byte.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}");
        digits
    })
}
