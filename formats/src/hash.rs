//! Hashes of files, which common tools can check.

use crate::error::FormatError;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fmt::{self, Display, Formatter};
use std::fs::File;
use std::io::Read;
use std::path::Path;

crate::named! {
    /// The hash of the files of a dataset.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Hashing: "hash" {
        /// SHA-256, which `sha256sum` checks. It is fast on processors with instructions for it:
        /// most of x86-64 since 2019, and of AArch64.
        #[default]
        Sha256 = "sha256",
        /// No hash: later changes of files may go unnoticed.
        None = "none",
    }
}

/// The hash of a file's bytes. It is serialised as a field with the name of the hash.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileHash {
    /// SHA-256 in hexadecimal digits, as `sha256sum` prints it.
    pub sha256: String,
}

impl Display for FileHash {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "SHA-256 is {}", self.sha256)
    }
}

#[cfg(feature = "dataset")]
pub(crate) struct Hasher(Option<Sha256>);

#[cfg(feature = "dataset")]
impl Hasher {
    pub(crate) fn new(hashing: Hashing) -> Self {
        Self((hashing == Hashing::Sha256).then(Sha256::new))
    }

    pub(crate) fn update(&mut self, bytes: &[u8]) {
        if let Some(hash) = &mut self.0 {
            hash.update(bytes);
        }
    }

    pub(crate) fn finish(self) -> Option<FileHash> {
        self.0.map(|hash| FileHash { sha256: hexadecimal(&hash.finalize()) })
    }
}

#[cfg(feature = "dataset")]
impl Hashing {
    /// The hash of a file's bytes. With [`Hashing::None`] the file is not opened.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn of_file(self, path: &Path) -> Result<Option<FileHash>, FormatError> {
        let mut hash = Hasher::new(self);
        if self != Self::None {
            for_each_block(path, |block| hash.update(block))?;
        }
        Ok(hash.finish())
    }

    /// The hash of `bytes`.
    #[must_use]
    pub fn of_bytes(self, bytes: &[u8]) -> Option<FileHash> {
        let mut hash = Hasher::new(self);
        hash.update(bytes);
        hash.finish()
    }
}

/// The SHA-256 of a file's bytes, as `sha256sum` prints it.
///
/// # Errors
/// If the file cannot be read.
pub fn of_file(path: &Path) -> Result<String, FormatError> {
    let mut hash = Sha256::new();
    for_each_block(path, |block| hash.update(block))?;
    Ok(hexadecimal(&hash.finalize()))
}

fn for_each_block(path: &Path, mut take: impl FnMut(&[u8])) -> Result<(), FormatError> {
    let here = |source| FormatError::io(path, source);
    let mut file = File::open(path).map_err(here)?;
    let mut block = vec![0; 1 << 16];
    loop {
        match file.read(&mut block).map_err(here)? {
            0 => return Ok(()),
            n => take(&block[..n]),
        }
    }
}

/// The SHA-256 of `bytes`, in hexadecimal digits.
#[must_use]
pub fn of_bytes(bytes: &[u8]) -> String {
    of_parts([bytes])
}

/// The SHA-256 of the concatenated `parts`, in hexadecimal digits.
#[must_use]
pub fn of_parts<T: AsRef<[u8]>>(parts: impl IntoIterator<Item = T>) -> String {
    let mut hash = Sha256::new();
    parts.into_iter().for_each(|part| hash.update(part));
    hexadecimal(&hash.finalize())
}

/// Lower-case hexadecimal digits, two a byte.
#[must_use]
pub fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
#[cfg(feature = "dataset")]
mod tests {
    use super::*;

    #[test]
    fn hashes_equal_published_ones() {
        // FIPS 180-2, appendix B.1.
        let sha256 = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        let hash = Hashing::Sha256.of_bytes(b"abc").unwrap();
        assert_eq!(hash, FileHash { sha256: sha256.to_owned() });
        assert_eq!(Hashing::None.of_bytes(b"abc"), None);
    }

    #[test]
    fn a_hash_is_serialised_as_a_field_of_its_name() {
        #[derive(Debug, PartialEq, Serialize, Deserialize)]
        struct Record {
            file: u8,
            #[serde(flatten)]
            hash: Option<FileHash>,
        }
        for (hash, text) in [
            (Some(FileHash { sha256: "0a".to_owned() }), r#"{"file":1,"sha256":"0a"}"#),
            (None, r#"{"file":1}"#),
        ] {
            let record = Record { file: 1, hash };
            assert_eq!(serde_json::to_string(&record).unwrap(), text);
            assert_eq!(serde_json::from_str::<Record>(text).unwrap(), record);
        }
    }
}
