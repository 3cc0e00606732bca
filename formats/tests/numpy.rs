use std::io::{Cursor, Write};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// An NPY file whose header is the dictionary `{'descr': ..., ...}`.
pub fn npy(descr: &str, is_fortran_order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dictionary = format!(
        "{{'descr': '{descr}', 'fortran_order': {is_fortran_order}, 'shape': {shape}, }}\n"
    );
    let length = (dictionary.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\0", &length[..], dictionary.as_bytes(), data].concat()
}

/// An archive of arrays, deflated as `np.savez_compressed` does.
pub fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    archive(arrays, SimpleFileOptions::default())
}

pub fn archive(arrays: &[(&str, Vec<u8>)], options: SimpleFileOptions) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (key, bytes) in arrays {
        zip.start_file(format!("{key}.npy"), options).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}
