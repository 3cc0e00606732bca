//! Scans as PLY files, binary little-endian, with a `vertex` for each point.
//!
//! Properties: `x y z`, then `range` (float), `beam` (uint), `ring` (ushort),
//! `time` (float), `triangle` (uint), `object` (uint), `intensity` (float),
//! `nx ny nz` (float), if the scan has them. An origin other than 0 is the comment
//! `origin X Y Z`, and a pose other than the identity the comment `pose` with 16 numbers. Open3D 0.20 reads the properties of type float and
//! skips the others; from NPZ it reads all of them.

use std::fs::File;
use std::io::BufReader;
use std::ops::Range;
use std::path::Path;

use super::elements::read_elements;
use crate::error::FormatError;
use crate::scan::{Attribute, Scan};

/// Reads a scan, ASCII or binary, with properties in any order. Other properties are skipped.
pub fn read_scan(path: &Path) -> Result<Scan, FormatError> {
    let file = File::open(path).map_err(|source| FormatError::io(path, source))?;
    let (mut known, mut values) = (Vec::new(), Vec::new());
    let frame = read_elements(
        &mut BufReader::new(file),
        path,
        &["vertex"],
        |_, vertex| {
            let has = |attribute: &Attribute| {
                attribute.column_names().iter().all(|name| vertex.has(name))
            };
            known = Attribute::ALL.into_iter().filter(has).collect();
            let names = known.iter().flat_map(|attribute| attribute.column_names());
            ["x", "y", "z"].into_iter().chain(names).map(|name| vertex.scalar(name)).collect()
        },
        |_, row| values.extend_from_slice(row),
    )?;
    let width = 3 + known.iter().map(|attribute| attribute.column_names().len()).sum::<usize>();
    let columns = |range: Range<usize>| -> Vec<f64> {
        values.chunks_exact(width).flat_map(|row| row[range.clone()].iter().copied()).collect()
    };
    let mut scan = Scan { pose: frame.pose, ..Scan::default() };
    scan.origin = frame.origin.unwrap_or_default();
    scan.object_texts = frame.object_texts;
    let positions = columns(0..3);
    scan.positions =
        positions.as_chunks().0.iter().map(|at: &[f64; 3]| at.map(|x| x as f32)).collect();
    let mut first = 3;
    for attribute in known {
        let end = first + attribute.column_names().len();
        let stored = scan.slot(attribute).set(&columns(first..end));
        first = end;
        // Other reflectivities are intensities.
        if attribute != Attribute::Reflectivity {
            let part = format!("property {attribute}");
            stored.map_err(|cause| FormatError::malformed(path, part, cause))?;
        }
    }
    Ok(scan)
}
