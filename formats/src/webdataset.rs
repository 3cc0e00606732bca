//! Writes samples in tars, as WebDataset and Hugging Face's `datasets` read them: adjacent files of one
//! stem are one sample. The same samples give the same bytes.

use std::io::{self, Cursor, Write};

use crate::archive::NpzWriter;
use crate::scan::Scan;
use crate::scan_file::write_npz;

/// The size of a block of a tar, bytes.
const BLOCK: usize = 512;

/// Appends a file called `name`, of at most 100 bytes, to `tar`.
pub fn append_file(tar: &mut impl Write, name: &str, bytes: &[u8]) -> io::Result<()> {
    let mut header = tar::Header::new_ustar();
    header.set_path(name)?;
    header.set_size(bytes.len() as u64);
    header.set_entry_type(tar::EntryType::Regular);
    // Nothing depends on the user or the time.
    header.set_mode(0o644);
    header.set_uid(0);
    header.set_gid(0);
    header.set_mtime(0);
    header.set_cksum();
    tar.write_all(header.as_bytes())?;
    tar.write_all(bytes)?;
    tar.write_all(&[0; BLOCK][..bytes.len().next_multiple_of(BLOCK) - bytes.len()])
}

/// Ends `tar`.
pub fn end(tar: &mut impl Write) -> io::Result<()> {
    tar.write_all(&[0; 2 * BLOCK])
}

/// The NPZ file of clouds of `n_points` points: `points` f32 `[m, n, 3]`, `labels` i64 `[m]`.
pub fn npz_of_clouds(clouds: &[(Vec<[f32; 3]>, usize)], n_points: usize) -> io::Result<Vec<u8>> {
    npz(|npz| {
        let numbers: Vec<f32> =
            clouds.iter().flat_map(|(points, _)| points.as_flattened()).copied().collect();
        npz.array("points", &[clouds.len(), n_points, 3], numbers.into_iter())?;
        npz.array("labels", &[clouds.len()], clouds.iter().map(|(_, label)| *label as i64))
    })
}

/// The NPZ file of a scan, as [`write_scan`](crate::scan_file::write_scan) writes it.
pub fn npz_of_scan(scan: &Scan) -> io::Result<Vec<u8>> {
    npz(|npz| write_npz(npz, scan))
}

fn npz(
    fill: impl FnOnce(&mut NpzWriter<&mut Cursor<Vec<u8>>>) -> io::Result<()>,
) -> io::Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    NpzWriter::write(&mut bytes, fill)?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_is_too_long_is_refused() {
        assert!(append_file(&mut Vec::new(), &"n".repeat(101), &[]).is_err());
    }
}
