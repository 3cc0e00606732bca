//! Arrays of an NPZ archive of real sweeps, as they were written: version 1, C order.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// An array's header and the bytes of its elements.
pub struct Array {
    header: String,
    bytes: Vec<u8>,
}

impl Array {
    /// The array `key` of the archive, if it has one.
    pub fn read(archive: &Path, key: &str) -> Option<Self> {
        let mut archive = zip::ZipArchive::new(File::open(archive).unwrap()).unwrap();
        let mut file = Vec::new();
        archive.by_name(&format!("{key}.npy")).ok()?.read_to_end(&mut file).unwrap();
        let end = 10 + usize::from(u16::from_le_bytes([file[8], file[9]]));
        let header = String::from_utf8(file[10..end].to_vec()).unwrap();
        Some(Self { header, bytes: file[end..].to_vec() })
    }

    /// The elements, `N` bytes each.
    pub fn elements<const N: usize, T>(&self, decode: impl Fn([u8; N]) -> T) -> Vec<T> {
        let (elements, rest) = self.bytes.as_chunks::<N>();
        assert!(rest.is_empty());
        elements.iter().map(|&bytes| decode(bytes)).collect()
    }

    /// The lines of an array of text.
    pub fn text(&self) -> Vec<String> {
        let width = self.header.split("'<U").nth(1).unwrap().split('\'').next().unwrap();
        let letters = self.elements(|bytes| char::from_u32(u32::from_le_bytes(bytes)).unwrap());
        let lines = letters.chunks_exact(width.parse().unwrap());
        lines.map(|line| line.iter().filter(|c| **c != '\0').collect()).collect()
    }
}
