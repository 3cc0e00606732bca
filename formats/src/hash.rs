//! SHA-256 of files, so that datasets can be checked with common tools.

use crate::error::FormatError;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

/// The SHA-256 of a file's bytes, as `sha256sum` prints it.
///
/// # Errors
/// If the file cannot be read.
pub fn of_file(path: &Path) -> Result<String, FormatError> {
    let here = |source| FormatError::io(path, source);
    let mut file = File::open(path).map_err(here)?;
    let mut hash = Sha256::new();
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block).map_err(here)? {
            0 => return Ok(hexadecimal(&hash.finalize())),
            n => hash.update(&block[..n]),
        }
    }
}

/// The SHA-256 of `bytes`, in hexadecimal digits.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
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
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
