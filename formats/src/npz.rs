//! Scans as NPZ files that NumPy and Open3D load as they are.
//!
//! | key | type | shape |
//! | --- | --- | --- |
//! | `positions` | f32 | `[n, 3]` |
//! | `range`, `time`, `intensity` | f32 | `[n, 1]` |
//! | `beam`, `triangle`, `object` | u32 | `[n, 1]` |
//! | `ring` | u16 | `[n, 1]` |
//! | `normal` | f32 | `[n, 3]` |
//! | `origin`, only if it is not 0 | f64 | `[3]` |
//!
//! Attributes are columns, not vectors: Open3D 0.20 loads either, but voxel
//! down-sampling and PLY writing fail on a vector. It keeps `origin` as an
//! attribute too; delete it there before joining or thinning clouds.

use std::io::{self, Cursor, Write};
use std::path::Path;

use crate::archive::{NpzReader, NpzWriter, Values};
use crate::atomic;
use crate::error::FormatError;
use crate::number::Number;
use crate::scan::{Attribute, Column, ColumnSlot, Scan};

/// Writes `scan` to `path`, atomically, and returns the SHA-256 of the file; the
/// same scan gives the same bytes.
///
/// # Errors
/// An attribute of another length than the positions; what the system reports.
pub fn write_scan(path: &Path, scan: &Scan) -> Result<String, FormatError> {
    scan.check_lengths()?;
    // A zip archive is patched once an entry is complete, and a file that is
    // hashed while it is written takes its bytes in order.
    let mut archive = Cursor::new(Vec::new());
    NpzWriter::write(&mut archive, |npz| write_arrays(npz, scan))
        .map_err(|source| FormatError::io(path, source))?;
    atomic::write_hashed(path, |writer| writer.write_all(archive.get_ref()))
}

fn write_arrays<W: Write + io::Seek>(npz: &mut NpzWriter<W>, scan: &Scan) -> io::Result<()> {
    write_columns(npz, "positions", scan.positions.as_flattened(), 3)?;
    for (attribute, column) in scan.columns() {
        let key = attribute.name();
        match column {
            Column::F32(values) => write_columns(npz, key, values, 1)?,
            Column::U16(values) => write_columns(npz, key, values, 1)?,
            Column::U32(values) => write_columns(npz, key, values, 1)?,
            Column::Vector(values) => write_columns(npz, key, values.as_flattened(), 3)?,
        }
    }
    if scan.origin != [0.0; 3] {
        npz.array("origin", &[3], scan.origin.into_iter())?;
    }
    Ok(())
}

fn write_columns<W: Write + io::Seek, A: Number>(
    npz: &mut NpzWriter<W>,
    key: &str,
    values: &[A],
    width: usize,
) -> io::Result<()> {
    npz.array(key, &[values.len() / width, width], values.iter().copied())
}

/// Reads a scan. Attributes may be columns or vectors, compressed or not, and
/// keys of other names are passed over.
///
/// # Errors
/// No archive, no `positions`, or an array of another type or length than
/// expected: [`FormatError::Malformed`] with file and key.
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    let mut npz = NpzReader::open(path)?;
    let positions = read_columns::<f32>(&mut npz, "positions", 3, None)?;
    let n = positions.len() / 3;
    let mut scan = Scan { positions: as_vectors(&positions), ..Scan::default() };
    if npz.has("origin") {
        let origin = npz.array::<f64>("origin")?.elements;
        scan.origin =
            origin.try_into().map_err(|_| npz.error("origin", "expected three numbers"))?;
    }
    for attribute in Attribute::ALL {
        let key = attribute.name();
        if !npz.has(key) {
            continue;
        }
        match scan.slot(attribute) {
            ColumnSlot::F32(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::U16(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::U32(slot) => *slot = Some(read_columns(&mut npz, key, 1, Some(n))?),
            ColumnSlot::Vector(slot) => {
                *slot = Some(as_vectors(&read_columns(&mut npz, key, 3, Some(n))?));
            }
        }
    }
    Ok(scan)
}

/// The elements of an array of shape `[n, width]`, or `[n]` if `width` is 1.
fn read_columns<A: Number>(
    npz: &mut NpzReader,
    key: &str,
    width: usize,
    expected: Option<usize>,
) -> Result<Vec<A>, FormatError> {
    let Values { shape, elements } = npz.array(key)?;
    let n = match shape[..] {
        [n] if width == 1 => n,
        [n, columns] if columns == width => n,
        _ => {
            let cause = format!("expected shape [n, {width}], found {shape:?}");
            return Err(npz.error(key, cause));
        }
    };
    match expected {
        Some(expected) if n != expected => {
            Err(npz
                .error(key, format!("expected {expected} values, one for each point, found {n}")))
        }
        _ => Ok(elements),
    }
}

fn as_vectors(elements: &[f32]) -> Vec<[f32; 3]> {
    elements.as_chunks::<3>().0.to_vec()
}
